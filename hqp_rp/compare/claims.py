"""The claims of the paper, each with what was run to test it, the measured figures, and a verdict that follows from them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

from hqp_rp.compare.contact_runs import ContactFigures
from hqp_rp.compare.report import listing, number, share
from hqp_rp.scenarios._interaction import DAMPED, PAPER, REGULAR, SINGULAR

TRACKING, WALL, WIPE, CONFLICT = (
    "sawyer_force_tracking",
    "sawyer_wall_contact",
    "sawyer_hybrid_wipe",
    "sawyer_priority_conflict",
)
REVERSE, REVERSE_DAMPED, CLASSICAL, LEAST_SQUARES = (
    "reverse priority",
    "reverse T_k constant",
    "pseudo-inverse",
    "DLS constant",
)
NULL_SPACE, WEIGHTED, CASCADE = "null space", "weighted", "QP ProxQP"
LINE_UP = (
    NULL_SPACE,
    REVERSE,
    "null space variable",
    REVERSE_DAMPED,
    "reverse all damped",
    "singularity robust",
    CLASSICAL,
    LEAST_SQUARES,
    WEIGHTED,
    CASCADE,
)
"""Labels of the contestants: reverse priority as the paper has it and damped, and the classical counterparts."""

HOLDS, FAILS, UNRULED = "holds", "does not hold", "not ruled on: a quick run is too short"
EXACT = 1e-9
"""m/s: |J_1 x - v_1| up to this is rounding; the first level asks for up to 0.2 m/s."""
TRACKED = 0.05 * 30.0
"""N: the force is tracked when its late RMS error is at most 5 % of 30 N."""
BETTER = 0.05
"""One figure is better than another when it is smaller by more than this share, of the other, and by more than 0.01 N."""
LEAST = 0.01


class Study:
    """The figures of all runs, by scenario, gains, place, contestant and wall."""

    def __init__(self, figures: Sequence[ContactFigures]) -> None:
        self.figures = tuple(figures)
        self._by = {(f.scenario, f.case, f.contestant, f.axis): f for f in figures}

    def get(self, scenario: str, gains: str, place: str, contestant: str, axis: str = "x") -> ContactFigures:
        """The figures of one run."""
        return self._by[scenario, f"{gains}, {place}", contestant, axis]

    def beside(self, f: ContactFigures, contestant: str) -> ContactFigures:
        """The figures of another contestant in the same case."""
        return self._by[f.scenario, f.case, contestant, f.axis]

    def of(self, contestant: str, *scenarios: str, place: str = "", gains: str = "") -> list[ContactFigures]:
        """The figures of every run of a contestant against the wall across x, in these scenarios, places and gains."""
        return [
            f
            for f in self.figures
            if f.contestant == contestant
            and f.axis == "x"
            and (not scenarios or f.scenario in scenarios)
            and f.case.endswith(place)
            and f.case.startswith(gains)
        ]


@dataclasses.dataclass(frozen=True, slots=True)
class Ruling:
    """One claim, judged. All are words: claim, where the paper makes it, what was run, what was measured, the verdict."""

    claim: str
    where: str
    tested: str
    measured: str
    verdict: str


def rulings(study: Study, *, quick: bool = False) -> tuple[Ruling, ...]:
    """Every claim of the abstract, sections 4 and 5 and the conclusion that a simulation can test.

    A `quick` run is too short to settle: what it measured is told, and nothing is ruled on.
    """
    found = tuple(Ruling(claim, where, tested, *judge(study)) for claim, where, tested, judge in _CLAIMS)
    return tuple(dataclasses.replace(ruling, verdict=UNRULED) for ruling in found) if quick else found


Judge = Callable[[Study], tuple[str, str]]


def _better(a: float | None, b: float | None) -> bool:
    return a is not None and b is not None and a < (1.0 - BETTER) * b and b - a > LEAST


def _words(scenario: str) -> str:
    return scenario.removeprefix("sawyer_").replace("_", " ")


def _name(f: ContactFigures) -> str:
    return f"{_words(f.scenario)} ({f.case})"


def _undisturbed(study: Study) -> tuple[str, str]:
    runs = study.of(REVERSE)
    miss = max(f.first_level for f in runs)
    bad = [f for f in runs if f.late_rms > TRACKED]
    measured = f"largest |J_1 x - v_1| over {len(runs)} cases: {number(miss)} m/s"
    if bad:
        worst = max(bad, key=lambda f: f.late_rms)
        measured += (
            f"; but the force itself was lost in {len(bad)} of them, at worst {_name(worst)}, late RMS error "
            f"{number(worst.late_rms)} N, where x reached {number(worst.commanded)} rad/s and the velocity limits shortened it "
            f"in {share(worst.shortened)} of the periods, the first level with it"
        )
    damped = sum(f.late_rms > TRACKED for f in study.of(REVERSE_DAMPED))
    measured += f". With damping in the pseudo-inverse that gives T_k it was lost in {damped}"
    if miss > EXACT:
        return measured, FAILS
    return measured, HOLDS if not bad else (
        "holds only when the answer fits into the robot's velocity limits: in x always, in the measured force not"
    )


def _singularity_free(study: Study) -> tuple[str, str]:
    two, three = study.of(REVERSE, TRACKING, WALL), study.of(REVERSE, WIPE, CONFLICT)
    parts, unbounded = [], 0
    for runs, words in ((two, "two levels"), (three, "three levels")):
        for scenario in dict.fromkeys(f.scenario for f in runs):
            near, far = (
                max(f.commanded for f in runs if f.scenario == scenario and f.case.endswith(place))
                for place in (SINGULAR, REGULAR)
            )
            unbounded += near > 10.0 * far
            parts.append(f"{_words(scenario)} ({words}): {number(near)} against {number(far)} rad/s")
    damped = max(f.commanded for f in study.of(REVERSE_DAMPED, place=SINGULAR))
    same = max(abs(f.commanded - study.beside(f, NULL_SPACE).commanded) / f.commanded for f in two)
    measured = (
        "largest |x| near the singularity against elsewhere: "
        + "; ".join(parts)
        + f". With two levels it is null-space "
        f"priority's, within {share(same)}. With damping in the pseudo-inverse that gives T_k: at most {number(damped)} rad/s"
    )
    if not unbounded:
        return measured, HOLDS
    return measured, (
        "does not hold as printed; holds only when T_k is damped, or when the last level alone determines the motion"
        if damped < 5.0
        else FAILS
    )


def _tracks(study: Study) -> tuple[str, str]:
    runs = {
        (gains, axis): study.get(TRACKING, gains, REGULAR, REVERSE, axis) for gains in (PAPER, DAMPED) for axis in "xy"
    }
    measured = "; ".join(
        f"{gains}, F_{axis}: late RMS error {number(f.late_rms)} N, settled after {number(f.settling)} s"
        for (gains, axis), f in runs.items()
    )
    return measured, HOLDS if all(f.late_rms <= TRACKED for f in runs.values()) else FAILS


def _against(
    study: Study, scenarios: Sequence[str], places: Sequence[str], rivals: Sequence[str], *, late: bool = True
) -> tuple[str, str]:
    """Whether reverse priority's force error is smaller than each rival's: the late one, or the one from first contact on."""

    def error(f: ContactFigures) -> float:
        return f.late_rms if late or f.rms is None else f.rms

    sentences: list[str] = []
    wins: list[str] = []
    ties: list[str] = []
    for rival in rivals:
        cases = [
            (study.get(s, gains, place, REVERSE), study.get(s, gains, place, rival))
            for s in scenarios
            for gains in (PAPER, DAMPED)
            for place in places
        ]
        better = sum(_better(error(a), error(b)) for a, b in cases)
        worse = sum(_better(error(b), error(a)) for a, b in cases)
        a, b = max(cases, key=lambda pair: abs(error(pair[0]) - error(pair[1])))
        sentences.append(
            f"against {rival}: better in {better} of {len(cases)} cases, worse in {worse}; largest difference "
            f"{_name(a)}: {'late ' if late else ''}RMS error of F_x {number(error(a))} against {number(error(b))} N, "
            f"peak {number(a.peak, 3)} against {number(b.peak, 3)} N"
        )
        (wins if better and not worse else ties).append(rival)
    measured = "; ".join(sentences)
    if not wins:
        return measured, FAILS
    return measured, HOLDS if not ties else (
        f"holds only when compared with {listing(wins)}; not against {listing(ties)}"
    )


def _first_wins(study: Study) -> tuple[str, str]:
    return _against(study, (TRACKING,), (REGULAR,), (CLASSICAL, LEAST_SQUARES))


def _overwhelms(study: Study) -> tuple[str, str]:
    return _against(study, (WALL,), (REGULAR, SINGULAR), (CLASSICAL, LEAST_SQUARES))


def _improves(study: Study) -> tuple[str, str]:
    rivals = (CLASSICAL, LEAST_SQUARES, WEIGHTED, NULL_SPACE, CASCADE)
    return _against(study, (WIPE, CONFLICT), (REGULAR, SINGULAR), rivals, late=False)


def _rests(study: Study) -> tuple[str, str]:
    runs = study.of(REVERSE, WALL)
    measured = "; ".join(f"{f.case}: {number(30.0 + f.final, 4)} N at the end" for f in runs)
    return measured, HOLDS if all(abs(f.final) < 0.3 for f in runs) else FAILS


def _close_approach(study: Study) -> tuple[str, str]:
    paper, damped = (study.get(WALL, gains, REGULAR, REVERSE) for gains in (PAPER, DAMPED))
    measured = "; ".join(
        f"{f.case}: peak {number(f.peak, 3)} N, in contact {share(f.contact)} of the time after first touch, settled after "
        f"{number(f.settling)} s, energy into the wall {number(f.energy)} J"
        for f in (paper, damped)
    )
    gentle = [f.overshoot <= TRACKED for f in (paper, damped)]
    if all(gentle):
        return measured, HOLDS
    return measured, "holds only when B_d is chosen for the wall's stiffness" if gentle[1] else FAILS


def _tuning(study: Study) -> tuple[str, str]:
    paper, damped = (study.get(WALL, gains, REGULAR, REVERSE) for gains in (PAPER, DAMPED))
    measured = (
        f"B_d 150 and 2449 N s/m at M_d = 15 kg on 1e5 N/m: overshoot {number(paper.overshoot)} and "
        f"{number(damped.overshoot)} N, settling {number(paper.settling)} and {number(damped.settling)} s"
    )
    return measured, HOLDS if _better(damped.overshoot, paper.overshoot) else FAILS


def _impedance(study: Study) -> tuple[str, str]:
    runs = study.of(REVERSE, WALL)
    measured = "; ".join(
        f"{f.case}: at most {number(None if f.position is None else 1e3 * f.position)} mm and {number(f.orientation)} rad "
        "off the pose that was to be held"
        for f in runs
    )
    return measured, HOLDS if all((f.position or 0.0) < 5e-3 for f in runs) else FAILS


def _in_order(study: Study) -> tuple[str, str]:
    """Three levels: the second level against null-space priority's, where that one's answer was not shortened."""
    pairs = [(f, study.beside(f, "null space variable")) for f in study.of(REVERSE, WIPE, CONFLICT)]
    fair = [(a, b) for a, b in pairs if b.late_rms <= TRACKED and a.late_rms <= TRACKED]
    worse = [(a, b) for a, b in fair if (a.position or 0.0) > (1.0 + BETTER) * (b.position or 0.0) + 1e-4]
    measured = "; ".join(
        f"{_name(a)}: second level's largest error {number(1e3 * (a.position or 0.0))} mm, null space variable's "
        f"{number(1e3 * (b.position or 0.0))} mm"
        for a, b in fair
    )
    if not fair:
        return "no case in which both kept the force", FAILS
    return measured, HOLDS if not worse else (
        "holds only when there are two levels or the lower ones agree: of three, the third disturbs the second"
        if len(worse) < len(fair)
        else "holds only when there are two levels: of three, the third disturbs the second"
    )


def _conflict(study: Study) -> tuple[str, str]:
    labels = (REVERSE, REVERSE_DAMPED, NULL_SPACE, CASCADE, WEIGHTED, CLASSICAL, LEAST_SQUARES)
    words = []
    for scenario in (CONFLICT, WIPE):
        worst = {label: max(study.of(label, scenario), key=lambda f: f.rms or 0.0) for label in labels}
        words.append(
            f"{_words(scenario)}, worst of four cases, RMS error of F_x: "
            + ", ".join(f"{label} {number(f.rms)} N" for label, f in worst.items())
        )
    kept = {
        label: [f.late_rms <= TRACKED for f in study.of(label, CONFLICT, WIPE)] for label in (REVERSE, REVERSE_DAMPED)
    }
    measured = (
        "; ".join(words)
        + "; in the end the force is right in "
        + ", ".join(f"{sum(found)} of {len(found)} cases ({label})" for label, found in kept.items())
    )
    if all(kept[REVERSE]):
        return measured, HOLDS
    if all(kept[REVERSE_DAMPED]):
        return (
            measured,
            "holds only when T_k is damped, or when the last level alone determines the motion, as a posture does",
        )
    return measured, FAILS


_CLAIMS: tuple[tuple[str, str, str, Judge], ...] = (
    (
        "The secondary task will not disturb the primary one.",
        "abstract; conclusion",
        "reverse priority as printed, (29), in all sixteen cases: is J_1 x = v_1, and is the force kept?",
        _undisturbed,
    ),
    (
        "There are no algorithmic singularities; singularities of the secondary task deform nothing.",
        "abstract; 4.3; conclusion",
        "largest joint velocity asked for, near a singularity of the lower levels against elsewhere",
        _singularity_free,
    ),
    (
        "The manipulator can track the desired alternating force.",
        "5.1, Figure 5",
        "5.1 at the regular posture, both sets of gains; tracked: late RMS error at most 5 % of 30 N",
        _tracks,
    ),
    (
        "F_x is obviously better than with classical (Jacobian based) force control.",
        "5.1, Figures 5 and 6",
        "5.1 at the regular posture, the same references, only the solver changed",
        _first_wins,
    ),
    (
        "Close approach to a stiff wall goes well.",
        "5.2, Figure 7",
        "5.2 at the regular posture, 10 mm in front of 1e5 N/m; well: overshoot at most 5 % of 30 N",
        _close_approach,
    ),
    (
        "Reverse priority overwhelms classical impedance control.",
        "5.2, Figures 7 and 8",
        "5.2 at both starts, the same references, only the solver changed",
        _overwhelms,
    ),
    (
        "The final contact force is 30 N, and stable.",
        "5.2, Figure 7",
        "5.2, all four cases: force at the end within 1 % of 30 N",
        _rests,
    ),
    (
        "M_d and B_d adjust the response.",
        "4.1, after (37)",
        "5.2 with the paper's B_d and with the one for damping ratio 1 against the wall",
        _tuning,
    ),
    (
        "(47) guarantees the desired impedance behaviour of the lower level.",
        "4.2, after (47)",
        "5.2, all four cases: the pose that the second level holds while x meets the wall, within 5 mm",
        _impedance,
    ),
    (
        "Any number of levels is handled with strict priority, (53).",
        "4.3; conclusion",
        "three levels in the wipe and the conflict, where both kept the force: is the second level as good as null-space "
        "priority's (damped near singularities)?",
        _in_order,
    ),
    (
        "The primary force task is guaranteed when tasks conflict.",
        "introduction, goals (1)-(3); conclusion",
        "force first and a point that moves out of reach second, posture third; and the wipe, whose orientation asks for more "
        "than there is",
        _conflict,
    ),
    (
        "The task hierarchy improves the accuracy of the force controller.",
        "conclusion",
        "three levels in the wipe and the conflict, both starts, against methods without and with strict priority",
        _improves,
    ),
)
