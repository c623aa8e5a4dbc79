"""The server of a page, with what can go wrong before it stands said in a sentence."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import socket
from typing import Any

from hqp_rp.core.errors import MissingExtraError, SettingError


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
    import viser

    with contextlib.redirect_stdout(io.StringIO()):  # its banner: the address is ours to tell
        return viser.ViserServer(host=host, port=port, label=label, verbose=False)


def require_viser(what: str) -> None:
    """Raises `MissingExtraError` where viser is not installed; `what` needs it, as the beginning of a sentence."""
    if importlib.util.find_spec("viser") is None:
        raise MissingExtraError(f'{what} needs viser, which is not installed: pip install "hqp-rp[play]"')
