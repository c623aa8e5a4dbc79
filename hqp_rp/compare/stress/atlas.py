"""The atlas of a stress test as a file: found once, read again when the test goes on."""

from __future__ import annotations

import dataclasses
import json
import pathlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from hqp_rp.compare.run_folder import write_atomically
from hqp_rp.control.singularities import SingularConfiguration
from hqp_rp.core.diagnostics import Singularity
from hqp_rp.core.errors import FileError

NAME = "atlas.json"


def save_atlas(places: Sequence[SingularConfiguration], path: pathlib.Path) -> None:
    """Write the places as JSON; every float comes back to the last bit."""
    content = {"format": "hqp_rp atlas", "places": [_plain(place) for place in places]}
    write_atomically(path, (json.dumps(content, indent=1) + "\n").encode())


def load_atlas(path: pathlib.Path) -> tuple[SingularConfiguration, ...]:
    """The places of a file that `save_atlas` wrote. Raises `FileError` when it is no such file."""
    try:
        content = json.loads(path.read_text())
        if content["format"] != "hqp_rp atlas":
            raise ValueError(f"its format is {content['format']!r}")
        return tuple(_place(entry) for entry in content["places"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FileError(f"{path}: not a readable atlas ({error}); delete it and run the command again.") from error


def _plain(place: SingularConfiguration) -> dict[str, Any]:
    values = {field.name: getattr(place, field.name) for field in dataclasses.fields(place)}
    plain = {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values.items()}
    return plain | {"kind": place.kind.name}


def _place(entry: dict[str, Any]) -> SingularConfiguration:
    values: dict[str, Any] = {
        name: np.array(value, dtype=np.float64) if isinstance(value, list) else value for name, value in entry.items()
    }
    values["kind"] = Singularity[entry["kind"]]
    return SingularConfiguration(**values)
