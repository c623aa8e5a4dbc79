"""A headless Chromium, driven over its DevTools protocol by the websocket client that viser brings."""

from __future__ import annotations

import base64
import functools
import json
import os
import pathlib
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Callable
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")

_FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-sync",
    "--use-angle=swiftshader",  # WebGL without a graphics card
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",  # where the processor draws anyway, that costs it as much again
    "--remote-debugging-port=0",
)

_PATIENCE = 120.0
"""s, how long a machine that does much else may take for one answer. Nobody waits so long where all goes well."""

_OWN_WORK = 0.05
"""Of the time without an answer: a page that computes for longer is stuck in its own code, as far as a busy machine lets it.
One that waits for its browser to draw was seen to compute for 0.01 of it."""


class BrowserGone(Exception):
    """Chromium itself ended or stopped answering: nothing is said about the page."""


def in_a_browser(test: Callable[..., None]) -> Callable[..., None]:
    """A test that starts a `Browser`: begun anew where that one is gone, and skipped where the second is gone too.

    What the test asserts, and what the page does wrong, fails at the first time.
    """

    @functools.wraps(test)
    def begun_anew(tmp_path: pathlib.Path, **fixtures: Any) -> None:
        reasons = []
        for attempt in ("first", "second"):
            folder = tmp_path / attempt
            folder.mkdir()
            try:
                return test(folder, **fixtures)
            except BrowserGone as gone:
                reasons.append(str(gone))
        pytest.skip(f"Chromium stopped answering twice: {' Then: '.join(reasons)}")

    return pytest.mark.timeout(1200)(begun_anew)


class Browser:
    """One page in a headless Chromium; a context manager.

    Args:
        folder: where the browser keeps its profile. width, height: of the page, pixels.
    """

    def __init__(self, folder: pathlib.Path, width: int = 1400, height: int = 900) -> None:
        assert CHROMIUM is not None
        self._profile = folder / "profile"
        self._log = folder / "chromium.log"
        command = [
            CHROMIUM,
            *_FLAGS,
            f"--user-data-dir={self._profile}",
            f"--window-size={width},{height}",
            "about:blank",
        ]
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=log)
        self._size = width, height
        self._socket: Any = None
        self._number = 0
        self.requests: list[str] = []
        """Every address that the page asked for."""
        self.faults: list[str] = []
        """What the page's own code threw."""

    def __enter__(self) -> Browser:
        try:
            self._attach()
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        self._end()

    def _end(self) -> None:
        if self._socket is not None:
            self._socket.close()
        self._process.terminate()
        try:
            self._process.wait(timeout=20)
        except subprocess.TimeoutExpired:  # it hangs
            self._process.kill()
            self._process.wait()

    def _attach(self) -> None:
        from websockets.sync.client import connect

        page = self._page()
        try:
            self._socket = connect(page, max_size=None, proxy=None, open_timeout=_PATIENCE, ping_interval=None)
        except (OSError, TimeoutError) as error:
            raise self._gone(f"did not take a connection ({error})") from error
        self.call("Inspector.enable")
        self.call("Page.enable")
        self.call("Network.enable")
        self.call("Runtime.enable")
        width, height = self._size
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def _page(self) -> str:
        """The address of the debugger of the only page."""
        port_file, end = self._profile / "DevToolsActivePort", time.monotonic() + _PATIENCE
        while time.monotonic() < end and self._process.poll() is None:
            try:
                port = port_file.read_text().split()[0]
                opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
                with opener.open(f"http://127.0.0.1:{port}/json/list", timeout=5) as answer:
                    pages = [page for page in json.load(answer) if page["type"] == "page"]
                if pages:
                    return str(pages[0]["webSocketDebuggerUrl"])
            except (OSError, IndexError):
                pass
            time.sleep(0.1)
        raise self._gone("opened no page")

    def _gone(self, what: str) -> BrowserGone:
        """What happened, how the process is, and the end of what it said."""
        code = self._process.poll()
        ended = "it runs" if code is None else f"it ended with {code}"
        said = self._log.read_text(errors="replace").strip().splitlines()[-3:]
        return BrowserGone(f"Chromium {what}; {ended}; it said: {' | '.join(said) or 'nothing'}.")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """A command of the DevTools protocol, and its result.

        Raises:
            BrowserGone: no answer. AssertionError: the page is stuck in its own code, or the command was refused.
        """
        from websockets.exceptions import ConnectionClosed

        self._number += 1
        try:
            self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
            try:
                return self._answer(_PATIENCE / 2)
            except TimeoutError:
                begin, before = time.monotonic(), self._work_of_page()
            try:
                return self._answer(_PATIENCE / 2)
            except TimeoutError:
                waited, worked = time.monotonic() - begin, self._work_of_page() - before
        except ConnectionClosed as error:
            raise self._gone(f"closed its connection at {method}") from error
        assert worked < _OWN_WORK * waited, (
            f"the page computed for {worked:.0f} s of {waited:.0f} s and left {method} without an answer"
        )
        raise self._gone(f"did not answer {method} in {_PATIENCE:.0f} s")

    def _answer(self, seconds: float) -> dict[str, Any]:
        """The result of the last command."""
        end = time.monotonic() + seconds
        while True:
            message = json.loads(self._socket.recv(timeout=max(0.0, end - time.monotonic())))
            event = message.get("method")
            if event == "Network.requestWillBeSent":
                self.requests.append(message["params"]["request"]["url"])
            elif event == "Runtime.exceptionThrown":
                self.faults.append(json.dumps(message["params"]["exceptionDetails"])[:500])
            elif event in ("Inspector.targetCrashed", "Inspector.detached"):
                raise self._gone(f"lost its page ({event})")
            elif message.get("id") == self._number:
                assert "error" not in message, message["error"]
                return dict(message["result"])

    def _work_of_page(self) -> float:
        """s of processor time that the threads which run the browser's pages have used; 0 where no /proc tells."""
        parents, ticks = {}, {}
        for folder in pathlib.Path("/proc").glob("[0-9]*"):
            try:
                thread = folder / "task" / folder.name / "stat"  # behind the name: state, parent, ...
                told = thread.read_text().rpartition(")")[2].split()
                parents[int(folder.name)] = int(told[1])
                if "--type=renderer" in (folder / "cmdline").read_text():
                    ticks[int(folder.name)] = int(told[11]) + int(told[12])  # as user and in the system
            except OSError:
                pass  # it ended meanwhile

        def own(process: int) -> bool:
            return process == self._process.pid or (process in parents and own(parents[process]))

        return sum(used for process, used in ticks.items() if own(process)) / float(os.sysconf("SC_CLK_TCK"))

    def open(self, address: str) -> None:
        """Go to a page."""
        self.call("Page.navigate", url=address)

    def evaluate(self, expression: str) -> Any:
        """The value of an expression of JavaScript on the page."""
        found = self.call("Runtime.evaluate", expression=expression, returnByValue=True)["result"]
        return found.get("value")

    def draw(self, frames: int = 2) -> None:
        """Wait until the page has drawn."""
        for _ in range(frames):
            drawn = "new Promise((done) => requestAnimationFrame(() => done(true)))"
            self.call("Runtime.evaluate", expression=drawn, awaitPromise=True, returnByValue=True)

    def wait_for(self, expression: str, seconds: float = _PATIENCE) -> Any:
        """Wait until the expression is truthy, and return it."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            found = self.evaluate(expression)
            if found:
                return found
            time.sleep(0.1)
        raise TimeoutError(f"{expression} stayed {found!r}.")

    def mouse(self, kind: str, x: float, y: float, pressed: bool = False) -> None:
        """A mouse event: moved, pressed or released."""
        name = {"moved": "mouseMoved", "pressed": "mousePressed", "released": "mouseReleased"}[kind]
        button = "none" if kind == "moved" and not pressed else "left"
        self.call(
            "Input.dispatchMouseEvent", type=name, x=x, y=y, button=button, buttons=int(pressed),
            clickCount=int(kind != "moved"),
        )  # fmt: skip

    def click(self, x: float, y: float) -> None:
        """A click there."""
        self.mouse("moved", x, y)
        self.mouse("pressed", x, y, True)
        self.mouse("released", x, y)

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 8) -> None:
        """Press at `start`, move to `end`, release."""
        self.mouse("moved", *start)
        self.draw()  # what is under the mouse is found when a frame is drawn
        self.mouse("pressed", *start, True)
        for k in range(1, steps + 1):
            x, y = (a + (b - a) * k / steps for a, b in zip(start, end, strict=True))
            self.mouse("moved", x, y, True)
            self.draw(1)
        self.mouse("released", *end)

    def click_text(self, text: str) -> None:
        """Click the button that says this."""
        place = self.wait_for(
            f"""(() => {{ for (const b of document.querySelectorAll("button, label, input")) {{
              if ((b.textContent || b.value || "").trim() === {json.dumps(text)}) {{
                b.scrollIntoView({{block: "center"}}); const r = b.getBoundingClientRect();
                if (r.width) return [r.left + r.width / 2, r.top + r.height / 2]; }} }} }})()"""
        )
        self.click(*place)

    def screenshot(self, path: pathlib.Path) -> None:
        """Save a picture of the page."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))
