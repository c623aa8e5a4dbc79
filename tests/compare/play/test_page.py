"""The page: what a person does on it reaches the loop, what the loop does is to be seen; in a browser where one is."""

from __future__ import annotations

import contextlib
import importlib.util
import math
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hqp_rp
from hqp_rp.compare.command_line import main
from hqp_rp.compare.exit_codes import MISUSE
from hqp_rp.compare.play.loop import PlayLoop
from hqp_rp.compare.play.pace import MOST_STEPS
from hqp_rp.compare.play.recording import load_recording
from hqp_rp.compare.play.show import _own_stack, page_of
from hqp_rp.compare.play.viser_server import in_server
from hqp_rp.control._rotations import quaternion_to_matrix
from hqp_rp.control.stack_file import load_stack
from hqp_rp.robot.named import ROBOTS
from hqp_rp.robot.robot_source import RobotSource
from tests.compare.play.browser import CHROMIUM, Browser, in_a_browser

needs_viser = pytest.mark.skipif(
    importlib.util.find_spec("viser") is None, reason="viser is not installed (extra play)"
)
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here to open the page in")


def until(true: Callable[[], object], seconds: float = 120.0) -> Any:
    end = time.monotonic() + seconds
    while not (found := true()):
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.02)
    return found


@contextlib.contextmanager
def running(page: Any) -> Iterator[Any]:
    page.start()
    try:
        yield page
    finally:
        page.stop()


def page(robot: str = "planar4", *solvers: str, **settings: Any) -> Any:
    return page_of(robot, None, solvers, port=0, **settings)


def pass_frames(shown: Any, count: int) -> None:
    """Wait until the page's loop has begun that many frames more."""
    for _ in range(count):
        begun = threading.Event()
        shown._changes.put(begun.set)
        assert begun.wait(120.0)
        time.sleep(0.02)  # what is put while a frame begins still belongs to it


class Person:
    """Whom an event of the page comes from."""

    def __init__(self, target: Any = None) -> None:
        self.client, self.target = object(), target


def change(handle: Any, value: Any) -> None:
    """What viser does where somebody on a page sets a value."""
    handle._impl.value = value
    for callback in handle._impl.update_cb:
        callback(Person(handle))


# --- without a browser -----------------------------------------------------------------------------------------------


@needs_viser
def test_what_is_chosen_on_the_page_reaches_the_loop() -> None:
    with running(page("sawyer", starts=0)) as shown:
        loop = shown.loop
        (solver, damping, factor), (ghost, *_) = shown._choices
        assert (solver.value, ghost.value) == ("null_space", "nobody")
        change(solver, "damped_least_squares")
        until(lambda: loop.arms[0].label == "damped_least_squares")
        change(damping, "constant")
        until(lambda: loop.arms[0].label == "damped_least_squares")  # 0.1 is its default
        change(factor, -2.0)
        until(lambda: loop.arms[0].label == "damped_least_squares (damping constant(0.01))")
        change(ghost, "reverse_priority")
        until(lambda: len(loop.arms) == 2 and loop.arms[1].label == "reverse_priority")
        change(ghost, "nobody")
        until(lambda: len(loop.arms) == 1)
        until(lambda: "damped_least_squares" in shown._html.content)


@needs_viser
def test_a_damping_that_is_refused_is_put_back() -> None:
    with running(page("sawyer", starts=0)) as shown:
        solver, damping, _ = shown._choices[0]
        change(damping, "by error")  # of a level, which null_space has for levels
        until(lambda: "levels damped by" in shown.loop.arms[0].label)
        refusing = next(name for name, kind in hqp_rp.all_solvers().items() if not kind.takes_damping)
        change(solver, refusing)
        until(lambda: solver.value == "null_space")
        assert damping.value == "by error"
        assert shown.loop.arms[0].label.startswith("null_space")


@needs_viser
def test_the_atlas_is_found_while_the_loop_runs_and_its_buttons_drive() -> None:
    with running(page("planar4", starts=4)) as shown:
        until(lambda: "found" in shown._found.content)
        catalogue = shown.loop.catalogue
        clicked = shown._driver(catalogue.of(1))
        arm, place = shown.loop.arms[0], catalogue.of(1)[0]
        assert np.abs(arm.robot.q - place.q).max() > 0.1
        clicked(Person(type("Button", (), {"value": "algorithmic 1"})))
        until(lambda: not shown.loop.driving and np.abs(arm.robot.q - place.q).max() < 0.1)
        gizmo = shown._stage._gizmos[0]
        until(lambda: np.allclose(gizmo.position, shown.loop.place(0)[:3], atol=1e-6))


@needs_viser
def test_the_loop_is_never_ahead_of_the_clock() -> None:
    with running(page("planar4", starts=0)) as shown:
        until(lambda: shown.step is not None)
        begin, time_then = time.monotonic(), shown.loop.time
        until(lambda: shown.loop.time > time_then + 1.0)
        passed = shown.loop.time - time_then
        assert passed < time.monotonic() - begin + 2 * MOST_STEPS * shown.loop.dt  # of a frame begun, and of the next


URDF = """<robot name="two">
  <link name="base"/>
  <link name="arm"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision name="box"><geometry><box size="0.1 0.1 0.4"/></geometry></collision></link>
  <link name="hand"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><cylinder radius="0.05" length="0.3"/></geometry></visual></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
  <joint name="slide" type="prismatic"><parent link="arm"/><child link="hand"/><origin xyz="0 0 0.4"/><axis xyz="0 0 1"/>
    <limit lower="-0.2" upper="0.2" velocity="1" effort="1"/></joint>
</robot>"""


@needs_viser
def test_a_robot_of_ones_own_is_played_with(tmp_path: Path) -> None:
    (tmp_path / "two.urdf").write_text(URDF)
    stack = '[robot]\nmodel = "two.urdf"\n[[level]]\n[[level.task]]\ntype = "position"\nframe = "hand"\naxes = "xz"'
    (tmp_path / "stack.toml").write_text(stack)
    with running(page_of(None, str(tmp_path / "stack.toml"), port=0, starts=2)) as shown:
        until(lambda: shown.step is not None)
        shown._changes.put(lambda: shown.loop.drag(0, position=[0.2, 0.0, 0.4]))
        until(lambda: np.abs(shown.loop.arms[0].robot.pose("hand")[1] - [0.2, 0.0, 0.4]).max() < 1e-3)
        assert [shape.name for shape in shown._stage._shapes] == ["box"]
        until(lambda: "found" in shown._found.content)


@needs_viser
def test_a_ring_goes_with_its_frame() -> None:
    with running(page("planar4", starts=0)) as shown:
        ring, robot = shown._stage._gizmos[1], shown.loop.arms[0].robot
        shown._changes.put(lambda: shown.loop.drag(1, quaternion=[math.cos(0.4), 0.0, 0.0, math.sin(0.4)]))
        until(lambda: shown.loop.time > 1.0)
        shown._running.value = False
        until(lambda: np.allclose(ring.position, robot.pose("link2")[1], atol=1e-6))


@needs_viser
def test_time_stands_still_where_it_is_asked_to() -> None:
    with running(page("planar4", starts=0)) as shown:
        until(lambda: shown.loop.time > 0.1)
        shown._running.value = False
        pass_frames(shown, 3)
        stopped = shown.loop.time
        pass_frames(shown, 10)
        assert shown.loop.time == stopped
        shown._running.value = True
        until(lambda: shown.loop.time > stopped)


@needs_viser
def test_a_recording_is_made_on_the_page_and_shown_again(tmp_path: Path) -> None:
    from hqp_rp.compare.play.replay_page import ReplayPage

    with running(page("planar4", "null_space", "reverse_priority", starts=0, file=str(tmp_path / "run.npz"))) as shown:
        shown._changes.put(shown._recorded)
        until(lambda: shown._record.label == "Stop and save")
        until(lambda: shown.loop._recorder is not None and len(shown.loop._recorder) >= 20)
        shown._changes.put(shown._recorded)
        until(lambda: (tmp_path / "run.npz").exists())
    recording = load_recording(tmp_path / "run.npz")
    assert len(recording) >= 20
    replay = ReplayPage(recording, port=0)
    try:
        replay.show(7)
        for arm in range(2):
            q = recording.q[7, arm]
            replay._stage._pose(q)
            body, frame = next(reversed(replay._stage._bodies[arm].items()))
            np.testing.assert_allclose(frame.position, replay._stage._data.xpos[body], atol=1e-6)
        assert "reverse_priority" in replay._html.content
        tool, ring = replay._stage._gizmos
        np.testing.assert_allclose(tool.position, recording.place[7, 0, :3], atol=1e-6)
        replay._robot.update(recording.q[7, 0])
        np.testing.assert_allclose(ring.position, replay._robot.pose("link2")[1], atol=1e-6)
        replay._step.value = 15
        assert replay.step == 15
    finally:
        replay.stop()


@needs_viser
def test_a_recording_of_another_robot_is_refused(tmp_path: Path) -> None:
    import dataclasses

    from hqp_rp.compare.play.replay_page import ReplayPage

    loop = PlayLoop(RobotSource("planar4"), load_stack("planar4"), "null_space")
    loop.record()
    loop.step()
    recording = dataclasses.replace(loop.stop_recording(), robot={"model": "sawyer"})
    with pytest.raises(hqp_rp.FileError, match="The robot sawyer has another configuration than was recorded"):
        ReplayPage(recording, port=0)


@needs_viser
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nosuch"], "'nosuch' comes with no stack: say with --stack FILE what it shall do"),
        (["planar4", "--solver", "nul_space"], "Did you mean 'null_space'?"),
        (["planar4", *["--solver", "null_space"] * 3], "two can be seen side by side"),
        (["planar4", "--port", "-1"], "port is -1; it must be an integer from 0"),
        (["planar4", "--stack", "humanoid", "--port", "0"], "left_sole"),
    ],
)
def test_wrong_input_is_one_line(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["play", *arguments]) == MISUSE
    told = capsys.readouterr().err
    assert words in told
    assert told.count("\n") == 1


@pytest.mark.parametrize("robot", ["planar7", *(name for name in ROBOTS if name != "planarN")])
def test_every_named_robot_has_a_stack_that_fits_it(robot: str) -> None:
    file = load_stack(_own_stack(robot))
    loop = PlayLoop(RobotSource(robot), file, "null_space")
    assert loop.step() is not None


@needs_viser
def test_a_port_that_is_taken_is_said() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(hqp_rp.SettingError, match=f"port is {port}, which cannot be had at 127.0.0.1"):
            page_of("planar4", None, port=port)


def test_without_viser_the_command_says_what_installs_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    real = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *more: None if name == "viser" else real(name, *more))
    assert main(["play", "planar4"]) == MISUSE
    told = "hqp-rp play needs viser, which is not installed: pip install viser"
    told += ', or install hqp-rp with its extra "play"'
    assert capsys.readouterr().err == f"hqp-rp: {told}\n"
    loop = PlayLoop(RobotSource("planar4"), load_stack("planar4"), "null_space")
    loop.record()
    loop.step()
    path = loop.stop_recording().save(tmp_path / "run.npz")
    assert main(["replay", str(path)]) == MISUSE
    assert f"or write it as a figure: hqp-rp replay {path} --figure FILE.png" in capsys.readouterr().err


# --- in a browser ----------------------------------------------------------------------------------------------------


def canvas(browser: Browser) -> list[float]:
    """Left, top, width and height of the picture of the scene."""
    rectangle = 'const r = document.querySelector("canvas").getBoundingClientRect();'
    found: list[float] = browser.evaluate(f"(() => {{ {rectangle} return [r.left, r.top, r.width, r.height]; }})()")
    return found


def catch_up(browser: Browser, shown: Any) -> None:
    """Wait until all that the page was told so far is to be seen: what it is told it does in that order."""
    told = f"told at {time.monotonic_ns()}"
    sign = in_server(shown._server, lambda: shown._server.gui.add_markdown(told))
    browser.wait_for(f"document.body.textContent.includes({told!r})")
    browser.draw()
    in_server(shown._server, sign.remove)


def on_screen(browser: Browser, shown: Any, point: Any) -> tuple[float, float]:
    """Where a point (3,) of the scene is on the page, by the camera that the browser tells."""
    from viser.transforms import SO3

    (client,) = shown._server.get_clients().values()
    left, top, width, height = canvas(browser)
    x, y, depth = SO3(client.camera.wxyz).as_matrix().T @ (np.asarray(point) - client.camera.position)
    scale = height / 2.0 / math.tan(client.camera.fov / 2.0) / depth
    return left + width / 2.0 + scale * x, top + height / 2.0 + scale * y


def hide_notifications(browser: Browser) -> None:
    """One says that no graphics card draws, and covers what is to be dragged."""
    rule = ".mantine-Notification-root { display: none }"
    browser.evaluate(f"document.head.appendChild(document.createElement('style')).textContent = {rule!r}")


@needs_viser
@needs_browser
@in_a_browser
def test_a_person_clicks_drags_and_sees(tmp_path: Path) -> None:
    with (
        running(page("sawyer", "null_space", "reverse_priority", starts=4)) as shown,
        Browser(tmp_path, 1100, 500) as browser,
    ):
        loop = shown.loop
        browser.open(shown.address)
        browser.wait_for('!!document.querySelector(".hqp-rp-panel") && !!document.querySelector("canvas")')
        browser.wait_for('document.body.textContent.includes("found. A button")')
        until(lambda: shown._server.get_clients())
        hide_notifications(browser)

        home = loop.arms[0].robot.q
        browser.click_text("algorithmic 1")
        until(lambda: not loop.driving and np.abs(loop.arms[0].robot.q - home).max() > 0.1)
        until(lambda: "Driven" not in shown._html.content)
        browser.wait_for('document.querySelector(".hqp-rp-panel").textContent.includes("Solved.")')

        gizmo = shown._stage._gizmos[0]
        place = loop.place(0)
        until(lambda: np.allclose(gizmo.position, place[:3], atol=1e-6))
        catch_up(browser, shown)
        R = quaternion_to_matrix(place[3:])
        tips = [place[:3] + 0.16 * shown._stage._size * R[:, k] for k in range(3)]
        middle = np.array(on_screen(browser, shown, place[:3]))
        spots = [np.array(on_screen(browser, shown, tip)) for tip in tips]
        longest = max(range(3), key=lambda k: float(np.linalg.norm(spots[k] - middle)))
        arrow = spots[longest] - middle
        browser.drag(tuple(spots[longest]), tuple(spots[longest] + arrow))
        until(lambda: np.linalg.norm(loop.place(0)[:3] - place[:3]) > 0.02)
        moved = loop.place(0)[:3] - place[:3]
        assert abs(moved @ R[:, longest]) == pytest.approx(np.linalg.norm(moved), rel=1e-3)  # along the arrow alone
        until(lambda: np.allclose(gizmo.position, loop.place(0)[:3], atol=1e-6))
        until(lambda: shown.step.arms[0].error[0] > 1e-6)

        catch_up(browser, shown)
        browser.screenshot(tmp_path / "page.png")
        assert _colours(tmp_path / "page.png", canvas(browser)) > 500
        outside = {
            request for request in browser.requests if request.startswith("http") and shown.address not in request
        }
        assert not outside  # a page for machines without a network
        assert not browser.faults


def _colours(path: Path, part: list[float]) -> int:
    """How many colours part of a picture has: an empty scene has a few."""
    from matplotlib.image import imread

    left, top, width, height = (int(x) for x in part)
    seen = imread(path)[top : top + height : 2, left : left + width : 2, :3]
    return len(np.unique(seen.reshape(-1, 3), axis=0))


@needs_viser
@needs_browser
@in_a_browser
def test_a_recording_plays_in_the_browser(tmp_path: Path) -> None:
    from hqp_rp.compare.play.replay_page import ReplayPage

    loop = PlayLoop(RobotSource("planar4"), load_stack("planar4"), "null_space", beside="damped_least_squares")
    loop.record()
    loop.drag(0, position=[-0.5, 0.9, 0.0])
    for _ in range(200):
        loop.step()
    with running(ReplayPage(loop.stop_recording(), port=0)) as shown, Browser(tmp_path, 1100, 500) as browser:
        browser.open(shown.address)
        browser.wait_for('!!document.querySelector(".hqp-rp-panel") && !!document.querySelector("canvas")')
        seen = until(lambda: shown.step)
        until(lambda: shown.step != seen)
        browser.wait_for('document.querySelector(".hqp-rp-panel").textContent.includes("damped_least_squares")')
        assert not browser.faults
