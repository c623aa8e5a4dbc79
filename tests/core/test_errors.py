"""Errors: one root, a builtin each, and messages that name the value, the valid ones and the nearest."""

import pytest

from hqp_rp import (
    FileError,
    HqpError,
    MissingExtraError,
    ProblemError,
    RobotError,
    SettingError,
    UnknownNameError,
    WorkLimitError,
)
from hqp_rp.core.errors import unknown_name, unknown_setting


@pytest.mark.parametrize(
    ("error", "builtin"),
    [
        (ProblemError, ValueError),
        (UnknownNameError, LookupError),
        (SettingError, TypeError),
        (SettingError, ValueError),
        (FileError, ValueError),
        (WorkLimitError, RuntimeError),
        (RobotError, ValueError),
        (MissingExtraError, ImportError),
    ],
)
def test_each_derives_from_the_root_and_a_builtin(error: type[Exception], builtin: type[Exception]) -> None:
    assert issubclass(error, HqpError)
    assert issubclass(error, builtin)
    with pytest.raises(builtin, match=r"^what$"):
        raise error("what")


def test_unknown_name() -> None:
    error = unknown_name("scenario", "planar_crosing", ["sawyer_crossing", "planar_crossing"])
    assert isinstance(error, UnknownNameError)
    assert str(error) == (
        "There is no scenario named 'planar_crosing'. Did you mean 'planar_crossing'? "
        "Valid: planar_crossing, sawyer_crossing."
    )
    assert str(unknown_name("scenario", 7, [])) == "There is no scenario named 7. Valid: none."
    assert str(UnknownNameError()) == ""


def test_unknown_setting() -> None:
    error = unknown_setting("null_space", "zzz", ["damping"])
    assert isinstance(error, SettingError)
    assert str(error) == "There is no setting of null_space named 'zzz'. Valid: damping."
