"""Short films of the force scenarios: the arm at the wall, an arrow for the force and its curve, solvers side by side."""

from __future__ import annotations

import concurrent.futures
import contextlib
import multiprocessing
import os
import pathlib
import subprocess
import sys
from collections.abc import Mapping, Sequence

import numpy as np

from hqp_rp.compare.figures.film_sheet import Sheet
from hqp_rp.compare.figures.film_shot import Run, Shot, record, telling
from hqp_rp.compare.figures.film_stage import MOST, Stage

__all__ = ["Shot", "film", "film_all", "gl_missing"]

FRAMES_PER_SECOND = 20
QUALITY = 70
LAST = 1500
"""ms for which the last frame stays before the film begins again."""

_EGL = "egl"
_PATIENCE = 60.0  # s
_PROBE = """
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
with mujoco.Renderer(model, 16, 16) as renderer:
    renderer.update_scene(mujoco.MjData(model))
    renderer.render()
"""


def gl_missing() -> str:
    """Why nothing can be rendered here, as a sentence; empty where it can.

    Tried in a process of its own, because MuJoCo chooses its GL back end when it is imported and a driver may end the
    process. EGL, which needs no display, is chosen unless the environment variable MUJOCO_GL says otherwise.
    """
    environment = {"MUJOCO_GL": _EGL} | dict(os.environ)
    try:
        tried = subprocess.run(
            [sys.executable, "-c", _PROBE], env=environment, capture_output=True, timeout=_PATIENCE, check=False
        )
        failed = tried.returncode != 0
    except (OSError, subprocess.TimeoutExpired):
        failed = True
    if not failed:
        return ""
    return (
        f"No film: MuJoCo's GL back end {environment['MUJOCO_GL']!r} does not start on this machine. Install its library "
        "(EGL or OSMesa), or choose another with the environment variable MUJOCO_GL."
    )


def film(shots: Sequence[Shot], path: pathlib.Path) -> None:
    """Render shots side by side, in real time, to an animated WebP at `path` and a still beside it, a PNG of that name.

    Each shows the whole arm, a close-up of its ball at the wall, the force of the ball on each wall as an arrow, and the
    force over time; the desired force is grey in both. A run that its solver ended says "stopped". The still is at the
    moment at which the forces of the shots differ most (of one shot: from the desired one), with the whole curves.

    Needs a GL back end that MuJoCo chose when it was imported: `film_all` sees to that, in a process of its own.
    """
    runs = [record(shot) for shot in shots]
    period = max(run.shot.scenario.period for run in runs)
    end = max(shot.scenario.period * shot.scenario.periods() for shot in shots)
    with contextlib.ExitStack() as stack:
        sheet = Sheet(runs, _stages(runs, stack), end)
        times = np.arange(period, end - 0.5 * period, 1.0 / FRAMES_PER_SECOND).tolist()
        frames = [sheet.frame(time, time) for time in (*times, end)]
        still = sheet.frame(telling(runs, period, end), end)
    path.parent.mkdir(parents=True, exist_ok=True)
    still.save(path.with_suffix(".png"), optimize=True)
    unfinished = path.with_suffix(".part")
    each = round(1000 / FRAMES_PER_SECOND)
    frames[0].save(
        unfinished,
        format="WEBP",
        save_all=True,
        append_images=frames[1:],
        duration=[each] * (len(frames) - 1) + [LAST],
        loop=0,
        quality=QUALITY,
        method=2,
    )
    unfinished.replace(path)


def film_all(films: Mapping[str, Sequence[Shot]], folder: pathlib.Path) -> list[str]:
    """Render each film to `folder`/NAME.webp and NAME.png, unless it is there already.

    Returns the names of the WebP files that are there, and, where nothing can be rendered, one sentence that says why.
    """
    paths = {name: folder / f"{name}.webp" for name in films}
    missing = [name for name in films if not paths[name].exists()]
    reason = gl_missing() if missing else ""
    if reason:
        return [*(path.name for path in paths.values() if path.exists()), reason]
    before = os.environ.get("MUJOCO_GL")
    os.environ.setdefault("MUJOCO_GL", _EGL)
    try:
        with concurrent.futures.ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
            for job in [pool.submit(film, tuple(films[name]), paths[name]) for name in missing]:
                job.result()
    finally:
        if before is None:
            del os.environ["MUJOCO_GL"]
    return [path.name for path in paths.values()]


def _stages(runs: Sequence[Run], stack: contextlib.ExitStack) -> list[Stage]:
    """For each run its stage: runs with the same start and walls are seen by the same camera."""
    keys = [(run.shot.scenario, run.shot.case.place, run.shot.seed) for run in runs]
    stages = {}
    for key in dict.fromkeys(keys):
        alike = [run for run, own in zip(runs, keys, strict=True) if own == key]
        wish = {axis: max(float(run.desired[axis].max()) for run in alike) for axis in alike[0].force}
        top = {axis: max(float(run.force[axis].max()) for run in alike) for axis in wish}
        most = {axis: min(max(top[axis], wish[axis]), MOST * wish[axis]) for axis in wish}
        contact = key[0].contact_arm(alike[0].shot.case, key[2])
        stages[key] = stack.enter_context(Stage(contact, [run.q for run in alike], most, wish))
    return [stages[key] for key in keys]
