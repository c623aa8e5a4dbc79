"""Draws docs/figures/play.png and play_figure.png: `PYTHONPATH=. python docs/figures/play.py`; needs Chromium and viser."""

from __future__ import annotations

import functools
import tempfile
import time
from pathlib import Path

from matplotlib.image import imread

from hqp_rp import get_solver
from hqp_rp.compare.play.show import page_of, save_figure
from hqp_rp.core.damping import ConstantDamping
from tests.compare.play.browser import Browser

HERE = Path(__file__).parent


def wait_for_the_scene(browser: Browser, folder: Path) -> None:
    """Until the scene is drawn, which takes its time without a graphics card."""
    for _ in range(120):
        browser.screenshot(folder / "scene.png")
        picture = imread(folder / "scene.png")
        if picture[200:700, 400:1000, :3].min() < 0.3:
            return
        time.sleep(1.0)
    raise TimeoutError("the scene stays pale.")


def main() -> None:
    page = page_of("sawyer", None, ["null_space", get_solver("null_space", damping=ConstantDamping(0.1))], port=0)
    loop = page.loop
    page.start()
    try:
        with tempfile.TemporaryDirectory() as folder, Browser(Path(folder)) as browser:
            browser.open(page.address)
            browser.wait_for('document.body.textContent.includes("found. A button")')
            wait_for_the_scene(browser, Path(folder))
            assert loop.catalogue is not None
            place = loop.catalogue.of(1)[2]
            loop.record()
            page._changes.put(lambda: loop.drive_to(place))
            time.sleep(1.0)
            while loop.driving:
                time.sleep(0.01)
            time.sleep(0.5)
            start = loop.place(0)[:3]
            for k in range(1, 31):
                page._changes.put(functools.partial(loop.drag, 0, position=start - (0.0, 0.004 * k, 0.0)))
                time.sleep(0.05)
            page._changes.put(lambda: page._show(page._put_gizmos))
            recording = loop.stop_recording()
            page._running.value = False
            time.sleep(10.0)  # until that is drawn
            browser.evaluate('document.querySelectorAll(".mantine-Notification-root").forEach((e) => e.remove())')
            browser.screenshot(HERE / "play.png")
        save_figure(recording, HERE / "play_figure.png")
    finally:
        page.stop()


if __name__ == "__main__":
    main()
