"""A recorded run: what comes back from a file is what happened, and a file that is none is told in one error."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hqp_rp
from hqp_rp.compare.command_line import main
from hqp_rp.compare.exit_codes import MISUSE
from hqp_rp.compare.play import recording as recording_module
from hqp_rp.compare.play.figure import figure_of
from hqp_rp.compare.play.loop import PlayLoop, Step
from hqp_rp.compare.play.recording import Recording, is_recording, load_recording
from hqp_rp.control.command import Mode
from hqp_rp.control.stack_file import load_stack
from hqp_rp.core.damping import ConstantDamping
from hqp_rp.robot.robot_source import RobotSource


def run() -> tuple[Recording, list[Step]]:
    """An arm; then a ghost beside it; another solver; a drive; hard rows that the closed form refuses."""
    loop = PlayLoop(RobotSource("sawyer"), load_stack("sawyer"), "null_space")
    loop.record()
    loop.drag(0, position=loop.place(0)[:3] + np.array([0.1, 0.1, 0.0]))
    steps = [loop.step() for _ in range(10)]
    loop.compare_with("reverse_priority")
    steps += [loop.step() for _ in range(10)]
    loop.choose("null_space", ConstantDamping(0.1))
    steps += [loop.step() for _ in range(10)]
    loop.drive_home()
    while loop.driving:
        steps.append(loop.step())
    loop.hold_joint_limits(True)
    steps += [loop.step() for _ in range(5)]
    return loop.stop_recording(), steps


@pytest.fixture(scope="module")
def recorded() -> tuple[Recording, list[Step]]:
    return run()


def test_a_recording_holds_every_step_as_it_happened(recorded: tuple[Recording, list[Step]], tmp_path: Path) -> None:
    recording, steps = recorded
    path = recording.save(tmp_path / "run.npz")
    assert is_recording(path)
    again = load_recording(path)
    assert len(again) == len(steps)
    assert again.arms == 2
    assert again.levels == ("tool position", "tool orientation", "posture")
    assert again.targets == ("tool",)
    assert again.source() == RobotSource("sawyer")
    for i, step in enumerate(steps):
        assert again.time[i] == step.time
        assert bool(again.driving[i]) is step.driving
        np.testing.assert_array_equal(again.place[i], step.targets)
        for arm in range(2):
            state = again.state(i, arm)
            if arm >= len(step.arms):
                assert state is None
                continue
            assert state is not None
            for name in ("q", "error", "residual", "rank", "rows", "sigma_min"):
                np.testing.assert_array_equal(getattr(state, name), getattr(step.arms[arm], name))
            for name in ("share", "mode", "status", "reason", "limits", "bounded", "solve_time"):
                assert getattr(state, name) == getattr(step.arms[arm], name), name
            np.testing.assert_equal(state.speed, step.arms[arm].speed)
    assert again.solver_of(0) == "null_space"
    assert again.solver_of(25) == "null_space (damping constant(0.1))"
    assert again.solver_of(25, 1) == "reverse_priority"
    assert again.mode[-1, 0] == list(Mode).index(Mode.STOPPED)
    assert (
        repr(again)
        == f"Recording({len(steps)} steps, {0.01 * len(steps):g} s, 2 solver(s), {' > '.join(again.levels)})"
    )


def test_a_recording_ends_by_itself_when_it_is_full(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording_module, "MOST_STEPS", 5)
    loop = PlayLoop(RobotSource("planar4"), load_stack("planar4"), "null_space")
    assert not loop.recording
    loop.record()
    with pytest.raises(hqp_rp.SettingError, match="no step yet"):
        loop.stop_recording()
    loop.record()
    for _ in range(8):
        assert loop.recording is (loop.time < 5 * loop.dt - 1e-9)
        loop.step()
    assert len(loop.stop_recording()) == 5
    assert not loop.recording


def damaged(path: Path, **changes: Any) -> None:
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    np.savez(path, **{name: value for name, value in (arrays | changes).items() if value is not None})


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"version": np.array(9)}, "format version 9; this release of hqp_rp reads version 1"),
        ({"format": np.array("something")}, "not a recording of hqp-rp play"),
        ({"speed": None}, "the array 'speed' is missing"),
        ({"speed": np.zeros((2, 1))}, r"damaged \(speed has shape \(2, 1\), not"),
        ({"limits": np.full((0, 2), 7)}, "limits has shape"),
        ({"levels": np.array("[")}, "damaged"),
    ],
)
def test_a_file_that_is_no_recording_is_one_error(
    changes: dict[str, Any], words: str, recorded: tuple[Recording, list[Step]], tmp_path: Path
) -> None:
    path = recorded[0].save(tmp_path / "run.npz")
    damaged(path, **changes)
    with pytest.raises(hqp_rp.FileError, match=words) as told:
        load_recording(path)
    assert str(told.value).startswith(str(path))


def test_numbers_that_name_no_text_or_mode_are_found(recorded: tuple[Recording, list[Step]], tmp_path: Path) -> None:
    for name, wrong in (("limits", 10**6), ("mode", 7)):
        path = recorded[0].save(tmp_path / "run.npz")
        damaged(path, **{name: np.full_like(getattr(recorded[0], name), wrong)})
        with pytest.raises(hqp_rp.FileError, match="damaged"):
            load_recording(path)


def test_other_files_are_no_recordings(tmp_path: Path) -> None:
    (tmp_path / "text.npz").write_text("nothing")
    problem = hqp_rp.Problem([hqp_rp.Level.equality(np.eye(2), [1.0, 2.0])])
    hqp_rp.save_problem(problem, tmp_path / "problem.npz")
    for name, words in (
        ("none", "no such file"),
        ("text", "not a .npz file, or damaged; recordings are written by hqp-rp play"),
        ("problem", "not a recording"),
    ):
        assert not is_recording(tmp_path / f"{name}.npz")
        with pytest.raises(hqp_rp.FileError, match=words):
            load_recording(tmp_path / f"{name}.npz")


def test_a_recording_cannot_be_written_where_no_folder_is(
    recorded: tuple[Recording, list[Step]], tmp_path: Path
) -> None:
    with pytest.raises(hqp_rp.FileError, match="the recording cannot be written"):
        recorded[0].save(tmp_path / "nowhere" / "run.npz")


def test_the_figure_shows_each_level_of_each_solver_and_what_happened(recorded: tuple[Recording, list[Step]]) -> None:
    recording, _ = recorded
    figure = figure_of(recording)
    errors, sigmas, speeds, limits = figure.axes
    changes = 1 + 1  # the arm's damping; then its limits, which put the damping back to what was given
    assert len(errors.lines) == len(sigmas.lines) == 2 * 3 + changes
    np.testing.assert_allclose(
        np.asarray(errors.lines[0].get_ydata(), dtype=float), np.maximum(recording.error[:, 0, 0], 1e-12)
    )
    np.testing.assert_array_equal(errors.lines[0].get_xdata(), recording.time)
    assert np.isnan(np.asarray(errors.lines[3].get_ydata(), dtype=float)[:10]).all()  # no ghost yet
    assert errors.get_yscale() == sigmas.get_yscale() == speeds.get_yscale() == "log"
    assert limits.get_ylabel() == "rows at\na bound"
    colors = [patch.get_facecolor()[:3] for patch in errors.patches]
    assert colors.count((0.5, 0.5, 0.5)) == 1  # one drive
    assert len(colors) == 1 + 2  # and both closed forms without an answer to hard rows
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts[:3] == ["1 tool position", "2 tool orientation", "3 posture"]
    assert texts[3:] == [
        "arm: null_space, then null_space (damping constant(0.1)), then null_space",
        "ghost: reverse_priority",
    ]


# --- the command -----------------------------------------------------------------------------------------------------


def test_replay_writes_a_recording_as_a_figure(
    recorded: tuple[Recording, list[Step]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(recorded[0].save(tmp_path / "run.npz"))
    assert main(["replay", path, "--figure", str(tmp_path / "run.png")]) == 0
    assert f"The figure: {tmp_path / 'run.png'}" in capsys.readouterr().out
    assert (tmp_path / "run.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--figure", "run.gif"], "a figure is written as .png, .pdf or .svg"),
        (["--figure", "nowhere/run.png"], "the figure cannot be written"),
        (["--solver", "null_space"], "a recorded run, which is shown as it was; leave --solver out"),
    ],
)
def test_wrong_options_of_a_replay_are_one_line(
    more: list[str],
    words: str,
    recorded: tuple[Recording, list[Step]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    recorded[0].save("run.npz")
    assert main(["replay", "run.npz", *more]) == MISUSE
    told = capsys.readouterr().err
    assert words in told
    assert told.count("\n") == 1


def test_a_saved_problem_is_replayed_as_before_and_has_no_such_figure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = hqp_rp.save_problem(hqp_rp.Problem([hqp_rp.Level.equality(np.eye(2), [1.0, 2.0])]), tmp_path / "problem.npz")
    assert main(["replay", str(path)]) == 0
    assert f"|x| = {math.sqrt(5.0):.6g}" in capsys.readouterr().out
    assert main(["replay", str(path), "--figure", str(tmp_path / "run.png")]) == MISUSE
    assert "--figure is for one recording of hqp-rp play" in capsys.readouterr().err
