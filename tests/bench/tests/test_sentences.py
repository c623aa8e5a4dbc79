"""The benchmark's sentences: code and template name the same ones."""

from __future__ import annotations

import re

from hqp_rp.compare.report.sentences import Sentences
from tests.bench import ROOT

BENCH = ROOT / "tests" / "bench"


def test_code_and_template_name_the_same_sentences() -> None:
    sources = "".join(path.read_text() for path in sorted(BENCH.glob("*.py")))
    asked = set(re.findall(r"\bsay\(\s*\"(\w+)\"", sources))
    there = {name for name in Sentences(str(BENCH / "report.py")).names() if not name.startswith("_")}
    assert asked
    assert asked == there, f"unasked {sorted(there - asked)}, unwritten {sorted(asked - there)}"
