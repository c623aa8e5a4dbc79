"""A headless Chromium, driven over its DevTools protocol by the websocket client that viser brings."""

from __future__ import annotations

import base64
import json
import pathlib
import shutil
import subprocess
import time
import urllib.request
from typing import Any

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")

_FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-sync",
    "--use-angle=swiftshader",  # WebGL without a graphics card
    "--enable-unsafe-swiftshader",
    "--remote-debugging-port=0",
)


class Browser:
    """One page in a headless Chromium; a context manager.

    Args:
        folder: where the browser keeps its profile. width, height: of the page, pixels.
    """

    def __init__(self, folder: pathlib.Path, width: int = 1400, height: int = 900) -> None:
        assert CHROMIUM is not None
        self._profile = folder / "profile"
        command = [
            CHROMIUM,
            *_FLAGS,
            f"--user-data-dir={self._profile}",
            f"--window-size={width},{height}",
            "about:blank",
        ]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self._size = width, height
        self._number = 0
        self.requests: list[str] = []
        """Every address that the page asked for."""
        self.faults: list[str] = []
        """What the page's own code threw."""

    def __enter__(self) -> Browser:
        from websockets.sync.client import connect

        self._socket = connect(self._page(), max_size=None, proxy=None)
        self.call("Page.enable")
        self.call("Network.enable")
        self.call("Runtime.enable")
        width, height = self._size
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        return self

    def __exit__(self, *error: object) -> None:
        self._socket.close()
        self._process.terminate()
        self._process.wait(timeout=20)

    def _page(self) -> str:
        """The address of the debugger of the only page."""
        port_file, end = self._profile / "DevToolsActivePort", time.monotonic() + 60.0
        while time.monotonic() < end:
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
        raise TimeoutError("Chromium opened no page within a minute.")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """A command of the DevTools protocol, and its result."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv(timeout=60))
            if message.get("method") == "Network.requestWillBeSent":
                self.requests.append(message["params"]["request"]["url"])
            elif message.get("method") == "Runtime.exceptionThrown":
                self.faults.append(json.dumps(message["params"]["exceptionDetails"])[:500])
            elif message.get("id") == self._number:
                assert "error" not in message, message["error"]
                return dict(message["result"])

    def open(self, address: str) -> None:
        """Go to a page."""
        self.call("Page.navigate", url=address)

    def evaluate(self, expression: str) -> Any:
        """The value of an expression of JavaScript on the page."""
        found = self.call("Runtime.evaluate", expression=expression, returnByValue=True)["result"]
        return found.get("value")

    def wait_for(self, expression: str, seconds: float = 60.0) -> Any:
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

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 15) -> None:
        """Press at `start`, move to `end`, release."""
        self.mouse("moved", *start)
        time.sleep(0.3)  # what is under the mouse is found when a frame is drawn
        self.mouse("pressed", *start, True)
        for k in range(1, steps + 1):
            x, y = (a + (b - a) * k / steps for a, b in zip(start, end, strict=True))
            self.mouse("moved", x, y, True)
            time.sleep(0.05)
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
