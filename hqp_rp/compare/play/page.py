"""The page of `hqp-rp play`: viser in front of a `PlayLoop`. What it shows and changes is all in the loop."""

from __future__ import annotations

import pathlib
import queue
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from hqp_rp.compare.play.arm import called
from hqp_rp.compare.play.loop import PlayLoop, Step
from hqp_rp.compare.play.pace import Pace
from hqp_rp.compare.play.panel import panel
from hqp_rp.compare.play.stage import Stage
from hqp_rp.compare.play.strip_chart import StripChart
from hqp_rp.compare.play.viser_server import in_server, serve, told_on_the_left
from hqp_rp.control.catalogue import Catalogue
from hqp_rp.core.damping import (
    ConstantDamping,
    ErrorDamping,
    LevelDamping,
    ManipulabilityDamping,
    NoDamping,
    NumericalFiltering,
    Truncation,
    VariableDamping,
)
from hqp_rp.core.errors import HqpError
from hqp_rp.core.paths import user_path
from hqp_rp.core.solver import Solver, all_solvers

AS_GIVEN, NOBODY = "as given", "nobody"

DAMPINGS: dict[str, Callable[[float], LevelDamping | None]] = {
    AS_GIVEN: lambda factor: None,
    "none": lambda factor: NoDamping(),
    "constant": ConstantDamping,
    "variable": lambda factor: VariableDamping(factor, factor),
    "truncation": Truncation,
    "manipulability": lambda factor: ManipulabilityDamping(factor, factor),
    "filtering": lambda factor: NumericalFiltering(factor, factor),
    "by error": ErrorDamping,
}
"""Name in the panel -> the policy with that factor in every place."""

_FRAME = 1.0 / 30.0
_PANEL = 0.1
_SEARCH = 2.0  # s; a search that goes on after the end is nobody's any more
_MOST_PLACES = 8  # buttons of one kind of singularity


class PlayPage:
    """Shows a loop on a page and lets it be played with. ::

        page = PlayPage(loop)
        page.run()              # until Ctrl-C; the address is page.address

    Args:
        loop: what runs. host, port: where the page is served; port 0 takes any that is free.
        starts: of the search for singularities, for each level; 0 for none.
        file: where recordings are saved to, unless the page says otherwise.

    Raises:
        MissingExtraError: viser is not installed. SettingError: a port that cannot be had.
    """

    def __init__(
        self, loop: PlayLoop, *, host: str = "127.0.0.1", port: int = 8080, starts: int = 16, file: str = "play.npz"
    ) -> None:
        self.loop = loop
        self._server = serve(host, port, "hqp-rp play")
        self._changes: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._stopped = threading.Event()
        self._threads: list[threading.Thread] = []
        self._searching: threading.Thread | None = None
        self._starts = starts
        self._solvers = {name: name for name in all_solvers()} | {called(arm.solver): arm.solver for arm in loop.arms}
        self.step: Step | None = None
        in_server(self._server, lambda: self._build_all(file))

    @property
    def address(self) -> str:
        """The page's address."""
        return f"http://{self._server.get_host()}:{self._server.get_port()}"

    def run(self) -> None:
        """Run the loop in real time until `stop`, or until it is interrupted."""
        if self._starts:
            self._searching = self._begin(self._search)
        try:
            self._run()
        finally:
            self.stop()

    def start(self) -> None:
        """`run`, in a thread of its own."""
        self._begin(self.run)

    def stop(self) -> None:
        """End the loop and the page."""
        if self._stopped.is_set():
            return
        self._stopped.set()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(timeout=_SEARCH if thread is self._searching else None)
        self._server.stop()

    def _begin(self, target: Callable[[], None]) -> threading.Thread:
        thread = threading.Thread(target=target, daemon=True)
        self._threads.append(thread)
        thread.start()
        return thread

    def _run(self) -> None:
        drawn, pace = 0.0, Pace(self.loop.dt, time.monotonic())
        while not self._stopped.is_set():
            self._change()
            now = time.monotonic()
            drove = False
            for _ in range(pace.due(now, running=self._running.value)):
                drove = drove or self.loop.driving
                self.step = self.loop.step()
            if drove:
                self._show(self._put_gizmos)
            if self.step is not None:
                self._draw(self.step, now - drawn >= _PANEL)
                drawn = now if now - drawn >= _PANEL else drawn
            self._stopped.wait(max(0.0, _FRAME - (time.monotonic() - now)))

    def _change(self) -> None:
        """What was asked for on the page since the last frame, in its order."""
        while True:
            try:
                change = self._changes.get_nowait()
            except queue.Empty:
                return
            try:
                change()
            except HqpError as error:
                self._tell(str(error))

    def _show(self, change: Callable[[], None]) -> None:
        """Change what is on the page."""
        in_server(self._server, change)

    def _tell(self, sentence: str, title: str = "Not done") -> None:
        def tell() -> None:
            for client in self._server.get_clients().values():
                client.add_notification(title, sentence, auto_close_seconds=12.0)

        self._show(tell)

    def _draw(self, step: Step, with_panel: bool) -> None:
        self._show(lambda: self._stage.show([arm.robot.q for arm in self.loop.arms]))
        if with_panel:
            solvers = [arm.label for arm in self.loop.arms]
            content = panel(self.loop.levels, step.arms, solvers, step.driving)
            self._show(lambda: self._draw_panel(step, content))

    def _draw_panel(self, step: Step, content: str) -> None:
        for i, target in enumerate(self.loop.targets):
            if not any(target.moves):  # a ring alone goes with its frame
                self._stage.put_gizmo(i, np.append(self._gizmo_place(i)[:3], np.full(4, np.nan)))
        self._html.content = content
        self._chart.add(step.time, step.arms)
        self._chart.draw()

    def _gizmo_place(self, i: int) -> Any:
        """Where the gizmo of a target stands: one that only turns its frame stands at the frame."""
        place = self.loop.place(i)
        if not np.isfinite(place[:3]).all():
            place[:3] = self.loop.arms[0].robot.pose(self.loop.targets[i].frame)[1]
        return place

    def _put_gizmos(self) -> None:
        for i in range(len(self.loop.targets)):
            self._stage.put_gizmo(i, self._gizmo_place(i))

    def _dragger(self, i: int) -> Callable[[Any, Any], None]:
        target = self.loop.targets[i]
        moves, turns = any(target.moves), any(target.turns)

        def dragged(position: Any, quaternion: Any) -> None:
            change = position if moves else None, quaternion if turns else None
            self._changes.put(lambda: self.loop.drag(i, *change))

        return dragged

    # --- what is on the page: all of it in the server's thread (in_server) -------------------------------------------

    def _build_all(self, file: str) -> None:
        self._stage = Stage(self._server, self.loop.robot.model, self.loop.arms[0].robot.q)
        for i, target in enumerate(self.loop.targets):
            self._stage.add_gizmo(target, self._gizmo_place(i), self._dragger(i))
        self._build(file)

    def _build(self, file: str) -> None:
        gui = self._server.gui
        tab = told_on_the_left(gui, "What each level pays")
        self._running = gui.add_checkbox(
            "running", True, hint="Off, time stands still: look, turn the picture, drag ahead."
        )
        with gui.add_folder("Solver"):
            self._choices = [self._choice(gui, 0, "solver")]
            self._choices.append(self._choice(gui, 1, "ghost"))
            meet = gui.add_button("Put the ghost where the arm is")
            limits = gui.add_checkbox(
                "joint limits hard", False, hint="The robot's joint limits as hard rows; off, it runs into its stops."
            )
        meet.on_click(lambda _: self._changes.put(self.loop.meet))
        limits.on_update(self._asked(lambda: self.loop.hold_joint_limits(limits.value, self._dampings())))
        with tab:
            self._html = gui.add_html("")
        self._chart = StripChart(gui, tab, self.loop.levels)
        self._singularities = gui.add_folder("Singularities")
        with self._singularities:
            self._found = gui.add_markdown("Searching ..." if self._starts else "Not searched for (--starts 0).")
            self._nearness = gui.add_slider(
                "log10 sigma", min=-9.0, max=-1.0, step=0.5, initial_value=-3.0,
                hint="How near a button drives: the vanishing singular value over ||A_k|| where the drive ends.",
            )  # fmt: skip
            home = gui.add_button("Drive home")
        home.on_click(lambda _: self._changes.put(self.loop.drive_home))
        with gui.add_folder("Record"):
            self._file = gui.add_text("file", file)
            self._record = gui.add_button("Record")
        self._record.on_click(lambda _: self._changes.put(self._recorded))

    def _choice(self, gui: Any, arm: int, label: str) -> tuple[Any, Any, Any]:
        """Solver, damping and its factor of one arm."""
        arms = self.loop.arms
        names = [*([NOBODY] if arm else []), *self._solvers]
        now = called(arms[arm].solver) if arm < len(arms) else NOBODY
        solver = gui.add_dropdown(label, tuple(dict.fromkeys(names)), initial_value=now)
        damping = gui.add_dropdown("damping", tuple(DAMPINGS), initial_value=AS_GIVEN)
        factor = gui.add_slider("log10 factor", min=-5.0, max=0.0, step=0.1, initial_value=-1.0)
        chosen = {"solver": now, "damping": AS_GIVEN}

        def put_back() -> None:
            solver.value, damping.value = chosen["solver"], chosen["damping"]

        def change() -> None:
            try:
                self._chosen(arm, solver.value)
            except HqpError:
                self._show(put_back)
                raise
            chosen.update(solver=solver.value, damping=damping.value)

        for one in (solver, damping, factor):
            one.on_update(self._asked(change))
        return solver, damping, factor

    def _chosen(self, arm: int, name: str) -> None:
        damping = self._damping(arm)
        if name == NOBODY:
            self.loop.compare_with(None)
        elif arm < len(self.loop.arms):
            self.loop.choose(self._solver(name), damping, arm=arm)
        else:
            self.loop.compare_with(self._solver(name), damping)

    def _solver(self, name: str) -> str | Solver:
        return self._solvers[name]

    def _damping(self, arm: int) -> LevelDamping | None:
        _, damping, factor = self._choices[arm]
        return DAMPINGS[damping.value](10.0**factor.value)

    def _dampings(self) -> tuple[LevelDamping | None, ...]:
        return tuple(self._damping(arm) for arm in range(len(self.loop.arms)))

    def _asked(self, change: Callable[[], None]) -> Callable[[Any], None]:
        """A callback that has the loop's own thread do this where somebody on a page asked for it."""
        return lambda event: None if event.client is None else self._changes.put(change)

    def _search(self) -> None:
        try:
            catalogue = self.loop.find_singularities(self._starts)
        except HqpError as error:
            sentence = f"None were searched for: {error}"
            self._changes.put(lambda: self._show(lambda: setattr(self._found, "content", sentence)))
            return
        self._changes.put(lambda: self._show(lambda: self._offer(catalogue)))

    def _offer(self, catalogue: Catalogue) -> None:
        """A row of buttons for each level and kind of singularity."""
        self._found.content = f"{len(catalogue)} found. A button drives the arm there; then drag the target." if len(
            catalogue
        ) else "None found."  # fmt: skip
        kinds = dict.fromkeys((place.level, place.name, place.kind) for place in catalogue)
        with self._singularities:
            for level, name, kind in kinds:
                places = catalogue.of(level, kind)[:_MOST_PLACES]
                label = f"{level + 1} {name}"
                buttons = self._server.gui.add_button_group(
                    label, [f"{kind.name.lower()} 1", *map(str, range(2, len(places) + 1))], hint=kind.value
                )
                buttons.on_click(self._driver(places))

    def _driver(self, places: Any) -> Callable[[Any], None]:
        def clicked(event: Any) -> None:
            place = places[int(event.target.value.split()[-1]) - 1]
            self._changes.put(lambda: self.loop.drive_to(place, 10.0**self._nearness.value))

        return clicked

    def _recorded(self) -> None:
        if not self.loop.recording:
            self.loop.record()
            self._show(lambda: setattr(self._record, "label", "Stop and save"))
            return
        recording = self.loop.stop_recording()
        self._show(lambda: setattr(self._record, "label", "Record"))
        path = recording.save(pathlib.Path(user_path(self._file.value)))
        self._tell(f"{path}: {recording!r}. Show it again: hqp-rp replay {path}", "Saved")
