"""Short films of the force scenarios, rendered by MuJoCo off screen: an animated WebP for each."""

from __future__ import annotations

import concurrent.futures
import dataclasses
import multiprocessing
import os
import pathlib
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

from hqp_rp.compare.contestants import Contestant
from hqp_rp.scenarios._interaction import Case, Interaction

WIDTH, HEIGHT = 320, 320
FRAMES_PER_SECOND = 20
QUALITY = 60

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


def film(scenario: Interaction, contestants: Sequence[Contestant], path: pathlib.Path, *, seed: int = 0) -> None:
    """Render one case of the scenario, the last (well damped, near singular), one contestant beside the other.

    Real time, `FRAMES_PER_SECOND`; the tool is the orange ball, walls are grey. Needs a GL back end that MuJoCo chose when
    it was imported: `film_all` sees to that, in a process of its own.
    """
    from PIL import Image

    case = scenario.cases()[-1]
    rows = [_frames(scenario, case, contestant, seed) for contestant in contestants]
    longest = max(map(len, rows))
    pictures = []
    for k in range(longest):
        picture = Image.new("RGB", (WIDTH * len(rows), HEIGHT))
        for i, frames in enumerate(rows):
            picture.paste(frames[min(k, len(frames) - 1)], (WIDTH * i, 0))
        pictures.append(picture)
    path.parent.mkdir(parents=True, exist_ok=True)
    pictures[0].save(
        path,
        format="WEBP",
        save_all=True,
        append_images=pictures[1:],
        duration=round(1000 / FRAMES_PER_SECOND),
        loop=0,
        quality=QUALITY,
        method=2,
    )


def film_all(scenarios: Sequence[Interaction], contestants: Sequence[Contestant], folder: pathlib.Path) -> list[str]:
    """Render every scenario to `folder`/NAME.webp; returns the file names, or one sentence that says why there are none."""
    reason = gl_missing()
    if reason:
        return [reason]
    names = [f"{type(scenario).name}.webp" for scenario in scenarios]
    before = os.environ.get("MUJOCO_GL")
    os.environ.setdefault("MUJOCO_GL", _EGL)
    try:
        with concurrent.futures.ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
            jobs = [
                pool.submit(film, scenario, tuple(contestants), folder / name)
                for scenario, name in zip(scenarios, names, strict=True)
            ]
            for job in jobs:
                job.result()
    finally:
        if before is None:
            del os.environ["MUJOCO_GL"]
    return names


def _frames(scenario: Interaction, case: Case, contestant: Contestant, seed: int) -> list[Any]:
    import mujoco
    import numpy as np
    from PIL import Image, ImageDraw

    contact = scenario.contact_arm(case, seed)
    model, data = contact.robot.model, contact.robot.data
    camera = mujoco.MjvCamera()
    camera.lookat[:] = 0.6 * contact.robot.pose("tool")[1] + 0.4 * np.array((0.0, 0.0, 0.317))
    camera.distance, camera.azimuth, camera.elevation = 1.9, 125.0, -18.0
    model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = 0.45, 0.55
    for geom in range(model.ngeom):  # the last link is thicker than the ball, so the arm is drawn half transparent
        if model.geom_bodyid[geom] and model.geom(geom).name != "ball":
            model.geom_rgba[geom] = (0.15, 0.4, 0.7, 0.4)
        elif not model.geom_bodyid[geom]:
            model.geom_rgba[geom] = (0.75, 0.77, 0.8, 1.0)
    every = max(1, round(1.0 / (FRAMES_PER_SECOND * scenario.period)))
    frames = []
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        steps = scenario.run_case(case, contact, dataclasses.replace(contestant.solver), seed)
        for k, step in enumerate(steps):
            if k % every:
                continue
            renderer.update_scene(data, camera)
            pixels = renderer.render()
            pixels[(pixels == 0).all(axis=2)] = 245  # nothing was drawn there
            picture = Image.fromarray(pixels)
            words = f"{contestant.label}\nt = {step.parameter:.2f} s\nF_x = {step.measured['force x [N]']:.1f} N"
            ImageDraw.Draw(picture).multiline_text((8, 8), words, fill=(0, 0, 0))
            frames.append(picture)
    return frames
