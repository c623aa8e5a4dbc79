"""Sentences follow the data: cases made by hand, whose answer is known."""

from __future__ import annotations

import dataclasses

import pytest

from hqp_rp import ConstantDamping, get_solver
from hqp_rp.compare.comparison.findings import DAMPED as DAMPED_CLAIM
from hqp_rp.compare.comparison.findings import FREE, SAME, UNDISTURBED, answer, case_sentences, claims, claims_summary
from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.measure.cases import Case, Outcome
from hqp_rp.compare.report.words import number, share
from hqp_rp.core.variant import DAMPED, EXACT
from hqp_rp.core.words import listing
from tests.compare.small import Closing, Moving

GOOD = Outcome(
    contestant=Contestant("null space", get_solver("null_space"), EXACT),
    steps=10,
    solved=1.0,
    refused="",
    parts_at=None,
    parted=False,
    within=1.0,
    distance=1e-14,
    distance_max=1e-12,
    clear_distance=1e-12,
    clear_distance_moved=(1e-12, 1e-12),
    excess=(1e-15, 1e-15),
    relative_excess=(1e-16, 1e-16),
    proven=(0.0, 0.0),
    x_max=1e9,
    variation=1.0,
    false_claims=0,
    time_p50=1e-6,
    time_p99=2e-6,
)
REVERSE = dataclasses.replace(GOOD, contestant=Contestant("reverse priority", get_solver("reverse_priority"), EXACT))
GENTLE = dataclasses.replace(
    GOOD,
    contestant=Contestant("gentle", get_solver("reverse_priority", damping=ConstantDamping(0.1)), DAMPED),
    x_max=3.0,
    distance=0.5,
    clear_distance=0.9,
    clear_distance_moved=(0.9, 0.9),
    parts_at=0.1,
    parted=True,
    within=0.25,
    excess=(1e-15, 0.5),
)
CARELESS = dataclasses.replace(
    GENTLE,
    contestant=Contestant("careless", get_solver("pseudo_inverse"), DAMPED),
    excess=(0.125, 0.0),
    proven=(0.0625, 0.0),
    parts_at=1.0,
)


def case(*outcomes: Outcome, name: str = "two levels", scenario: Closing | None = None) -> Case:
    return Case(
        scenario=scenario or Closing(),
        name=name,
        levels=("first", "second"),
        outcomes=outcomes,
        far_norm=2.0,
        far_norm_moved=(2.0, 2.0),
        nearest=1e-9,
        reference=("exact rational arithmetic",),
        ambiguous=0.0,
    )


def test_the_answer_names_who_is_accurate_and_who_is_bounded() -> None:
    sentences = answer([case(GOOD, GENTLE, CARELESS)])
    assert sentences[0].startswith("Accuracy: null space stays within 1e-06 ")
    assert sentences[1].startswith("Through the singularity: gentle keeps level 1")
    assert "careless (0.12)" in sentences[2]
    assert sentences[-1].startswith("Statuses were honest")


def test_one_bad_case_is_enough() -> None:
    bad = dataclasses.replace(GOOD, clear_distance=0.1)
    assert answer([case(GOOD), case(bad)])[0].startswith("Accuracy: no solver stayed within")
    wild = dataclasses.replace(GENTLE, x_max=1e3)
    assert answer([case(GENTLE), case(wild)])[1].startswith("No solver kept level 1 and |x|")


def test_false_claims_are_counted() -> None:
    false = dataclasses.replace(GOOD, false_claims=2)
    assert answer([case(false), case(false)])[-1].endswith("null space on 4 steps.")


def test_claims_hold_or_not() -> None:
    stays = dataclasses.replace(REVERSE, x_max=4.0)
    away = dataclasses.replace(REVERSE, clear_distance=0.5, proven=(1e-3, 0.0))
    found = claims([case(GOOD, stays, GENTLE), case(GOOD, away, name="three levels")])
    held = {(verdict.claim, verdict.case): verdict.holds for verdict in found}
    assert held == {
        (SAME, "closing, two levels"): "yes",
        (SAME, "closing, three levels"): "no",
        (UNDISTURBED, "closing, two levels"): "yes",
        (UNDISTURBED, "closing, three levels"): "no",
        (FREE, "closing, two levels"): "yes",
        (FREE, "closing, three levels"): "no",
        (DAMPED_CLAIM, "closing, two levels"): "yes",
    }
    summary = claims_summary(found)
    assert "holds in 1 of 2 cases (closing, two levels)" in summary
    assert "null space: 5e+08 times" in next(v.evidence for v in found if v.claim == FREE)


def test_without_reverse_priority_there_are_no_claims() -> None:
    assert claims([case(GOOD)]) == ()
    assert claims_summary(()) == ""


def test_a_family_says_at_which_distance_solvers_leave() -> None:
    late = dataclasses.replace(GENTLE, parts_at=1e-5)
    words = " ".join(case_sentences(case(GOOD, late, GENTLE, CARELESS)))
    assert "Never more than 1e-06 from the optimum: null space." in words
    assert "to distances of 1e-05 to 1e-04: gentle." in words
    assert "They leave it before: gentle (0.1)." in words
    assert "Away from it from 1 on: careless." in words
    assert "|x| grew beyond 10 times what is needed far from the singularity (2) with null space (1e+09)." in words


def test_a_path_says_how_much_of_it_was_at_the_optimum() -> None:
    words = " ".join(case_sentences(case(GOOD, GENTLE, scenario=Moving())))
    assert "Share of the steps within 1e-06 of the optimum: gentle (25.0 %)." in words
    assert "Every solver kept level 1 to rounding error at every step." in words


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "-"), (float("nan"), "-"), (float("inf"), "inf"), (0.0, "0"), (0.12345, "0.12"), (1234.0, "1200"),
     (123456.0, "1.2e+05"), (1e-6, "1e-06"), (-0.5, "-0.5"), (99.96, "100")],
)  # fmt: skip
def test_numbers(value: float | None, text: str) -> None:
    assert number(value) == text


def test_shares_never_round_to_all_or_nothing() -> None:
    assert [share(v) for v in (0.0, 1e-6, 0.5, 0.99999, 1.0, None)] == [
        "0 %",
        "0.1 %",
        "50.0 %",
        "99.9 %",
        "100 %",
        "-",
    ]


def test_listings() -> None:
    assert [listing(names) for names in ([], ["a"], ["a", "b"], ["a", "b", "c"])] == ["", "a", "a and b", "a, b and c"]
