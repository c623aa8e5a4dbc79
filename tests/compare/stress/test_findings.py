"""Sentences of a stress test follow its counts: a summary filled by hand, whose findings are known."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hqp_rp import ConstantDamping, Level, Problem, get_solver
from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.stress.findings import answer, case_sentences, claims
from hqp_rp.compare.stress.infeasible import Contradiction, Infeasibility
from hqp_rp.compare.stress.opening import opening_of_stress
from hqp_rp.compare.stress.plan import KINDS, RANDOM
from hqp_rp.compare.stress.summary import Summary, sigma_of_bins, value_bins
from hqp_rp.core.conflict import conflict_of
from hqp_rp.core.diagnostics import Singularity
from hqp_rp.core.variant import DAMPED, EXACT

CONTESTANTS = (
    Contestant("null space", get_solver("null_space"), EXACT),
    Contestant("reverse", get_solver("reverse_priority"), EXACT),
    Contestant("gentle", get_solver("reverse_priority", damping=ConstantDamping(0.1)), DAMPED),
)
LEVELS = ("tool", "elbow")
NEAR_AND_FAR = sigma_of_bins()[[0, 1, 8, 20]]


def empty_test(places: int = 3) -> Any:
    place = SimpleNamespace(level=1, kind=Singularity.ALGORITHMIC, name="elbow")
    plan: Any = SimpleNamespace(contestants=CONTESTANTS, places=(place,) * places, paths=2 * bool(places), order=(0, 0))
    catalogue = (place,) * (places + 1) if places else ()
    return SimpleNamespace(
        plan=plan, summary=Summary(plan, LEVELS), catalogue=catalogue, infeasible=None, held_at_rest=""
    )


def count(test: Any, label: str, quantity: str, *values: float, sigma: np.ndarray[Any, Any] = NEAR_AND_FAR) -> None:
    """Count these values, one at each sigma."""
    summary = test.summary
    own = summary.along[0][summary.quantities.index(quantity), summary.labels.index(label)]
    bins = [int(np.argmin(abs(np.log(sigma_of_bins() / value)))) for value in sigma]
    for at, value in zip(bins, value_bins(np.array(values)), strict=True):
        own[at, value] += 1


@pytest.fixture
def test() -> Any:
    made = empty_test()
    count(made, "null space", "error_1", 0.0, 0.0, 0.0, 0.0)
    count(made, "reverse", "error_1", 0.0, 0.0, 0.0, 1e-3)
    count(made, "gentle", "error_1", 0.0, 0.0, 0.0, 0.0)
    for label in ("null space", "reverse"):
        count(made, label, "error_2", 0.0, 0.0, 0.0, 0.0)
    count(made, "gentle", "error_2", 0.5, 0.5, 0.5, 0.5)
    count(made, "null space", "distance", 0.0, 0.0, 0.0, 0.0)
    count(made, "reverse", "distance", 0.0, 0.0, 0.0, 1.0)
    count(made, "gentle", "distance", 1.0, 1.0, 1.0, 1.0)
    count(made, "null space", "x_norm", 1.0, 1.0, 100.0, 1e6)
    count(made, "reverse", "x_norm", 1.0, 1.0, 1.0, 1.0)
    count(made, "gentle", "x_norm", 1.0, 1.0, 1.0, 1.0)
    made.summary.optimum[0, :2, value_bins(np.array([1.0]))] = 1
    made.summary.judged[KINDS.index(RANDOM)] = 4
    made.summary.right[:, KINDS.index(RANDOM)] = (4, 3, 0)
    made.summary.steps[0] = 1
    made.summary.references["exact"] = 8
    made.summary.ambiguous[0] = 1
    return made


def test_the_answer_says_who_is_right_where(test: Any) -> None:
    atlas, anywhere, approach, both, jumps, paper, honesty = answer(test)
    assert atlas == (
        "The search found 4 singular configurations; 2 paths lead to 2 of elbow, algorithmic. 1 more cannot be approached "
        "within the joint limits."
    )
    assert anywhere == (
        "At random and near the joint limits, null space is within 1e-06 of the optimum in all of 4 judged samples; reverse "
        "75.0 %."
    )
    assert approach == (
        "Towards singularities of elbow, algorithmic (medians): null space never leaves the optimum by more than 1e-06; "
        "reverse leaves it at sigma = 1e-06; gentle is away from it on the whole path."
    )
    assert both == (
        "gentle keeps both level 1 to a relative 1e-09 and |x| within 10 times what is needed far from the singularity, on "
        "every path."
    )
    assert jumps == "No jump on any path: null space, reverse and gentle."
    assert paper.startswith(
        "Of what the paper claims for reverse priority, 'undamped, it gives the answer of task priority "
    )
    assert "'lower levels do not disturb level 1' holds in no case and 'it has no algorithmic singularity" in paper
    assert honesty == "Judged by: 8 exact; in 1 samples the rank is a matter of opinion: they do not count."


def test_jumps_say_how_often_and_between_which_sigma(test: Any) -> None:
    test.summary.jumps[0, 0, [2, 6]] = (1, 3)
    test.summary.jumps[0, 1, 6] = 1
    sigma = sigma_of_bins()
    assert sigma[6] == pytest.approx(10.0**-2.5)
    assert (
        "Jumps: null space 4 times, at sigma from 0.032 to 3.2e-03; reverse 1 time, at sigma = 3.2e-03. No jump on any path: "
        "gentle."
    ) in answer(test)
    test.summary.jumps[0, 2, 6] = 1
    assert (
        "Jumps: null space 4 times, at sigma from 0.032 to 3.2e-03; reverse 1 time, at sigma = 3.2e-03; gentle 1 time, "
        in (" ".join(answer(test)))
    )
    assert "No jump" not in " ".join(answer(test))
    test.summary.steps[0] = test.summary.jumps[0] = 0  # no answers on the paths: nothing is known of jumps
    assert "ump" not in " ".join(answer(test))


UP_AND_DOWN = Level(np.array([[1.0], [1.0]]), [-np.inf, 1.0], [0.0, np.inf], name="limits")
CORRIDOR = conflict_of(Problem([Level.equality([[1.0]], [0.0])], hard=UP_AND_DOWN), None)
assert CORRIDOR is not None
SEE = f"{CORRIDOR} See it again: hqp-rp check worst/infeasible-1.npz, in the report's folder."


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (
            (Contradiction(("corridor", "joints"), 4, 17, CORRIDOR),),
            f": corridor against joints. In sample 17: {SEE}",
        ),
        (
            (Contradiction(("corridor",), 2, 3, CORRIDOR), Contradiction(("a", "b"), 1, 5, CORRIDOR)),
            ": corridor by itself (in 2 of 4 looked at); a against b (in 1 of 4 looked at). In sample 3: "
            f"{SEE} In 1 of 4 looked at no contradiction is proven.",
        ),
        (
            (),
            ", as a solver says; in 4 of them looked at no contradiction of the hard rows is proven.",
        ),
    ],
)
def test_infeasible_samples_are_said_first(test: Any, found: tuple[Contradiction, ...], words: str) -> None:
    test.summary.samples = 8
    test.infeasible = Infeasibility(6, 4, found)
    assert answer(test)[0] == f"75.0 % of the samples are infeasible (6 of 8){words}"
    assert opening_of_stress(test, ()).numbers[0][0] == "75.0 %"


def test_the_sentences_of_a_case(test: Any) -> None:
    tool, elbow, size = case_sentences(test.summary, 0)
    assert tool == "tool is kept to a relative 1e-09 on every path by null space and gentle."
    assert elbow == "elbow is kept to a relative 1e-09 on every path by null space and reverse."
    assert size.startswith(
        "|x| grows beyond 10 times what is needed far from the singularity (1.2) with null space (1e+06 "
    )
    test.summary.along[0][0] = 0
    assert case_sentences(test.summary, 0)[0] == "tool: no sample on these paths could be judged."


def test_where_no_sample_lies_far_off_sizes_are_compared_with_nothing(test: Any) -> None:
    test.summary.optimum[:] = 0
    assert case_sentences(test.summary, 0)[-1] == "No sample lies at sigma >= 0.03: |x| is compared with nothing."
    sentence = answer(test)[3]
    assert sentence.startswith(
        "null space and gentle keep level 1 to a relative 1e-09, on every path. There |x| is compared with nothing, since no "
        "sample lies at sigma >= 0.03; the largest: null space 1.2e+06 and gentle 1.2."
    )
    found = {verdict.claim: (verdict.holds, verdict.evidence) for verdict in claims(test)}
    assert found["singularity-free"] == ("-", "not known: no sample lies at sigma >= 0.03")
    assert found["damped"] == ("-", "not known: no sample lies at sigma >= 0.03")
    assert "without damping' could not be judged" in " ".join(answer(test))


def test_without_an_atlas_every_sample_is_drawn_at_random() -> None:
    found = answer(empty_test(places=0))
    assert (
        found[0]
        == "The search found no singular configuration within the joint limits; every sample is drawn at random."
    )
    assert len(found) == 2  # nothing was judged, and there are no paths


def test_the_first_screen(test: Any) -> None:
    found = opening_of_stress(test, ())
    assert dict(found.advice) == {
        "Anywhere but near singularities (within 1e-06 in all 4 samples)": "null space",
        "A path through a singularity, level 1 to 1e-09 and |x| within 10 times": "gentle",
        "Avoid, where level 1 matters": "reverse (1.2e-03)",
    }
    assert [words for _, words in found.numbers] == [
        "solvers were right in all of these",
        "|x| of null space over what is needed far from the singularity",
        "the largest relative error of level 1, by reverse",
    ]
