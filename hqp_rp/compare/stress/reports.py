"""Remake the singularity studies that are kept beside the documentation.

    python -m hqp_rp.compare.stress.reports [NAME ...] [--folder FOLDER]

Without a name, all of them. Of each study report.md, its figures and atlas.json are kept.
"""

from __future__ import annotations

import argparse
import dataclasses
import pathlib
import shutil
import tempfile
from collections.abc import Sequence

from hqp_rp.compare.stress.atlas import NAME as ATLAS
from hqp_rp.compare.stress.stress import CLOSED_FORMS, stress
from hqp_rp.core.paths import user_path

KEPT = ("report.md", "figures", ATLAS)
FOLDER = pathlib.Path("docs/reports")


@dataclasses.dataclass(frozen=True)
class Study:
    """One stress test: model and stack by name, samples, solvers (None: all)."""

    model: str
    stack: str
    samples: int
    solvers: tuple[str, ...] | None = None


STUDIES = {
    "stress-sawyer": Study("sawyer", "sawyer", 1000),
    "stress-sawyer-closed-forms": Study("sawyer", "sawyer", 100_000, (CLOSED_FORMS,)),
    "stress-planar4": Study("planar4", "planar4", 1000),
}
"""Name of the folder -> what is in it."""


def remake(name: str, folder: pathlib.Path = FOLDER, *, progress: bool = False) -> pathlib.Path:
    """Make one study anew; the folder written, `folder`/`name`."""
    study, target = STUDIES[name], folder / name
    with tempfile.TemporaryDirectory(prefix="hqp_rp-") as temporary:
        made = pathlib.Path(temporary) / name
        stress(study.model, study.stack, samples=study.samples, solvers=study.solvers, output=made, progress=progress)
        keep(made, target)
    return target


def keep(made: pathlib.Path, target: pathlib.Path) -> None:
    """Copy what is kept of a report's folder."""
    target.mkdir(parents=True, exist_ok=True)
    for name in KEPT:
        source, copy = made / name, target / name
        if source.is_dir():
            shutil.rmtree(copy, ignore_errors=True)
            shutil.copytree(source, copy)
        else:
            shutil.copyfile(source, copy)


def main(arguments: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m hqp_rp.compare.stress.reports", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(STUDIES)}; default all")
    parser.add_argument("--folder", type=user_path, default=FOLDER)
    given = parser.parse_args(arguments)
    unknown = sorted(set(given.names) - set(STUDIES))
    if unknown:
        parser.error(f"there is no study {', '.join(unknown)}; there are {', '.join(STUDIES)}")
    for name in given.names or STUDIES:
        print(remake(name, given.folder, progress=True))


if __name__ == "__main__":
    main()
