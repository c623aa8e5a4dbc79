"""Who is to blame where a browser does not answer: the browser, which is started anew, or the page, which fails."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.compare.play import browser as module
from tests.compare.play.browser import CHROMIUM, Browser, BrowserGone, in_a_browser

needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here to open the page in")


def ending(*ends: Exception | None) -> tuple[Callable[..., None], list[Path]]:
    """A test that ends in these ways, one after the other, and the folders that it was given."""
    begun: list[Path] = []

    @in_a_browser
    def test(tmp_path: Path) -> None:
        begun.append(tmp_path)
        end = ends[len(begun) - 1]
        if end is not None:
            raise end

    return test, begun


def test_a_browser_that_is_gone_is_started_anew_once(tmp_path: Path) -> None:
    test, begun = ending(BrowserGone("hung."), None)
    test(tmp_path)
    assert len(set(begun)) == 2
    assert all(folder.is_dir() for folder in begun)


def test_two_that_are_gone_are_told_of(tmp_path: Path) -> None:
    test, begun = ending(BrowserGone("It hung."), BrowserGone("It crashed."), None)
    with pytest.raises(pytest.skip.Exception, match=r"stopped answering twice: It hung\. Then: It crashed\."):
        test(tmp_path)
    assert len(begun) == 2


@pytest.mark.parametrize("fault", [AssertionError("wrong"), TimeoutError("it stayed None"), ValueError("wrong")])
def test_what_the_page_does_wrong_fails_at_once(tmp_path: Path, fault: Exception) -> None:
    test, begun = ending(fault, None)
    with pytest.raises(type(fault)):
        test(tmp_path)
    assert len(begun) == 1


def test_what_the_page_does_wrong_in_the_second_browser_fails(tmp_path: Path) -> None:
    test, _ = ending(BrowserGone("hung."), AssertionError("wrong"))
    with pytest.raises(AssertionError, match="wrong"):
        test(tmp_path)


@needs_browser
@in_a_browser
def test_a_chromium_that_ends_is_gone(tmp_path: Path) -> None:
    with Browser(tmp_path, 300, 200) as browser:
        assert browser.evaluate("1 + 1") == 2
        browser._process.kill()
        browser._process.wait()
        with pytest.raises(BrowserGone, match="ended with -9"):
            browser.evaluate("1 + 1")


@needs_browser
@in_a_browser
def test_a_page_that_crashes_its_renderer_is_told_of(tmp_path: Path) -> None:
    with Browser(tmp_path, 300, 200) as browser, pytest.raises(BrowserGone, match="lost its page"):
        browser.call("Page.crash")


@needs_browser
@in_a_browser
def test_who_keeps_a_page_from_answering(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with Browser(tmp_path, 300, 200) as browser:
        assert browser.evaluate("1 + 1") == 2
        monkeypatch.setattr(module, "_PATIENCE", 10.0)
        with pytest.raises(BrowserGone, match=r"did not answer Runtime\.evaluate in 10 s; it runs"):
            browser.call("Runtime.evaluate", expression="new Promise(() => {})", awaitPromise=True)
        with pytest.raises(AssertionError, match="the page computed for"):
            browser.evaluate("for (;;) {}")
