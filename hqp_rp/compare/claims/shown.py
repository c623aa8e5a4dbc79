"""The few runs whose curves are drawn, and which of them become films."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import polars as pl

from hqp_rp.compare.claims.experiments import FRICTIONS, STIFF_SERVO, Places
from hqp_rp.compare.claims.methods import (
    CLASSICAL,
    DLS,
    NULL_DAMPED,
    NULL_SPACE,
    REVERSE,
    REVERSE_DAMPED,
    UNILATERAL,
    Method,
    method,
)
from hqp_rp.compare.claims.trials import Trial, row
from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.figures.film import Shot
from hqp_rp.compare.run_folder import RunFolder, digest
from hqp_rp.compare.workers import in_processes
from hqp_rp.scenarios._interaction import DAMPED, PAPER, Interaction, Place
from hqp_rp.scenarios.sawyer_force_tracking import AS_PRINTED, SawyerForceTracking
from hqp_rp.scenarios.sawyer_hybrid_wipe import SawyerHybridWipe
from hqp_rp.scenarios.sawyer_priority_conflict import SawyerPriorityConflict
from hqp_rp.scenarios.sawyer_push_response import SawyerPushResponse
from hqp_rp.scenarios.sawyer_tilted_wipe import SawyerTiltedWipe
from hqp_rp.scenarios.sawyer_wall_contact import SawyerWallContact

PUSHED, TRACKED, MET, CORNERED, WIPED, CONFLICTED = "push", "tracking", "wall", "corner", "wipe", "conflict"
TILTED = "tilted wipe"
_WHO = (REVERSE, REVERSE_DAMPED, NULL_SPACE, NULL_DAMPED, CLASSICAL, DLS)


def shown(places: Places, *, quick: bool = False) -> list[Trial]:
    """The runs, without noise and offset; the first place of each kind. Two periods of (54) are not in a short study."""
    regular = places.regular[0]
    found = [
        _trial(PUSHED, SawyerPushResponse(duration=2.0, servo=servo), PAPER, regular, method(REVERSE))
        for servo in (1.0, STIFF_SERVO)
    ]
    tracking = SawyerForceTracking(duration=2.0 / AS_PRINTED + 0.5, substeps=4)
    if not quick:
        found += [_trial(TRACKED, tracking, gains, regular, method(REVERSE)) for gains in (PAPER, DAMPED)]
    for servo in (1.0, 10.0):
        meet = SawyerWallContact(duration=2.0, servo=servo)
        found += [_trial(MET, meet, gains, regular, method(REVERSE)) for gains in (PAPER, DAMPED)]
    for friction in FRICTIONS:
        found.append(_trial(TILTED, SawyerTiltedWipe(duration=2.0, friction=friction), PAPER, regular, method(REVERSE)))
    where: tuple[tuple[str, Interaction, Place], ...] = (
        (CORNERED, SawyerForceTracking(duration=1.5), places.corner[0]),
        (WIPED, SawyerHybridWipe(duration=2.0), places.wipe[0]),
        (CONFLICTED, SawyerPriorityConflict(duration=2.0), places.conflict[0]),
    )
    for name, scenario, place in where:
        found += [_trial(name, scenario, DAMPED, place, method(label)) for label in _WHO]
        told = dataclasses.replace(scenario, hard_limits=True)
        found.append(_trial(name, told, DAMPED, place, method(UNILATERAL)))
    return found


def halved(trials: Sequence[Trial]) -> list[Trial]:
    """The same runs with half the time step of the simulation."""
    return [
        dataclasses.replace(t, scenario=dataclasses.replace(t.scenario, substeps=2 * t.scenario.substeps))
        for t in trials
    ]


def curves(trials: Sequence[Trial], folder: RunFolder, *, workers: int = 1) -> tuple[list[pl.DataFrame], pl.DataFrame]:
    """The steps of each run and the figures of all, made by `workers` processes or kept in `folder`."""
    keys = [digest("shown", trial.key) for trial in trials]
    left = [(trial, key) for trial, key in zip(trials, keys, strict=True) if not folder.has(key)]
    for place, own in in_processes(Trial.steps, [trial for trial, _ in left], workers):
        folder.save(left[place][1], own)
    steps = [folder.load([key]) for key in keys]
    rows = [row(trial, own) for trial, own in zip(trials, steps, strict=True)]
    return steps, pl.DataFrame(rows, infer_schema_length=None)


def films(places: Places) -> Mapping[str, Sequence[Shot]]:
    """Name -> what is side by side: where the methods differ, and one where the gains do."""
    conflict, corner, wipe, regular = places.conflict[0], places.corner[0], places.wipe[0], places.regular[0]
    meet = SawyerWallContact(duration=2.0)
    pairs: dict[str, list[tuple[Interaction, str, Place, Method, str]]] = {
        "conflict": [
            (SawyerPriorityConflict(duration=3.0), DAMPED, conflict, method(label), label)
            for label in (REVERSE_DAMPED, CLASSICAL)
        ],
        "wipe": [
            (SawyerHybridWipe(duration=3.0), DAMPED, wipe, method(label), label) for label in (REVERSE, REVERSE_DAMPED)
        ],
        "wall": [(meet, gains, regular, method(REVERSE), f"{REVERSE}, {gains}") for gains in (PAPER, DAMPED)],
        "wall_near_singular": [
            (dataclasses.replace(meet, duration=1.5), DAMPED, corner, method(label), label)
            for label in (REVERSE_DAMPED, CLASSICAL)
        ],
    }
    return {
        name: [
            Shot(scenario, scenario.case_at(gains, place), Contestant(who.label, who.solver, ""), 0, title)
            for scenario, gains, place, who, title in own
        ]
        for name, own in pairs.items()
    }


def _trial(name: str, scenario: Interaction, gains: str, place: Place, who: Method) -> Trial:
    return Trial(name, scenario, gains, place, 0, who, 0)
