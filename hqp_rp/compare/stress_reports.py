"""Remake the singularity studies that are kept beside the documentation.

    python -m hqp_rp.compare.stress_reports [--samples N] [FOLDER]

Of each study report.md, its figures and atlas.json are kept.
"""

from __future__ import annotations

import argparse
import pathlib
import shutil
import tempfile
from collections.abc import Sequence

from hqp_rp.compare.stress import stress
from hqp_rp.compare.stress_atlas import NAME as ATLAS

STUDIES = ("sawyer", "planar4")
"""Robots that have a study, each with the library's own stack of that name."""

KEPT = ("report.md", "figures", ATLAS)
SAMPLES = 3000


def remake(folder: pathlib.Path, samples: int = SAMPLES, studies: Sequence[str] = STUDIES) -> list[pathlib.Path]:
    """Make every study anew; the folders written: `folder`/stress-NAME."""
    written = []
    for name in studies:
        target = folder / f"stress-{name}"
        with tempfile.TemporaryDirectory(prefix="hqp_rp-") as temporary:
            made = pathlib.Path(temporary) / name
            stress(name, name, samples=samples, output=made, progress=True)
            target.mkdir(parents=True, exist_ok=True)
            for kept in KEPT:
                _replace(made / kept, target / kept)
        written.append(target)
    return written


def _replace(source: pathlib.Path, target: pathlib.Path) -> None:
    if source.is_dir():
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(source, target)
    else:
        shutil.copyfile(source, target)


def main(arguments: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m hqp_rp.compare.stress_reports", description=__doc__)
    parser.add_argument("folder", nargs="?", type=pathlib.Path, default=pathlib.Path("docs/reports"))
    parser.add_argument("--samples", type=int, default=SAMPLES, help=f"for each study; default {SAMPLES}")
    given = parser.parse_args(arguments)
    for folder in remake(given.folder, given.samples):
        print(folder)


if __name__ == "__main__":
    main()
