"""docs/reports/peers: the judge, the way a worker is asked, and the kept page."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hqp_rp
from hqp_rp import problems

FOLDER = Path(__file__).parents[2] / "docs" / "reports" / "peers"
STRICT = "sawyer/3-3-7_q0"


@pytest.fixture(autouse=True)
def _beside_the_page(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The page's modules import each other by their bare names, as scripts do."""
    monkeypatch.syspath_prepend(str(FOLDER))
    before = set(sys.modules)
    yield
    for name in set(sys.modules) - before:
        if str(FOLDER) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


def _verdict(name: str, **reply: Any) -> dict[str, Any]:
    found: dict[str, Any] = importlib.import_module("judge").verdict(problems.load(name), reply)
    return found


def _known(name: str) -> Any:
    known = problems.load(name)
    assert known.exact is not None
    return known


def test_every_known_answer_is_right() -> None:
    for name in problems.names():
        known = problems.load(name)
        for answer in known.answers:
            found = _verdict(name, x=answer.x.tolist(), success=True, said="")
            assert found["verdict"] == "right", name


def test_a_wrong_answer_called_a_success_is_wrong_and_one_that_is_not_is_refused() -> None:
    x = _known(STRICT).exact.x + 1e-4
    assert _verdict(STRICT, x=x.tolist(), success=True, said="done")["verdict"] == "wrong"
    assert _verdict(STRICT, x=x.tolist(), success=False, said="inaccurate")["verdict"] == "refused"
    assert _verdict(STRICT, x=None, success=True, said="done")["verdict"] == "refused"
    assert _verdict(STRICT, ended="the process ended (code -6)") == {
        "verdict": "refused",
        "said": "the process ended (code -6)",
    }
    assert _verdict(STRICT, cannot="too many levels") == {"verdict": "cannot", "said": "too many levels"}


def test_how_near_a_right_answer_is() -> None:
    x = _known(STRICT).exact.x
    tight, near, loose = (
        _verdict(STRICT, x=(x * (1 + off)).tolist(), success=True, said="") for off in (0, 1e-7, 1e-4)
    )
    assert (tight["verdict"], tight["tight"]) == ("right", True)
    assert (near["verdict"], near["tight"]) == ("right", False)
    assert (loose["verdict"], loose["loose"]) == ("wrong", True)


def test_contradicting_hard_rows_want_no_success() -> None:
    name = "infeasible/n7_3-3_1p-01"
    zero = np.zeros(problems.load(name).problem.n).tolist()
    assert _verdict(name, x=None, success=False, said="infeasible")["verdict"] == "right"
    assert _verdict(name, x=zero, success=True, said="done")["verdict"] == "wrong"


@pytest.mark.parametrize("ratio", [1e2, 1e3])
def test_a_weighted_optimum_is_what_was_promised(ratio: float) -> None:
    problem = _known(STRICT).problem
    weights = [ratio, 1.0, 1.0 / ratio]
    rows = np.vstack([w * level.A for w, level in zip(weights, problem.levels, strict=True)])
    aims = np.concatenate([w * level.lower for w, level in zip(weights, problem.levels, strict=True)])
    x = np.linalg.lstsq(rows, aims, rcond=None)[0]
    promise = {"strict": 0, "weights": weights}
    # By the square, as a QP has it, whose rounding and tolerance are those of the heavy rows.
    squared = np.linalg.solve(rows.T @ rows, rows.T @ aims)
    for answer in (x, squared):
        kept = _verdict(STRICT, x=answer.tolist(), success=True, said="", promise=promise)
        assert (kept["verdict"], kept["kept"]) == ("wrong", True)
    other = _verdict(STRICT, x=(1.01 * x).tolist(), success=True, said="", promise=promise)
    assert (other["verdict"], other["kept"]) == ("wrong", False)


def test_a_scaled_level_is_what_was_promised() -> None:
    problem = _known(STRICT).problem
    scales = [1.0, 0.5, 0.25]
    levels = [
        hqp_rp.Level.equality(level.A, scale * level.lower) for scale, level in zip(scales, problem.levels, strict=True)
    ]
    x = hqp_rp.solve(hqp_rp.Problem(levels), "null_space").require()
    for told, kept in ((scales, True), ([1.0, 1.0, 0.25], False)):
        found = _verdict(STRICT, x=x.tolist(), success=True, said="", promise={"scales": told})
        assert (found["verdict"], found["kept"]) == ("wrong", kept)


def test_rows_of_length_one_are_what_was_promised() -> None:
    name = "over_constrained/n4_6-3_s0"
    problem = _known(name).problem
    lengths = [np.linalg.norm(level.A, axis=1) for level in problem.levels]
    levels = [
        hqp_rp.Level.equality(level.A / size[:, None], level.lower / size)
        for size, level in zip(lengths, problem.levels, strict=True)
    ]
    x = hqp_rp.solve(hqp_rp.Problem(levels), "null_space").require()
    found = _verdict(name, x=x.tolist(), success=True, said="", promise={"unit_rows": True})
    assert (found["verdict"], found["kept"]) == ("wrong", True)


@pytest.mark.parametrize(
    ("worker", "variant"), [("hqp_rp_worker.py", "active set"), ("daqp_worker.py", "soft weights")]
)
def test_a_worker_answers_and_times_itself(worker: str, variant: str) -> None:
    process = importlib.import_module("process").Process(Path(sys.executable), worker)
    try:
        assert variant in process.ask({"about": 1})["variants"]
        path = str(problems.path(STRICT))
        reply = process.ask({"solve": path, "variant": variant})
        assert _verdict(STRICT, **reply)["verdict"] == "right"
        assert len(process.ask({"time": [path], "variant": variant, "calls": 3})["times"]) == 3
        assert "KeyError" in process.ask({"solve": path})["error"]
    finally:
        process.close()


def test_a_worker_that_dies_is_started_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mortal.py").write_text(
        "import json\nif 'die' in input():\n    raise SystemExit(3)\nprint(json.dumps({'alive': True}), flush=True)\n"
        "import time; time.sleep(60)\n",
        encoding="utf-8",
    )
    module = importlib.import_module("process")
    monkeypatch.setattr(module, "WORKERS", tmp_path)
    process = module.Process(Path(sys.executable), "mortal.py")
    try:
        assert process.ask({"die": 1}) == {"ended": "the process ended (code 3)"}
        assert process.ask({"live": 1}) == {"alive": True}
        assert process.ask({"more": 1}, seconds=0.2) == {"ended": "no answer within 0.2 s"}
    finally:
        process.close()


def test_a_control_step_is_the_stack_s_own_problem() -> None:
    given, wanted = importlib.import_module("arm").asked()
    process = importlib.import_module("process").Process(Path(sys.executable), "hqp_rp_worker.py")
    try:
        assert process.ask({"step": given}, seconds=120.0) == {"ready": True}
        v = process.ask({"velocity": 5})["v"]
    finally:
        process.close()
    assert hqp_rp.certify(wanted["plain"][5], v).ok
    assert not hqp_rp.certify(wanted["plain"][6], v).ok


def test_the_kept_page_is_written_from_its_run(tmp_path: Path) -> None:
    run = json.loads((FOLDER / "run.json").read_text(encoding="utf-8"))
    importlib.import_module("page").write(run, tmp_path)
    assert (tmp_path / "report.md").read_text(encoding="utf-8") == (FOLDER / "report.md").read_text(encoding="utf-8")
    assert (tmp_path / "figure.png").stat().st_size > 10_000
    assert set(run["families"]) <= set(problems.names())  # a published problem stays
