"""Verdicts follow from figures: each claim's verdict changes when its figures do, and a short study rules on what it ran."""

from __future__ import annotations

from typing import Any

import polars as pl
import pytest

from hqp_rp.compare.claims import algebra
from hqp_rp.compare.claims.judges.criteria import FAILS
from hqp_rp.compare.claims.verdicts import DEPENDS, HOLDS, UNRULED, Verdict, verdicts
from hqp_rp.scenarios._interaction import DAMPED, PAPER
from tests.compare.claims.study import made_up


@pytest.fixture(scope="module")
def perfect() -> pl.DataFrame:
    return made_up()


def of(rows: pl.DataFrame, name: str) -> Verdict:
    (found,) = [v for v in verdicts(rows) if v.name == name]
    return found


def changed(rows: pl.DataFrame, where: dict[str, Any], values: dict[str, float]) -> pl.DataFrame:
    """The rows with other figures where columns have these values ("method~": begins with)."""
    chosen = pl.lit(True)
    for name, value in where.items():
        chosen &= pl.col(name[:-1]).str.starts_with(value) if name.endswith("~") else pl.col(name) == value
    assert rows.filter(chosen).height, where
    return rows.with_columns(
        pl.when(chosen).then(pl.lit(value)).otherwise(pl.col(name)).alias(name) for name, value in values.items()
    )


def test_everything_holds_where_everything_is_good_but_what_algebra_refutes(perfect: pl.DataFrame) -> None:
    found = verdicts(perfect)
    assert len(found) == 13
    assert len({v.name for v in found}) == 13
    assert {v.name: v.word for v in found if v.word != HOLDS} == {"any number of strict levels": FAILS}
    for v in found:
        assert v.outcomes
        assert v.number
        assert v.tested
        assert v.where
        assert all(o.runs >= 20 for o in v.outcomes)
    assert sum(v.proven for v in found) == 4
    assert all(v.theorem.startswith("Theorem: ") for v in found if v.proven)
    assert "Counterexample" in of(perfect, "any number of strict levels").theorem


CASES = [
    (
        "secondary never disturbs primary",
        {"experiment": "corner, near", "method": "reverse priority"},
        {"late_rms": 5.0},
        DEPENDS,
    ),
    ("no algorithmic singularities", {"experiment": "wipe, near", "method~": "reverse"}, {"commanded": 900.0}, DEPENDS),
    ("tracks the alternating force", {"experiment": "tracking"}, {"gain 0": 0.5}, DEPENDS),
    ("tracks the alternating force", {"experiment~": "tracking"}, {"lag 0": 5.0}, FAILS),
    ("F_x better than classical", {"experiment": "corner, near", "method": "pseudo-inverse"}, {"rms": 2.0}, DEPENDS),
    ("F_x better than classical", {"experiment": "corner, near"}, {"rms": 2.0}, FAILS),
    ("close approach goes well", {"experiment": "wall", "gains": PAPER}, {"overshoot": 59.0}, DEPENDS),
    ("close approach goes well", {"experiment": "wall"}, {"overshoot": 59.0}, FAILS),
    ("overwhelms classical impedance", {"experiment": "wall, near", "method~": "DLS"}, {"rms": 1.0}, DEPENDS),
    ("30 N in the end, stable", {"experiment": "wall", "delay": 0.01}, {"late_rms": 9.0}, DEPENDS),
    ("M_d and B_d adjust the response", {"experiment": "B_d", "damping_ratio": 2.0}, {"overshoot": 3.0}, DEPENDS),
    ("(47) gives the desired impedance", {"experiment": "push", "servo": 1.0}, {"rotation": 3.4}, DEPENDS),
    ("(47) gives the desired impedance", {"experiment~": "push"}, {"rotation": 3.4, "translation": 1.0}, FAILS),
    ("(47) gives the desired impedance", {"experiment": "push, torque loop"}, {"rotation": 3.4}, DEPENDS),
    (
        "primary kept in conflict",
        {"experiment": "wipe, near", "method": "reverse priority"},
        {"late_rms": 20.0},
        DEPENDS,
    ),
    ("hierarchy improves accuracy", {"experiment": "conflict", "method": "weighted"}, {"rms": 1.0}, DEPENDS),
    ("hybrid control with S", {"experiment": "tilted wipe", "friction": 0.3}, {"position": 0.024}, DEPENDS),
]


@pytest.mark.parametrize(("name", "where", "values", "word"), CASES)
def test_a_verdict_changes_with_its_figures(
    perfect: pl.DataFrame, name: str, where: dict[str, Any], values: dict[str, float], word: str
) -> None:
    before, after = of(perfect, name), of(changed(perfect, where, values), name)
    assert before.word == HOLDS
    assert after.word == word
    assert "Does not hold:" in after.why


def test_a_claim_that_holds_nowhere_does_not_hold(perfect: pl.DataFrame) -> None:
    """Some postures decide under one condition, none of the runs meets the others."""
    near = pl.col("experiment") == "corner, near"
    some = near & (pl.col("method") == "DLS") & (pl.col("posture") < 12)
    found = of(
        perfect.with_columns(pl.when(near & ~some).then(2.0).otherwise(pl.col("rms")).alias("rms")),
        "F_x better than classical",
    )
    assert {o.holds for o in found.outcomes} == {None, False}
    assert found.word == FAILS


def test_some_postures_decide_and_the_share_says_so(perfect: pl.DataFrame) -> None:
    some = pl.when((pl.col("experiment") == "wall") & (pl.col("posture") < 5)).then(9.0).otherwise(pl.col("overshoot"))
    found = of(perfect.with_columns(some.alias("overshoot")), "close approach goes well")
    assert found.word == DEPENDS
    assert {o.passed for o in found.outcomes} == {0.75}
    assert "In some postures:" in found.why


def test_a_theorem_that_fails_its_check_decides(perfect: pl.DataFrame, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(algebra, "first_level_kept", lambda: algebra.Theorem("s", "p.", 1.0))
    assert of(perfect, "secondary never disturbs primary").word == FAILS


def test_damped_rivals_are_taken_at_their_best(perfect: pl.DataFrame) -> None:
    """One damping of DLS that is as good as reverse priority is enough to undo the claim against DLS."""
    where = {"experiment": "corner, near", "method": "DLS", "damping": 0.03, "gains": DAMPED}
    found = of(changed(perfect, where, {"rms": 2.0}), "F_x better than classical")
    states = {o.label: o.holds for o in found.outcomes}
    assert states["corner, than DLS"] is False
    assert states["corner, than DLS variable"] is True
    assert "DLS (damping 0.03)" in found.why


def test_the_short_study_rules_on_what_it_ran() -> None:
    found = {v.name: v for v in verdicts(made_up(quick=True))}
    unruled = {name for name, v in found.items() if v.word == UNRULED}
    assert unruled == {
        "no algorithmic singularities",
        "tracks the alternating force",
        "F_x better than classical",
        "overwhelms classical impedance",
        "30 N in the end, stable",
        "M_d and B_d adjust the response",
        "any number of strict levels",
        "primary kept in conflict",
        "hierarchy improves accuracy",
    }
    assert found["tracks the alternating force"].why == "Needs the full study: tracking."
    assert found["close approach goes well"].word == HOLDS
