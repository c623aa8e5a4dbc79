"""Short films of the force scenarios: the arm at the wall, an arrow for the force and its curve, solvers side by side."""

from __future__ import annotations

import concurrent.futures
import contextlib
import dataclasses
import multiprocessing
import os
import pathlib
import subprocess
import sys
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image, ImageDraw, ImageFont

from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.film_stage import ARROW, COLOURS, NEAR, WHOLE, Stage
from hqp_rp.core.errors import HqpError
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.solution import Status
from hqp_rp.scenarios._interaction import Case, Interaction

FRAMES_PER_SECOND = 20
QUALITY = 70
COLUMN, HEAD, CURVE, FOOT = 420, 58, 180, 34
"""Pixels: the width of a shot, the heights of its title, its curve and of the line below all shots."""
LAST = 1500
"""ms for which the last frame stays before the film begins again."""

_MOST = 4.0  # of the desired force: what is larger leaves the chart, and its arrow grows no more
_INK, _GREY, _RED = "#111111", "#6b6b6b", "#c00000"

_EGL = "egl"
_PATIENCE = 60.0  # s
_PROBE = """
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
with mujoco.Renderer(model, 16, 16) as renderer:
    renderer.update_scene(mujoco.MjData(model))
    renderer.render()
"""


@dataclasses.dataclass(frozen=True, slots=True)
class Shot:
    """One run in a film: a case of a scenario with a contestant; `title` says what to see, else the contestant's label."""

    scenario: Interaction
    case: Case
    contestant: Contestant
    seed: int = 0
    title: str = ""


@dataclasses.dataclass(frozen=True, slots=True)
class _Run:
    """What a shot recorded: time (k,) s, q (k, n) rad, and force and desired force (k,) N for the axis of each wall."""

    shot: Shot
    time: FloatArray
    q: FloatArray
    force: Mapping[str, FloatArray]
    desired: Mapping[str, FloatArray]
    complete: bool

    def at(self, time: float) -> int:
        """The step that ends at a time, s, or the last."""
        return min(max(round(time / self.shot.scenario.period) - 1, 0), len(self.time) - 1)


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
    runs = [_record(shot) for shot in shots]
    period = max(run.shot.scenario.period for run in runs)
    end = max(float(run.time[-1]) for run in runs)
    with contextlib.ExitStack() as stack:
        sheet = _Sheet(runs, _stages(runs, stack), end)
        times = np.arange(period, end - 0.5 * period, 1.0 / FRAMES_PER_SECOND).tolist()
        frames = [sheet.frame(time, time) for time in (*times, end)]
        still = sheet.frame(_telling(runs, period, end), end)
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


def _record(shot: Shot) -> _Run:
    scenario, case = shot.scenario, shot.case
    contact = scenario.contact_arm(case, shot.seed)
    solver = dataclasses.replace(shot.contestant.solver)
    time, q, measured, refused = [], [], [], False
    for step in scenario.run_case(case, contact, solver, shot.seed):
        time.append(step.parameter + scenario.period)
        q.append(np.array(contact.robot.data.qpos))
        measured.append(step.measured)
        refused = step.solution.status is Status.REFUSED
        if refused:
            break
    if not measured:
        raise HqpError(f"{shot.contestant.label} ends {scenario.name}, {case.name}, before its first step: no film.")
    axes = [name.split()[2] for name in measured[0] if name.startswith("desired force")]
    force, desired = (
        {axis: np.array([float(m[f"{what} {axis} [N]"]) for m in measured]) for axis in axes}
        for what in ("force", "desired force")
    )
    return _Run(shot, np.array(time), np.array(q), force, desired, len(time) == scenario.periods() and not refused)


def _stages(runs: Sequence[_Run], stack: contextlib.ExitStack) -> list[Stage]:
    """For each run its stage: runs with the same start and walls are seen by the same camera."""
    keys = [(run.shot.scenario, run.shot.case.place, run.shot.seed) for run in runs]
    stages = {}
    for key in dict.fromkeys(keys):
        alike = [run for run, own in zip(runs, keys, strict=True) if own == key]
        wish = {axis: max(float(run.desired[axis].max()) for run in alike) for axis in alike[0].force}
        top = {axis: max(float(run.force[axis].max()) for run in alike) for axis in wish}
        most = {axis: min(max(top[axis], wish[axis]), _MOST * wish[axis]) for axis in wish}
        contact = key[0].contact_arm(alike[0].shot.case, key[2])
        stages[key] = stack.enter_context(Stage(contact, [run.q for run in alike], most, wish))
    return [stages[key] for key in keys]


def _telling(runs: Sequence[_Run], period: float, end: float) -> float:
    """s: when the forces differ most."""

    def spread(time: float) -> float:
        steps = [(run, run.at(time)) for run in runs]
        largest = 0.0
        for axis in runs[0].force:
            values = [run.force[axis][k] for run, k in steps if axis in run.force]
            if len(values) == 1:
                values.append(runs[0].desired[axis][steps[0][1]])
            largest = max(largest, float(np.ptp(values)))
        return largest

    return max(np.arange(period, end + 0.5 * period, period).tolist(), key=spread)


class _Sheet:
    """The picture of a film: what stays, drawn once, and the rest for every frame."""

    def __init__(self, runs: Sequence[_Run], stages: Sequence[Stage], end: float) -> None:
        self._runs, self._stages, self._end = runs, stages, end
        size = (COLUMN * len(runs), HEAD + WHOLE[0] + CURVE + FOOT)
        self._base = Image.new("RGB", size, "white")
        draw = ImageDraw.Draw(self._base)
        for i, run in enumerate(runs):
            shot = run.shot
            name = type(shot.scenario).name.removeprefix("sawyer_").replace("_", " ")
            for words, y, largest, colour in (
                (shot.title or shot.contestant.label, 8, 22, _INK),
                (f"{shot.contestant.label}, " * bool(shot.title) + f"{name}: {shot.case.name}", 36, 14, _GREY),
            ):
                draw.text((COLUMN * i + 12, y), words, fill=colour, font=_fitting(words, largest))
        self._bare, self._curves, self._left, self._right, self._rise = _curves(runs, end)

    def frame(self, time: float, shown: float) -> Image.Image:
        """The arms at a time, s, and the curves up to another."""
        sheet = self._base.copy()
        draw = ImageDraw.Draw(sheet)
        y = HEAD + WHOLE[0]
        sheet.paste(self._bare, (0, y))
        for i, (run, stage) in enumerate(zip(self._runs, self._stages, strict=True)):
            left, k = COLUMN * i, run.at(time)
            force = {axis: float(values[k]) for axis, values in run.force.items()}
            wish = {axis: float(values[k]) for axis, values in run.desired.items()}
            whole, near = map(Image.fromarray, stage.pictures(run.q[k], force, wish))
            sheet.paste(whole, (left + 4, HEAD))
            corner = (left + COLUMN - NEAR[1] - 8, HEAD + 4)
            sheet.paste(near, corner)
            draw.rectangle((corner[0] - 1, corner[1] - 1, corner[0] + NEAR[1], corner[1] + NEAR[0]), outline="#b0b0b0")
            self._tell(draw, (corner[0], corner[1] + NEAR[0] + 8), force, wish, self._stopped(run, time))
            until = left + self._across(shown)
            sheet.paste(self._curves.crop((left, 0, until, CURVE)), (left, y))
            mark = left + self._across(time)
            draw.line([(mark, y + self._rise[0]), (mark, y + self._rise[1])], fill=_INK, width=2)
            if left:
                draw.line([(left, 0), (left, sheet.height - FOOT)], fill="#d0d0d0")
        self._foot(draw, time)
        return sheet

    def _across(self, time: float) -> int:
        return round(self._left + (self._right - self._left) * time / self._end)

    def _stopped(self, run: _Run, time: float) -> str:
        last = float(run.time[-1])
        return "" if run.complete or time < last else f"stopped at {last:.2f} s"

    def _tell(
        self,
        draw: ImageDraw.ImageDraw,
        corner: tuple[int, int],
        force: Mapping[str, float],
        wish: Mapping[str, float],
        stopped: str,
    ) -> None:
        x, y = corner
        for axis, value in force.items():
            words, where = f"{value:.0f} N", f"on the wall in {axis}" if len(force) > 1 else "on the wall"
            draw.text((x, y), words, fill=COLOURS[axis], font=_font(30))
            beside = x + max(84, round(_font(30).getlength(words)) + 8)
            draw.text((beside, y + 2), where, fill=COLOURS[axis], font=_font(13))
            draw.text((beside, y + 17), f"desired {wish[axis]:.0f} N", fill=_GREY, font=_font(13))
            y += 38
        if stopped:
            draw.text((x, y), stopped, fill=_RED, font=_font(20))

    def _foot(self, draw: ImageDraw.ImageDraw, time: float) -> None:
        y = self._base.height - FOOT + 8
        draw.text((12, y), f"t = {time:.2f} s", fill=_INK, font=_font(18))
        words = f"arrow: force of the orange ball on the brown wall, 30 N = {3000 * ARROW:.0f} cm; grey: desired"
        draw.text((120, y + 3), words, fill=_GREY, font=_fitting(words, 15, self._base.width - 130))


def _curves(runs: Sequence[_Run], end: float) -> tuple[Image.Image, Image.Image, float, float, tuple[int, int]]:
    """The charts without and with the measured curves, and where a column's axes begin and end: across, and from above."""
    dpi = 100
    figure = Figure(figsize=(COLUMN * len(runs) / dpi, CURVE / dpi), dpi=dpi, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    wish = max(float(values.max()) for run in runs for values in run.desired.values())
    most = max(float(values.max()) for run in runs for values in run.force.values())
    top = 1.12 * min(max(most, wish), _MOST * wish)
    left, right, low, high = 52, COLUMN - 16, 38, CURVE - 24
    measured = []
    for i, run in enumerate(runs):
        width = COLUMN * len(runs)
        axes = figure.add_axes(((COLUMN * i + left) / width, low / CURVE, (right - left) / width, (high - low) / CURVE))
        for axis, values in run.desired.items():
            label = "desired" if axis == next(iter(run.desired)) else "_"
            axes.plot(run.time, values, color="#a0a0a0", linewidth=3.0, label=label)
            label = f"measured in {axis}" if len(run.force) > 1 else "measured"
            measured += axes.plot(run.time, run.force[axis], color=COLOURS[axis], linewidth=1.6, label=label)
        axes.set_xlim(0.0, end)
        axes.set_ylim(min(0.0, -0.02 * top), top)
        axes.set_xlabel("time (s)", fontsize=8, labelpad=1.0)
        axes.set_ylabel("force (N)", fontsize=8)
        axes.tick_params(labelsize=8)
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), fontsize=8, frameon=False, ncols=3, borderpad=0.0)
        axes.spines[["top", "right"]].set_visible(False)
    pictures = []
    for visible in (False, True):
        for line in measured:
            line.set_visible(visible)
        canvas.draw()
        pictures.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"))
    return pictures[0], pictures[1], left, right, (CURVE - high, CURVE - low)


def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size=size)


def _fitting(words: str, size: int, width: int = COLUMN - 24) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """The largest font up to a size in which the words are no wider than so many pixels, but a readable one."""
    while size > 11 and _font(size).getlength(words) > width:
        size -= 1
    return _font(size)
