"""A trial of every kind gives a row; many are kept block by block, in their order, and a second call simulates nothing."""

from __future__ import annotations

import dataclasses
import math
import pathlib

import polars as pl
import pytest

from hqp_rp.compare.claims import trials as module
from hqp_rp.compare.claims.experiments import trials
from hqp_rp.compare.claims.methods import REVERSE, method
from hqp_rp.compare.claims.trials import Trial, row, run_trials
from hqp_rp.compare.run_folder import RunFolder
from hqp_rp.scenarios._interaction import PAPER
from hqp_rp.scenarios.sawyer_wall_contact import SawyerWallContact
from tests.compare.claims.study import places


def short(trial: Trial, duration: float = 0.01) -> Trial:
    return dataclasses.replace(trial, scenario=dataclasses.replace(trial.scenario, duration=duration))


def walls(count: int) -> list[Trial]:
    place = places(1).regular[0]
    return [
        Trial("wall", SawyerWallContact(duration=0.004 + 0.004 * k, gap=1e-4), PAPER, place, k, method(REVERSE), k)
        for k in range(count)
    ]


def test_one_trial_of_each_experiment_gives_a_row_with_its_settings() -> None:
    found = {trial.experiment: trial for trial in trials(places(1))}
    assert len(found) == 22
    for name, trial in found.items():
        it = row(short(trial), short(trial).steps())
        assert it["experiment"] == name
        assert it["whole"] is True
        assert it["method"] == trial.method.label
        assert it["stiffness"] == trial.scenario.stiffness
        assert it["commanded"] > 0.0
        assert ("translation" in it) == name.startswith("push")
        assert ("late_rms" in it) != name.startswith("push")
        assert ("late_rms y" in it) == (trial.scenario.name == "sawyer_force_tracking")
        assert it["seed"] > 0


def test_gain_and_lag_come_with_a_run_that_is_long_enough() -> None:
    tracking = next(t for t in trials(places(1)) if t.experiment == "tracking sin(pi t)")
    assert "gain 0" not in row(short(tracking), short(tracking).steps())
    it = row(short(tracking, 2.5), short(tracking, 2.5).steps())
    assert it["gain 0"] == pytest.approx(1.0, abs=0.1)
    assert 0.0 < it["lag 0"] < 0.1


def test_a_run_that_ends_early_is_infinitely_far_off() -> None:
    (trial,) = walls(1)
    steps = trial.steps()
    assert math.isfinite(row(trial, steps)["late_rms"])
    assert row(trial, steps.head(1))["late_rms"] == math.inf


def test_blocks_are_kept_and_rows_come_in_order(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = walls(5)
    monkeypatch.setattr(module, "_BLOCK", 6)  # control periods: several blocks
    folder = RunFolder(tmp_path / "out", {"kind": "test"})
    first = run_trials(own, folder, workers=1, progress=False)
    assert first["posture"].to_list() == list(range(5))
    parts = sorted((tmp_path / "out" / "parts").iterdir())
    assert len(parts) > 2

    def never(trial: Trial) -> pl.DataFrame:
        raise AssertionError(trial)

    monkeypatch.setattr(Trial, "steps", never)
    assert run_trials(own, folder, workers=1, progress=False).equals(first)
    parts[0].unlink()
    with pytest.raises(AssertionError):
        run_trials(own, folder, workers=1, progress=False)


def test_the_key_knows_every_setting() -> None:
    (trial,) = walls(1)
    other = [
        dataclasses.replace(trial, seed=7),
        dataclasses.replace(trial, scenario=dataclasses.replace(trial.scenario, servo=2.0)),
        dataclasses.replace(trial, method=method("DLS", 0.3)),
        dataclasses.replace(trial, place=dataclasses.replace(trial.place, q=trial.place.q + 1e-9)),
    ]
    assert len({t.key for t in [trial, *other]}) == 5
