"""The server of a page and its two panels, with what can go wrong before it stands said in a sentence."""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import importlib
import io
import socket
from collections.abc import Callable
from typing import Any, TypeVar

from hqp_rp.core.errors import SettingError
from hqp_rp.core.extras import require

_WIDTH = 340  # pixels
_Answer = TypeVar("_Answer")


def serve(host: str, port: int, label: str) -> Any:
    """A `viser.ViserServer` at this address.

    Args:
        port: 0 takes any that is free. label: the page's title.

    Raises:
        MissingExtraError: viser is not installed.
        SettingError: a port that is taken or not allowed.
    """
    require_viser("The page")
    if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port < 65536:
        raise SettingError(f"port is {port!r}; it must be an integer from 0 (any that is free) to 65535.")
    try:
        with socket.socket() as trial:  # viser would take another one without a word
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            trial.bind((host, port))
            port = trial.getsockname()[1]
    except OSError as error:
        raise SettingError(
            f"port is {port}, which cannot be had at {host} ({error.strerror or error}); give another, or 0 for any."
        ) from None
    viser = importlib.import_module("viser")
    with contextlib.redirect_stdout(io.StringIO()):  # its banner: the address is ours to tell
        return viser.ViserServer(host=host, port=port, label=label, verbose=False)


def in_server(server: Any, what: Callable[[], _Answer]) -> _Answer:
    """Do this in the thread of the server's event loop; what it returns or raises.

    All that a page is told goes this way. viser wakes its senders by `asyncio.Event.set`, from whatever thread sets a
    value, and other threads than the loop's may not: where a sender begins or ends its wait at that moment, the one who told
    gets "deque mutated during iteration".

    Raises:
        RuntimeError: the server was stopped.
    """
    loop: asyncio.AbstractEventLoop = server.get_event_loop()
    if _is_running_here(loop):
        return what()
    answer: concurrent.futures.Future[_Answer] = concurrent.futures.Future()

    def do() -> None:
        try:
            answer.set_result(what())
        except BaseException as error:
            answer.set_exception(error)

    loop.call_soon_threadsafe(do)
    while True:
        try:
            return answer.result(timeout=1.0)
        except concurrent.futures.TimeoutError:
            if answer.done():  # in that moment, or a TimeoutError of its own
                return answer.result()
            if loop.is_closed():
                raise RuntimeError("The page's server was stopped.") from None


def _is_running_here(loop: asyncio.AbstractEventLoop) -> bool:
    try:
        return asyncio.get_running_loop() is loop
    except RuntimeError:  # a thread without a loop
        return False


def told_on_the_left(gui: Any, title: str) -> Any:
    """A tab in a panel at the left edge of the page; viser's own panel goes to the right edge.

    Args:
        gui: `server.gui`. title: of the tab.
    """
    gui.configure_theme(show_share_button=False, show_logo=False)
    gui.main_panel.dock_right()
    told = gui.add_panel()
    told.dock_left()
    told.set_width(_WIDTH)
    return told.add_tab(title)


def require_viser(what: str) -> None:
    """Raises `MissingExtraError` where viser is not installed; `what` needs it, as the beginning of a sentence."""
    require(what, "viser")
