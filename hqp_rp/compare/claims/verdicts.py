"""The claims of the paper: what was run to test each, in how many runs it holds, and the verdict that follows."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import polars as pl

from hqp_rp.compare.claims import judges
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
from hqp_rp.compare.claims.judges import (
    ALTERNATING,
    BETTER,
    BOUNDED,
    FAILS,
    GENTLE,
    IDEAL,
    KEPT,
    ON_PATH,
    RESTS,
    Found,
    Study,
)
from hqp_rp.compare.claims.outcomes import Outcome, summary
from hqp_rp.compare.report.words import share

HOLDS, DEPENDS, UNRULED = "holds", "depends", "not ruled on"


@dataclasses.dataclass(frozen=True, slots=True)
class Verdict:
    """One claim, judged.

    Attributes:
        name: short, for pictures. claim, where: what the paper says, and where.
        word: `HOLDS`, `DEPENDS`, `FAILS` or `UNRULED`.
        number: the one figure, with its interval. why: what the verdict depends on.
        tested: what was run, and the criterion. outcomes: in how many of the runs it is met.
        theorem: what follows from algebra, with its proof, "" for nothing.
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


def verdicts(rows: pl.DataFrame) -> tuple[Verdict, ...]:
    """Every claim of the abstract, sections 4 and 5 and the conclusion that a simulation can test.

    A claim whose experiments are not among the rows is not ruled on.
    """
    study = Study(rows)
    found = []
    for name, claim, where, tested, needs, judge in _CLAIMS:
        if not study.has(*needs):
            missing = ", ".join(e for e in needs if not study.has(e))
            why = f"Needs the full study: {missing}."
            found.append(Verdict(name, claim, where, UNRULED, "", why, tested, ()))
            continue
        it = judge(study)
        outcomes = tuple(it.outcomes)
        why = " ".join(part for part in (it.words, summary(outcomes)) if part)
        word = it.word or _word(outcomes)
        found.append(Verdict(name, claim, where, word, it.number, why, tested, outcomes, it.theorem))
    return tuple(found)


def _word(outcomes: Sequence[Outcome]) -> str:
    """Holds everywhere; depends, where it holds somewhere or some postures decide throughout; else it does not hold."""
    states = {o.holds for o in outcomes}
    if states == {True}:
        return HOLDS
    return DEPENDS if True in states or states == {None} else FAILS


Judge = Callable[[Study], Found]
_CLAIMS: tuple[tuple[str, str, str, str, tuple[str, ...], Judge], ...] = (
    (
        "secondary never disturbs primary",
        "The secondary task will not disturb the primary one.",
        "abstract; conclusion",
        f"beside singularities of the lower levels: is J_1 x = v_1, and is the force kept (late RMS error at most {KEPT:g} N)?",
        (CORNER, WIPE_NEAR, CONFLICT_NEAR),
        judges.undisturbed,
    ),
    (
        "no algorithmic singularities",
        "There are no algorithmic singularities; singularities of the secondary task deform nothing.",
        "abstract; 4.3; conclusion",
        f"largest |x| beside a singularity of the lower levels: at most {BOUNDED:g} times its median at regular postures",
        (CORNER, RECOVERY, WIPE_NEAR, WIPE, CONFLICT_NEAR, CONFLICT),
        judges.singularity_free,
    ),
    (
        "tracks the alternating force",
        "The manipulator can track the desired alternating force.",
        "5.1, Figure 5",
        "two whole periods after the start, both readings of (54): RMS error of the alternating part at most "
        f"{share(ALTERNATING)} of its RMS value; a constant force or a ramp would fail",
        (TRACK, TRACK_FAST),
        judges.tracks,
    ),
    (
        "F_x better than classical",
        "F_x is obviously better than with classical (Jacobian based) force control.",
        "5.1, Figures 5 and 6",
        "the corner of two walls beside a singularity, run by run, each damped method at the best of its sweep: RMS error of "
        f"F_x at most {BETTER:g} of the rival's",
        (CORNER, RECOVERY),
        judges.first_wins,
    ),
    (
        "close approach goes well",
        "Close approach to a stiff wall goes well.",
        "5.2, Figure 7",
        f"10 mm in front of 1e5 N/m: overshoot at most {GENTLE:g} N, two sets of gains, two servo gains",
        (MEET,),
        judges.close_approach,
    ),
    (
        "overwhelms classical impedance",
        "Reverse priority overwhelms classical impedance control.",
        "5.2, Figures 7 and 8",
        f"the wall beside a singularity, as for F_x: RMS error at most {BETTER:g} of the rival's",
        (WALL_NEAR,),
        judges.overwhelms,
    ),
    (
        "30 N in the end, stable",
        "The final contact force is 30 N, and stable.",
        "5.2, Figure 7",
        f"late RMS error at most {RESTS:g} N, for delays of the force reading, stiffer servos, and sensor noise",
        (MEET, NOISE),
        judges.rests,
    ),
    (
        "M_d and B_d adjust the response",
        "M_d and B_d adjust the response.",
        "4.1, after (37)",
        f"the wall with other B_d: overshoot at most {BETTER:g} of that with the paper's",
        (MEET, TUNING),
        judges.tuning,
    ),
    (
        "(47) gives the desired impedance",
        "(47) guarantees the desired impedance behaviour of the lower level.",
        "4.2, after (47)",
        "a push of 20 N and 2 N m in all six components, two orders of the levels, target at rest and moving: never farther "
        f"from the ideal mass, damper and spring than {share(IDEAL)} of its largest motion",
        (PUSH,),
        judges.impedance,
    ),
    (
        "any number of strict levels",
        "Any number of levels is handled with strict priority, (53).",
        "4.3; conclusion",
        "three levels: is the second level's largest error at most 1.05 times that of null-space priority (each at its best "
        "damping near singularities)?",
        (WIPE, CONFLICT, WIPE_NEAR, CONFLICT_NEAR),
        judges.in_order,
    ),
    (
        "primary kept in conflict",
        "The primary force task is guaranteed when tasks conflict.",
        "introduction, goals (1)-(3); conclusion",
        "a point that moves out of reach, an orientation that asks for more than there is, a wall with friction: late RMS "
        f"error of the force at most {KEPT:g} N",
        (CONFLICT, CONFLICT_NEAR, WIPE_NEAR, RUB),
        judges.conflict,
    ),
    (
        "hierarchy improves accuracy",
        "The task hierarchy improves the accuracy of the force controller.",
        "conclusion",
        f"three levels, with and without singularities: RMS error of F_x at most {BETTER:g} of the rival's",
        (WIPE, CONFLICT, WIPE_NEAR, CONFLICT_NEAR),
        judges.improves,
    ),
    (
        "hybrid control with S",
        "The hybrid law (48)-(52) controls force and position in one task.",
        "4.3, (48)-(52)",
        f"a tilted wall, S not diagonal, a path along it: late RMS error at most {KEPT:g} N, {1e3 * ON_PATH:g} mm off the path",
        (HYBRID,),
        judges.hybrid,
    ),
)
