"""What a page is told, it is told in the server's thread; and a scene is light enough for a processor that draws."""

from __future__ import annotations

import concurrent.futures
import importlib.util
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hqp_rp.compare.play import page as play_page
from hqp_rp.compare.play import replay_page
from hqp_rp.compare.play.loop import PlayLoop
from hqp_rp.compare.play.show import page_of
from hqp_rp.compare.play.viser_server import in_server, serve
from hqp_rp.control.stack_file import load_stack
from hqp_rp.robot.robot_source import RobotSource
from tests.compare.play.test_page import change, running, until

pytestmark = pytest.mark.skipif(importlib.util.find_spec("viser") is None, reason="viser is not installed (extra play)")


@pytest.fixture
def server() -> Iterator[Any]:
    made = serve("127.0.0.1", 0, "test")
    yield made
    made.stop()


def test_it_is_done_in_the_thread_of_the_loop_and_answered(server: Any) -> None:
    there = in_server(server, threading.get_ident)
    assert there != threading.get_ident()
    assert in_server(server, lambda: in_server(server, threading.get_ident)) == there  # from within, at once


def test_what_it_raises_is_raised(server: Any) -> None:
    def refused() -> None:
        raise TimeoutError("of its own")

    with pytest.raises(TimeoutError, match="of its own"):
        in_server(server, refused)
    assert in_server(server, lambda: 3) == 3


def test_what_is_raised_within_is_raised_and_the_server_goes_on(server: Any) -> None:
    def refused() -> None:
        raise RuntimeError("of its own")

    with pytest.raises(RuntimeError, match="of its own"):
        in_server(server, lambda: in_server(server, refused))
    assert in_server(server, lambda: 3) == 3


def test_an_answer_that_comes_as_the_wait_ends_is_the_answer(server: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    class Late(concurrent.futures.Future[Any]):
        def result(self, timeout: float | None = None) -> Any:
            found = super().result()
            if timeout is not None:
                raise concurrent.futures.TimeoutError
            return found

    monkeypatch.setattr(concurrent.futures, "Future", Late)
    assert in_server(server, lambda: 3) == 3


def test_a_server_that_was_stopped_says_so() -> None:
    made = serve("127.0.0.1", 0, "test")
    made.stop()
    until(made.get_event_loop().is_closed)
    with pytest.raises(RuntimeError, match="closed"):
        in_server(made, lambda: None)


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, str]]:
    """The thread and the kind of every message that a page of ours tells viser to send."""
    from viser.infra._async_message_buffer import AsyncMessageBuffer

    seen: list[tuple[int, str]] = []
    push: Callable[[Any, Any], None] = AsyncMessageBuffer.push

    def watched(buffer: Any, message: Any) -> None:
        seen.append((threading.get_ident(), type(message).__name__))
        push(buffer, message)

    def served(*arguments: Any) -> Any:
        server = serve(*arguments)  # which begins with messages of its own
        monkeypatch.setattr(AsyncMessageBuffer, "push", watched)
        return server

    monkeypatch.setattr(play_page, "serve", served)
    monkeypatch.setattr(replay_page, "serve", served)
    return seen


def test_a_page_is_told_everything_in_the_thread_of_its_server(told: list[tuple[int, str]], tmp_path: Path) -> None:
    with running(page_of("planar4", None, (), port=0, starts=4, file=str(tmp_path / "run.npz"))) as shown:
        there = in_server(shown._server, threading.get_ident)
        until(lambda: "found" in shown._found.content)
        (solver, damping, _), (ghost, *_) = shown._choices
        change(ghost, "reverse_priority")
        until(lambda: len(shown.loop.arms) == 2)
        change(damping, "by error")
        until(lambda: "levels damped by" in shown.loop.arms[0].label)
        change(solver, "singularity_robust")  # which takes no such damping
        shown._changes.put(shown._recorded)
        until(lambda: shown._record.label == "Stop and save")
        home = shown.loop.arms[0].robot.q
        place = shown.loop.catalogue.of(1)[0]
        shown._changes.put(lambda: shown.loop.drive_to(place))
        until(lambda: abs(shown.loop.arms[0].robot.q - home).max() > 0.1 and not shown.loop.driving)
        shown._changes.put(shown._recorded)
        until(lambda: (tmp_path / "run.npz").exists())
        change(ghost, "nobody")
        until(lambda: len(shown.loop.arms) == 1)
    assert {"SetPositionMessage", "GuiUpdateMessage", "GuiButtonGroupMessage", "MeshMessage"} <= {k for _, k in told}
    assert {kind for thread, kind in told if thread != there} == set()


def test_a_replay_is_told_everything_in_the_thread_of_its_server(told: list[tuple[int, str]]) -> None:
    loop = PlayLoop(RobotSource("planar4"), load_stack("planar4"), "null_space")
    loop.record()
    for _ in range(20):
        loop.step()
    with running(replay_page.ReplayPage(loop.stop_recording(), port=0)) as shown:
        there = in_server(shown._server, threading.get_ident)
        until(lambda: any(kind == "GuiUpdateMessage" for _, kind in told))
    assert {kind for thread, kind in told if thread != there} == set()


def test_a_scene_has_neither_a_photograph_nor_shadows(
    told: list[tuple[int, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Drawn by a processor, they cost more than all the rest, and the page answers nothing meanwhile."""
    from viser import _messages

    sent: dict[str, Any] = {}
    for kind in (_messages.EnvironmentMapMessage, _messages.EnableLightsMessage):
        made = kind.__init__

        def kept(self: Any, *arguments: Any, _made: Any = made, **more: Any) -> None:
            _made(self, *arguments, **more)
            sent[type(self).__name__] = self

        monkeypatch.setattr(kind, "__init__", kept)
    with running(page_of("planar4", None, (), port=0, starts=0)):
        pass
    assert sent["EnvironmentMapMessage"].hdri_data is None
    assert sent["EnableLightsMessage"].enabled
    assert not sent["EnableLightsMessage"].cast_shadow
    assert "HemisphereLightMessage" in {kind for _, kind in told}
