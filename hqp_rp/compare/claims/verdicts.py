"""The claims of the paper: what was run to test each, in how many runs it holds, and the verdict that follows."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import polars as pl

from hqp_rp.compare.claims.experiments import (
    CONFLICT,
    CONFLICT_NEAR,
    CORNER,
    HYBRID,
    MEET,
    NOISE,
    PUSH,
    RECOVERY,
    RUB,
    TRACK,
    TRACK_FAST,
    TUNING,
    WALL_NEAR,
    WIPE,
    WIPE_NEAR,
)
from hqp_rp.compare.claims.judges import laws, levels, rivals, singular, wall
from hqp_rp.compare.claims.judges.criteria import (
    ALTERNATING,
    BETTER,
    BOUNDED,
    FAILS,
    GENTLE,
    IDEAL,
    KEPT,
    ON_PATH,
    RESTS,
)
from hqp_rp.compare.claims.judges.study import Found, Study
from hqp_rp.compare.claims.outcomes import Outcome, summary
from hqp_rp.compare.report.sentences import Sentences

say = Sentences(__file__)

HOLDS, DEPENDS, UNRULED = "holds", "depends", "not ruled on"


@dataclasses.dataclass(frozen=True, slots=True)
class Verdict:
    """One claim, judged.

    Attributes:
        name: short, for pictures. claim, where: what the paper says, and where.
        word: `HOLDS`, `DEPENDS`, `FAILS` or `UNRULED`.
        number: the one figure, with its interval. why: what the verdict depends on.
        tested: a sentence, what was run, and the criterion. outcomes: in how many of the runs it is met.
        theorem: what follows from algebra, with its proof, or a counterexample, "" for neither; proven: it is the former.
    """

    name: str
    claim: str
    where: str
    word: str
    number: str
    why: str
    tested: str
    outcomes: tuple[Outcome, ...]
    theorem: str = ""
    proven: bool = False


def verdicts(rows: pl.DataFrame) -> tuple[Verdict, ...]:
    """Every claim of the abstract, sections 4 and 5 and the conclusion that a simulation can test.

    A claim whose experiments are not among the rows is not ruled on.
    """
    study = Study(rows)
    return tuple(_verdict(claim, study) for claim in _claims())


def _verdict(it: _Claim, study: Study) -> Verdict:
    missing = [experiment for experiment in it.needs if not study.has(experiment)]
    if missing:
        return Verdict(it.name, it.claim, it.where, UNRULED, "", say("unruled", missing=missing), it.tested, ())
    found = it.judge(study)
    outcomes = tuple(found.outcomes)
    why = " ".join(part for part in (found.words, summary(outcomes)) if part)
    word = found.word or _word(outcomes)
    proven = found.theorem is not None
    algebra = found.theorem.told if found.theorem else found.counterexample
    return Verdict(it.name, it.claim, it.where, word, found.number, why, it.tested, outcomes, algebra, proven)


def _word(outcomes: Sequence[Outcome]) -> str:
    """Holds everywhere; depends, where it holds somewhere or some postures decide throughout; else it does not hold."""
    states = {o.holds for o in outcomes}
    if states == {True}:
        return HOLDS
    return DEPENDS if True in states or states == {None} else FAILS


Judge = Callable[[Study], Found]


@dataclasses.dataclass(frozen=True, slots=True)
class _Claim:
    """One claim of the paper: `name` to `tested` as in `Verdict`; the experiments that it needs, and who judges."""

    name: str
    claim: str
    where: str
    tested: str
    needs: tuple[str, ...]
    judge: Judge


def _claims() -> tuple[_Claim, ...]:
    return (
        _Claim(
            "secondary never disturbs primary",
            say("undisturbed_claim"),
            "abstract; conclusion",
            say("undisturbed_tested", kept=KEPT),
            (CORNER, WIPE_NEAR, CONFLICT_NEAR),
            singular.undisturbed,
        ),
        _Claim(
            "no algorithmic singularities",
            say("singularity_free_claim"),
            "abstract; 4.3; conclusion",
            say("singularity_free_tested", bounded=BOUNDED),
            (CORNER, RECOVERY, WIPE_NEAR, WIPE, CONFLICT_NEAR, CONFLICT),
            singular.singularity_free,
        ),
        _Claim(
            "tracks the alternating force",
            say("tracks_claim"),
            "5.1, Figure 5",
            say("tracks_tested", alternating=ALTERNATING),
            (TRACK, TRACK_FAST),
            laws.tracks,
        ),
        _Claim(
            "F_x better than classical",
            say("first_wins_claim"),
            "5.1, Figures 5 and 6",
            say("first_wins_tested", better=BETTER),
            (CORNER, RECOVERY),
            rivals.first_wins,
        ),
        _Claim(
            "close approach goes well",
            say("close_approach_claim"),
            "5.2, Figure 7",
            say("close_approach_tested", gentle=GENTLE),
            (MEET,),
            wall.close_approach,
        ),
        _Claim(
            "overwhelms classical impedance",
            say("overwhelms_claim"),
            "5.2, Figures 7 and 8",
            say("overwhelms_tested", better=BETTER),
            (WALL_NEAR,),
            rivals.overwhelms,
        ),
        _Claim(
            "30 N in the end, stable",
            say("rests_claim"),
            "5.2, Figure 7",
            say("rests_tested", rests=RESTS),
            (MEET, NOISE),
            wall.rests,
        ),
        _Claim(
            "M_d and B_d adjust the response",
            say("tuning_claim"),
            "4.1, after (37)",
            say("tuning_tested", better=BETTER),
            (MEET, TUNING),
            wall.tuning,
        ),
        _Claim(
            "(47) gives the desired impedance",
            say("impedance_claim"),
            "4.2, after (47)",
            say("impedance_tested", ideal=IDEAL),
            (PUSH,),
            laws.impedance,
        ),
        _Claim(
            "any number of strict levels",
            say("in_order_claim"),
            "4.3; conclusion",
            say("in_order_tested", worse=1.0 / BETTER),
            (WIPE, CONFLICT, WIPE_NEAR, CONFLICT_NEAR),
            levels.in_order,
        ),
        _Claim(
            "primary kept in conflict",
            say("conflict_claim"),
            "introduction, goals (1)-(3); conclusion",
            say("conflict_tested", kept=KEPT),
            (CONFLICT, CONFLICT_NEAR, WIPE_NEAR, RUB),
            levels.conflict,
        ),
        _Claim(
            "hierarchy improves accuracy",
            say("improves_claim"),
            "conclusion",
            say("improves_tested", better=BETTER),
            (WIPE, CONFLICT, WIPE_NEAR, CONFLICT_NEAR),
            rivals.improves,
        ),
        _Claim(
            "hybrid control with S",
            say("hybrid_claim"),
            "4.3, (48)-(52)",
            say("hybrid_tested", kept=KEPT, on_path=ON_PATH),
            (HYBRID,),
            laws.hybrid,
        ),
    )
