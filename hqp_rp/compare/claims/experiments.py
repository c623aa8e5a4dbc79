"""What is run: every experiment as a list of trials, for the full study and for the short one."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any

from hqp_rp.compare.claims.methods import (
    CASCADE,
    CLASSICAL,
    DLS,
    NULL_DAMPED,
    NULL_SPACE,
    REVERSE,
    REVERSE_DAMPED,
    WEIGHTED,
    WITHIN_LIMITS,
    line_up,
    method,
)
from hqp_rp.compare.claims.places import regular_places, singular_places
from hqp_rp.compare.claims.trials import Trial
from hqp_rp.scenarios._interaction import DAMPED, LOWER_AXES, PAPER, Interaction, Place
from hqp_rp.scenarios.sawyer_force_tracking import AS_PRINTED, SawyerForceTracking
from hqp_rp.scenarios.sawyer_hybrid_wipe import SawyerHybridWipe
from hqp_rp.scenarios.sawyer_priority_conflict import SawyerPriorityConflict
from hqp_rp.scenarios.sawyer_push_response import SawyerPushResponse
from hqp_rp.scenarios.sawyer_tilted_wipe import SawyerTiltedWipe
from hqp_rp.scenarios.sawyer_wall_contact import SawyerWallContact

POSTURES, SEEDS = 20, 5
"""A verdict rests on this many postures; each has one of this many seeds of noise and offset."""
MAPPED = 2
"""Postures in one cell of a map."""

SERVOS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
STIFF_SERVO = 30.0
STIFFNESSES = (1e3, 3e3, 1e4, 3e4, 1e5, 3e5, 1e6)
DELAYS = (0.0, 0.001, 0.002, 0.003, 0.005, 0.0075, 0.01)
NOISES = (0.0, 0.3, 1.0, 3.0)
RATIOS = (0.2, 0.5, 1.0, 2.0)
FRICTIONS = (0.0, 0.3)
BODE = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
BODE_AMPLITUDE = 2.0
SINE = 0.5
"""Hz, of sin(pi t)."""

PUSH, TRACK, TRACK_FAST, SWEEP_OF_SINES = "push", "tracking", "tracking sin(pi t)", "Bode"
MEET, SERVO_MAP, DELAY_MAP, NOISE, TUNING, RECOVERY = "wall", "servo map", "delay map", "noise", "B_d", "recovery"
PUSH_TORQUE, TRACK_TORQUE = "push, torque loop", "tracking, torque loop"
"""The law's accelerations by inverse dynamics: what the loop below the law has to do with a verdict."""
CORNER, WALL_NEAR, WIPE_NEAR, CONFLICT_NEAR = "corner, near", "wall, near", "wipe, near", "conflict, near"
WIPE, CONFLICT, HYBRID, RUB = "wipe", "conflict", "tilted wipe", "wipe with friction"
LIMITED_CORNER, LIMITED_CONFLICT = "corner, hard limits", "conflict, hard limits"
NEAR = (CORNER, WALL_NEAR, WIPE_NEAR, CONFLICT_NEAR)

SHORT_STUDY = (PUSH, TRACK_FAST, MEET, CORNER, WIPE_NEAR, CONFLICT_NEAR, HYBRID)
"""Experiments of the short study; near singularities only reverse priority takes part."""

_COARSE: dict[str, Any] = {"substeps": 4}


@dataclasses.dataclass(frozen=True)
class Places:
    """Where the experiments start: regular postures, and beside the singularities that each of them is about."""

    regular: Sequence[Place]
    corner: Sequence[Place]
    wipe: Sequence[Place]
    conflict: Sequence[Place]


def find_places(count: int = POSTURES) -> Places:
    """The places of all experiments, the same at every call."""
    return Places(
        regular_places(count),
        singular_places((("x",), LOWER_AXES), count, 0.1),
        singular_places((("x", "y", "z"), ("rx", "ry", "rz")), count, 0.0, edges=True),
        singular_places((("x",), ("y", "z")), count, 0.4),
    )


def trials(places: Places, *, quick: bool = False) -> list[Trial]:
    """Every run of the study; the short one has fewer experiments, and fewer methods near singularities."""
    found = [*_two_levels(places, quick), *_near(places, quick), *_three_levels(places)]
    if quick:
        return [trial for trial in found if trial.experiment in SHORT_STUDY]
    return found + list(_maps(places))


def _over(
    experiment: str, scenario: Interaction, gains: Sequence[str], places: Sequence[Place], methods: Sequence[Any]
) -> Iterator[Trial]:
    """Every posture with one of the seeds, in each of the gains, with each of the methods."""
    for own in gains:
        for who in methods:
            for i, place in enumerate(places):
                yield Trial(experiment, scenario, own, place, i, who, 1 + i % SEEDS)


def _two_levels(places: Places, quick: bool) -> Iterator[Trial]:
    reverse, both = [method(REVERSE)], (PAPER, DAMPED)
    for servo in (1.0, STIFF_SERVO):
        for first in ("x",) if quick else ("x", "rotation"):
            for travel in (0.0,) if quick else (0.0, 0.1):
                push = SawyerPushResponse(duration=2.0, servo=servo, first=first, travel=travel, **_COARSE)
                yield from _over(PUSH, push, (PAPER,), places.regular, reverse)
                yield from _over(PUSH, push, (PAPER,), places.corner, reverse)
        pushed = SawyerPushResponse(duration=2.0, servo=servo, **_COARSE)
        yield from _over(PUSH, pushed, (PAPER,), places.corner, [method(REVERSE_DAMPED)])
    period = 1.0 / AS_PRINTED
    yield from _over(TRACK, SawyerForceTracking(duration=2.0 * period + 0.5, **_COARSE), both, places.regular, reverse)
    fast = SawyerForceTracking(duration=2.0 / SINE + 1.0, frequencies=(SINE,), **_COARSE)
    yield from _over(TRACK_FAST, fast, both, places.regular, reverse)
    if not quick:
        for metric in ("none", "inertia"):
            driven = SawyerPushResponse(duration=2.0, inner_loop="torque", metric=metric, **_COARSE)
            for own in (places.regular, places.corner):
                yield from _over(PUSH_TORQUE, driven, (PAPER,), own, reverse)
        tracked = dataclasses.replace(fast, inner_loop="torque")
        yield from _over(TRACK_TORQUE, tracked, both, places.regular, reverse)
    sines = SawyerForceTracking(duration=1.0 / BODE[0] + 0.5, frequencies=BODE, amplitude=BODE_AMPLITUDE, **_COARSE)
    yield from _over(SWEEP_OF_SINES, sines, both, places.regular[: POSTURES // 2], reverse)
    for recovery in (0.05, None):
        start = SawyerForceTracking(duration=2.0, recovery=recovery, **_COARSE)
        who = [method(REVERSE), method(DLS, 0.01), method(DLS, 0.1), method(NULL_DAMPED, 0.1)]
        yield from _over(RECOVERY, start, (PAPER,), places.regular, who)
    for servo in (1.0, 10.0):
        meet = SawyerWallContact(duration=2.0, servo=servo, **_COARSE)
        yield from _over(MEET, meet, both, places.regular, reverse)


def _near(places: Places, quick: bool) -> Iterator[Trial]:
    """Beside the singularities: every method in the well-damped set; in the paper's, reverse priority alone."""
    swept = line_up()
    own_two = [method(label) for label in (REVERSE, REVERSE_DAMPED)]
    where: tuple[tuple[str, Interaction, Sequence[Place]], ...] = (
        (CORNER, SawyerForceTracking(duration=1.5, **_COARSE), places.corner),
        (WALL_NEAR, SawyerWallContact(duration=1.5, **_COARSE), places.corner),
        (WIPE_NEAR, SawyerHybridWipe(duration=2.0, **_COARSE), places.wipe),
        (CONFLICT_NEAR, SawyerPriorityConflict(duration=2.0, **_COARSE), places.conflict),
    )
    for name, scenario, own in where:
        yield from _over(name, scenario, (DAMPED,), own, own_two if quick else swept)
        if not quick:
            yield from _over(name, scenario, (PAPER,), own, own_two)
    if quick:
        return
    within = [method(label) for label in WITHIN_LIMITS]
    for name, (_, scenario, own) in zip((LIMITED_CORNER, LIMITED_CONFLICT), (where[0], where[3]), strict=True):
        told = dataclasses.replace(scenario, hard_limits=True)
        yield from _over(name, told, (DAMPED,), own, within)


def _three_levels(places: Places) -> Iterator[Trial]:
    who = [method(label) for label in (REVERSE, NULL_SPACE, CLASSICAL, DLS, CASCADE, WEIGHTED)]
    yield from _over(WIPE, SawyerHybridWipe(duration=2.0, **_COARSE), (DAMPED,), places.regular, who)
    yield from _over(CONFLICT, SawyerPriorityConflict(duration=2.0, **_COARSE), (DAMPED,), places.regular, who)
    for friction in FRICTIONS:
        tilted = SawyerTiltedWipe(duration=2.0, friction=friction, **_COARSE)
        yield from _over(HYBRID, tilted, (PAPER, DAMPED), places.regular, [method(REVERSE)])
    rub = SawyerHybridWipe(duration=2.0, friction=FRICTIONS[-1], **_COARSE)
    yield from _over(RUB, rub, (DAMPED,), places.regular, who[:3])


def _maps(places: Places) -> Iterator[Trial]:
    few, reverse = places.regular[:MAPPED], [method(REVERSE)]
    for stiffness in STIFFNESSES:
        for servo in SERVOS:
            meet = SawyerWallContact(duration=1.0, servo=servo, stiffness=stiffness, **_COARSE)
            yield from _over(SERVO_MAP, meet, (PAPER,), few, reverse)
        for delay in DELAYS:
            for servo, gains in ((1.0, PAPER), (STIFF_SERVO, PAPER), (STIFF_SERVO, DAMPED)):
                late = SawyerWallContact(duration=2.0, delay=delay, servo=servo, stiffness=stiffness, **_COARSE)
                yield from _over(DELAY_MAP, late, (gains,), few, reverse)
    for delay in DELAYS[1:]:
        late = SawyerWallContact(duration=2.0, delay=delay, **_COARSE)
        yield from _over(MEET, late, (PAPER, DAMPED), places.regular, reverse)
    for noise in NOISES:
        meet = SawyerWallContact(duration=2.0, noise=noise, **_COARSE)
        yield from _over(NOISE, meet, (PAPER, DAMPED), places.regular, reverse)
    for ratio in RATIOS:
        meet = SawyerWallContact(duration=2.0, damping_ratio=ratio, **_COARSE)
        yield from _over(TUNING, meet, (DAMPED,), places.regular, reverse)
