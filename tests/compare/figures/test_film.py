"""A film shows ball, wall and force of every shot, its curve grows, and it is made once; without GL there is a sentence."""

from __future__ import annotations

import itertools
import pathlib

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from hqp_rp.compare.contestants import Contestant, variants
from hqp_rp.compare.figures.film import FRAMES_PER_SECOND, LAST, Shot, film_all, gl_missing
from hqp_rp.compare.figures.film_sheet import COLUMN, CURVE, FOOT, HEAD
from hqp_rp.compare.figures.film_shot import record, telling
from hqp_rp.compare.figures.film_stage import NEAR, WHOLE
from hqp_rp.core.variant import EXACT
from hqp_rp.scenarios._interaction import PAPER, REGULAR, Case
from hqp_rp.scenarios.sawyer_force_tracking import SawyerForceTracking
from hqp_rp.scenarios.sawyer_wall_contact import SawyerWallContact
from tests.scenarios.crossings import SometimesNothing

Pixels = NDArray[np.int64]

SCENARIO = SawyerWallContact(duration=0.4)
REVERSE = variants("reverse_priority")[0]
FAILING = Contestant("fails", SometimesNothing(period=80), EXACT)
NEAR_BOX = (COLUMN - NEAR[1] - 8, HEAD + 4, COLUMN - 8, HEAD + 4 + NEAR[0])
ARM_BOX = (0, HEAD, WHOLE[1], HEAD + WHOLE[0])
TEXT_BOX = (COLUMN - NEAR[1] - 8, NEAR_BOX[3] + 2, COLUMN - 2, HEAD + WHOLE[0])
CURVE_BOX = (54, HEAD + WHOLE[0] + 28, COLUMN - 16, HEAD + WHOLE[0] + CURVE - 40)


def case(scenario: SawyerWallContact | SawyerForceTracking) -> Case:
    return next(case for case in scenario.cases() if (case.gains, case.place) == (PAPER, REGULAR))


SHOTS = (Shot(SCENARIO, case(SCENARIO), REVERSE, title="It comes to rest"), Shot(SCENARIO, case(SCENARIO), FAILING))


def frames(path: pathlib.Path) -> list[Pixels]:
    with Image.open(path) as picture:
        found = []
        for k in range(getattr(picture, "n_frames", 1)):
            picture.seek(k)
            found.append(np.asarray(picture.convert("RGB"), dtype=np.int64))
    return found


def part(frame: Pixels, box: tuple[int, int, int, int], column: int = 0) -> Pixels:
    left, top, right, bottom = box
    return frame[top:bottom, COLUMN * column + left : COLUMN * column + right]


def orange(pixels: Pixels) -> int:
    r, g, b = np.moveaxis(pixels, 2, 0)
    return int(((r > 150) & (r - g > 60) & (r - b > 110)).sum())


def blue(pixels: Pixels) -> int:
    r, g, b = np.moveaxis(pixels, 2, 0)
    return int(((b - r > 80) & (b > g + 20)).sum())


def red(pixels: Pixels) -> int:
    r, g, b = np.moveaxis(pixels, 2, 0)
    return int(((r > 150) & (g < 90) & (b < 90)).sum())


def brown(pixels: Pixels) -> int:
    r, g, b = np.moveaxis(pixels, 2, 0)
    return int(((r - b > 25) & (r - b < 100) & (r > g) & (g > b)).sum())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    reason = gl_missing()
    if reason:
        pytest.skip(reason)
    where = tmp_path_factory.mktemp("films")
    assert film_all({"wall": SHOTS}, where) == ["wall.webp"]
    return where


def test_there_is_a_film_in_real_time_and_a_still_and_nothing_else(folder: pathlib.Path) -> None:
    assert sorted(path.name for path in folder.iterdir()) == ["wall.png", "wall.webp"]
    size = (2 * COLUMN, HEAD + WHOLE[0] + CURVE + FOOT)
    with Image.open(folder / "wall.webp") as picture:
        assert picture.size == size
        assert getattr(picture, "n_frames", 1) == 0.4 * FRAMES_PER_SECOND + 1
        picture.seek(1)
        picture.load()
        assert picture.info["duration"] == 1000 / FRAMES_PER_SECOND
        picture.seek(8)
        picture.load()
        assert picture.info["duration"] == LAST
    with Image.open(folder / "wall.png") as still:
        assert still.size == size


def test_ball_and_wall_are_seen_in_every_frame_of_every_shot(folder: pathlib.Path) -> None:
    for frame in frames(folder / "wall.webp"):
        for column in (0, 1):
            assert orange(part(frame, NEAR_BOX, column)) > 400
            assert brown(part(frame, NEAR_BOX, column)) > 800
            assert orange(part(frame, ARM_BOX, column)) > 10


def test_the_arrow_is_there_while_there_is_a_force(folder: pathlib.Path) -> None:
    shown = frames(folder / "wall.webp")
    assert blue(part(shown[0], NEAR_BOX)) == 0
    assert blue(part(shown[-1], NEAR_BOX)) > 200
    assert blue(part(shown[-1], ARM_BOX)) > 20
    force = record(SHOTS[0]).force["x"]
    assert force[75] > 1.4 * force[-1]
    assert blue(part(shown[3], NEAR_BOX)) > 1.3 * blue(part(shown[-1], NEAR_BOX))


def test_the_curve_grows_with_time_and_is_whole_in_the_still(folder: pathlib.Path) -> None:
    lengths = [blue(part(frame, CURVE_BOX)) for frame in frames(folder / "wall.webp")]
    assert lengths[0] < 10
    assert all(after > before for before, after in itertools.pairwise(lengths[1:]))
    still = blue(part(frames(folder / "wall.png")[0], CURVE_BOX))
    assert still == pytest.approx(lengths[-1], rel=0.2)


def test_a_run_that_ended_early_says_so(folder: pathlib.Path) -> None:
    shown = frames(folder / "wall.webp")
    assert [red(part(frame, TEXT_BOX, 1)) > 50 for frame in shown] == [False] * 4 + [True] * 5
    assert not any(red(part(frame, TEXT_BOX, 0)) for frame in shown)


def test_a_film_that_is_there_is_not_made_again(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "no_such_back_end")
    (tmp_path / "wall.webp").write_bytes(b"made before")
    assert film_all({"wall": SHOTS}, tmp_path) == ["wall.webp"]
    assert (tmp_path / "wall.webp").read_bytes() == b"made before"
    name, sentence = film_all({"more": SHOTS, "wall": SHOTS}, tmp_path)
    assert name == "wall.webp"
    assert sentence.startswith("No film: ")


def test_without_a_back_end_there_is_a_sentence_and_no_folder(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "no_such_back_end")
    (sentence,) = film_all({"wall": SHOTS}, tmp_path / "films")
    assert sentence.startswith("No film: MuJoCo's GL back end 'no_such_back_end' does not start on this machine.")
    assert not (tmp_path / "films").exists()


def test_a_record_has_every_wall_and_says_whether_it_is_complete() -> None:
    scenario = SawyerForceTracking(duration=0.02)
    run = record(Shot(scenario, case(scenario), REVERSE))
    assert run.complete
    assert set(run.force) == set(run.desired) == {"x", "y"}
    assert run.q.shape == (10, 7)
    np.testing.assert_allclose(run.time, 0.002 * np.arange(1, 11))
    assert [run.at(time) for time in (0.0, 0.002, 0.01, 5.0)] == [0, 0, 4, 9]
    stopped = record(Shot(scenario, case(scenario), Contestant("fails", SometimesNothing(period=4), EXACT)))
    assert not stopped.complete
    assert len(stopped.time) == 4


def test_the_telling_moment_is_where_the_forces_differ_most() -> None:
    run, other = (record(shot) for shot in SHOTS)
    shorter = len(other.time)
    difference = np.abs(run.force["x"][:shorter] - other.force["x"])
    rest = np.abs(run.force["x"][shorter:] - other.force["x"][-1])
    largest = int(np.argmax(np.concatenate((difference, rest))))
    assert telling([run, other], 0.002, 0.4) == pytest.approx(run.time[largest])
    alone = int(np.argmax(np.abs(run.force["x"] - run.desired["x"])))
    assert telling([run], 0.002, 0.4) == pytest.approx(run.time[alone])
