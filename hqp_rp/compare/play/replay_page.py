"""The page of `hqp-rp replay` for a recorded run: the same picture and panel, with a slider for the time."""

from __future__ import annotations

import functools
import threading
import time

import numpy as np

from hqp_rp.compare.play.panel import panel
from hqp_rp.compare.play.recording import Recording
from hqp_rp.compare.play.stage import Stage
from hqp_rp.compare.play.strip_chart import StripChart
from hqp_rp.compare.play.targets import targets_of
from hqp_rp.compare.play.viser_server import in_server, serve, told_on_the_left
from hqp_rp.control.stack_file import parse_stack
from hqp_rp.core.errors import FileError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.mujoco_robot import MujocoRobot

_FRAME = 1.0 / 30.0
_PANEL = 0.1


class ReplayPage:
    """Shows a recording again. ::

        ReplayPage(load_recording("play.npz")).run()

    Args:
        recording: what was recorded. host, port: where the page is served; port 0 takes any that is free.

    Raises:
        MissingExtraError: viser is not installed. SettingError: a port that cannot be had.
        FileError: the robot is not the one that was recorded. HqpError: it cannot be loaded any more.
    """

    def __init__(self, recording: Recording, *, host: str = "127.0.0.1", port: int = 8080) -> None:
        self.recording = recording
        robot = recording.source().robot()
        if not isinstance(robot, MujocoRobot) or robot.nq != recording.q.shape[2]:
            raise FileError(
                f"The robot {recording.robot['model']} has another configuration than was recorded "
                f"({recording.q.shape[2]} numbers); the recording needs the robot's file as it was."
            )
        stack = parse_stack(recording.stack).stack(robot)
        self._server = serve(host, port, "hqp-rp replay")
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None
        self._shown, self._charted = -1, -1
        self._robot, self._targets = robot, targets_of(stack)
        in_server(self._server, self._build)

    def _build(self) -> None:
        recording = self.recording
        self._stage = Stage(self._server, self._robot.model, recording.q[0, 0])
        for i, target in enumerate(self._targets):
            self._stage.add_gizmo(target, self._place(0, i), None)
        gui = self._server.gui
        tab = told_on_the_left(gui, "What each level paid")
        with tab:
            self._html = gui.add_html("")
        self._chart = StripChart(gui, tab, recording.levels)
        gui.add_markdown(f"{len(recording)} steps, {len(recording) * recording.dt:.3g} s")
        self._step = gui.add_slider("step", 0, len(recording) - 1 or 1, 1, 0)
        self._playing = gui.add_checkbox("play", True)
        self._speed = gui.add_slider("speed", 0.1, 4.0, 0.1, 1.0)

    @property
    def address(self) -> str:
        """The page's address."""
        return f"http://{self._server.get_host()}:{self._server.get_port()}"

    @property
    def step(self) -> int:
        """The step that is shown."""
        return min(int(self._step.value), len(self.recording) - 1)

    def run(self) -> None:
        """Show the recording, again and again, until `stop` or an interrupt."""
        try:
            at, told, last = 0.0, 0.0, time.monotonic()
            while not self._stopped.is_set():
                now = time.monotonic()
                if int(self._step.value) != int(at):
                    at = float(self._step.value)  # somebody moved the slider
                if self._playing.value and self._server.get_clients():
                    at = (at + (now - last) * float(self._speed.value) / self.recording.dt) % len(self.recording)
                    in_server(self._server, functools.partial(setattr, self._step, "value", int(at)))
                last = now
                self.show(self.step, with_panel=now - told >= _PANEL)
                told = now if now - told >= _PANEL else told
                self._stopped.wait(max(0.0, _FRAME - (time.monotonic() - now)))
        finally:
            self.stop()

    def start(self) -> None:
        """`run`, in a thread of its own."""
        self._thread = threading.Thread(target=self.run, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the page."""
        if self._stopped.is_set():
            return
        self._stopped.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout=10.0)
        self._server.stop()

    def _place(self, step: int, target: int) -> FloatArray:
        """(7,) where a target was; one that only turns its frame, at the frame."""
        place: FloatArray = self.recording.place[step, target].copy()
        if not np.isfinite(place[:3]).all():
            self._robot.update(self.recording.q[step, 0])
            place[:3] = self._robot.pose(self._targets[target].frame)[1]
        return place

    def show(self, step: int, *, with_panel: bool = True) -> None:
        """Show this step."""
        in_server(self._server, lambda: self._show(step, with_panel))

    def _show(self, step: int, with_panel: bool) -> None:
        recording = self.recording
        states = [recording.state(step, arm) for arm in range(recording.arms)]
        there = [(i, state) for i, state in enumerate(states) if state is not None]
        if step != self._shown:
            self._stage.show([state.q for _, state in there])
            for i in range(len(self._targets)):
                self._stage.put_gizmo(i, self._place(step, i))
            self._shown = step
        if with_panel and step != self._charted:
            solvers = [recording.solver_of(step, i) for i, _ in there]
            driving = bool(recording.driving[step])
            self._html.content = panel(recording.levels, [state for _, state in there], solvers, driving)
            self._chart.add(float(recording.time[step]), states)
            self._chart.draw()
            self._charted = step
