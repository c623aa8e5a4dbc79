"""The type stub of the native core is what nanobind makes of it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

CORE = Path(__file__).parents[2] / "hqp_rp" / "core"


def test_the_stub_is_up_to_date(tmp_path: Path) -> None:
    patterns, made = CORE / "native" / "bindings" / "stub_patterns.txt", tmp_path / "_native.pyi"
    command = [
        sys.executable,
        "-m",
        "nanobind.stubgen",
        "-m",
        "hqp_rp.core._native",
        "-p",
        str(patterns),
        "-o",
        str(made),
    ]
    done = subprocess.run(command, cwd=CORE.parents[1], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert made.read_text(encoding="utf-8") == (CORE / "_native.pyi").read_text(encoding="utf-8"), " ".join(command)
