"""The benchmark: statistics, history, who takes part, and what the report must hold. Nothing here asserts a time."""

from __future__ import annotations

import dataclasses
import json
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import hqp_rp
import hqp_rp.compare.bench_entrants as entrants_module
from hqp_rp.compare import bench_extra, bench_measure
from hqp_rp.compare.bench import EVERY_FAMILY, Bench, bench, checked
from hqp_rp.compare.bench_accuracy import Accuracy, judge, references
from hqp_rp.compare.bench_entrants import numpy_cascade, our_entrants, peer_entrants
from hqp_rp.compare.bench_extra import flops
from hqp_rp.compare.bench_families import FAMILIES, family, random_problem
from hqp_rp.compare.bench_floor import FLOOR
from hqp_rp.compare.bench_history import HISTORY, MARGIN, Entry, compared, keep, load_history
from hqp_rp.compare.bench_inside import Inside
from hqp_rp.compare.bench_measure import Asked, Measured, Result, Row, headline_ratios
from hqp_rp.compare.bench_ratios_report import _fault
from hqp_rp.compare.bench_remote import RemoteRunner, arm_urdf
from hqp_rp.compare.bench_report import answer, bench_report
from hqp_rp.compare.bench_steps import step_family, steppers
from hqp_rp.compare.bench_timing import TURN, Ratio, interleaved, ratio, timing
from hqp_rp.compare.command_line import MISUSE, main
from hqp_rp.core.errors import FileError, SettingError, UnknownNameError
from hqp_rp.robot.arms import sawyer
from hqp_rp.robot.model_file import load_robot


@dataclasses.dataclass
class Scripted:
    """A runner whose every call takes `ns`, and that writes its name into a shared log."""

    label: str
    ns: int
    log: list[tuple[str, int, int]]

    def turn(self, first: int, count: int) -> list[int]:
        self.log.append((self.label, first, count))
        return [self.ns] * count


def test_statistics_of_known_times() -> None:
    found = timing("a", np.array([1000] * 98 + [5000, 9000]))
    assert found.calls == 100
    assert found.median == pytest.approx(1e-6)
    assert found.p99 == pytest.approx(np.quantile([1e-6] * 98 + [5e-6, 9e-6], 0.99))
    assert found.parts == pytest.approx([1e-6] * 5)


def test_ratio_and_its_spread() -> None:
    own = timing("own", np.repeat([1000], 50))
    other = timing("other", np.repeat([2000, 2000, 4000, 2000, 2000], 10))
    found = ratio(own, other)
    assert found.value == pytest.approx(2.0)
    assert found.spread == pytest.approx(0.5)  # the parts go from 2 to 4
    assert ratio(other, own).value == pytest.approx(0.5)


def test_runners_take_turns_and_a_slow_one_takes_fewer() -> None:
    log: list[tuple[str, int, int]] = []
    fast, slow = Scripted("fast", 1000, log), Scripted("slow", 10_000_000, log)
    timings = interleaved([fast, slow], calls=10 * TURN, budget=0.2)
    assert [item.calls for item in timings] == [80, 24]  # 0.2 s are 20 calls, three turns
    turns = [entry for entry in log if entry[2] == TURN]
    own = [first for label, first, _ in turns if label == "fast"][-10:]
    assert own == list(range(0, 80, TURN))  # each keeps its own place
    names = [label for label, _, _ in turns]
    assert names[-1] == "slow"  # spread over the run
    assert "fast" in names[names.index("slow", 2) + 1 :]


def entry(values: dict[str, float], *, machine: str = "m", quick: bool = False, spread: float = 0.0) -> Entry:
    ratios = {name: Ratio("own", "other", value, spread) for name, value in values.items()}
    return Entry("2026-01-01T00:00:00+00:00", {"quick": quick}, {"processor": machine}, {"hqp_rp": "1"}, ratios)


def test_history_is_kept_line_by_line(tmp_path: Path) -> None:
    entries = [entry({"a": 2.0}), entry({"a": 3.0}, quick=True)]
    keep(tmp_path, entries)
    assert len((tmp_path / HISTORY).read_text().splitlines()) == 2
    assert load_history(tmp_path) == entries
    with (tmp_path / HISTORY).open("a") as file:
        file.write("{}\n")
    with pytest.raises(FileError, match="line 3: not an entry"):
        load_history(tmp_path)


def test_a_ratio_is_worse_only_beyond_the_margin() -> None:
    before = entry({"a": 10.0, "b": 10.0})
    assert "None of 2 ratios is worse" in compared([before], entry({"a": 10.0 * (1.01 - MARGIN), "b": 20.0}))[0]
    told = compared([before], entry({"a": 10.0 * (0.99 - MARGIN), "b": 10.0}))
    assert len(told) == 1
    assert told[0].startswith("Worse than on 2026-01-01")
    assert "a: from 10 to 7.9 (-21%, margin 20%)" in told[0]
    noisy = entry({"a": 10.0 * (0.99 - MARGIN), "b": 10.0}, spread=0.1)
    assert "None of 2" in compared([before], noisy)[0]


def test_runs_that_are_not_alike_are_not_compared() -> None:
    now = entry({"a": 1.0})
    assert "no earlier run" in compared([], now)[0]
    others = [entry({"a": 10.0}, machine="other"), entry({"a": 10.0}, quick=True)]
    assert "not compared" in compared(others, now)[0]
    alike = entry({"a": 10.0, "gone": 1.0})
    told = compared([*others[:1], alike, *others[1:]], now)
    assert "from 10 to 1" in told[0]
    assert "missing now: gone" in told[1]


@pytest.mark.parametrize("name", FAMILIES)
def test_families_are_what_they_say_and_have_an_answer(name: str) -> None:
    made = family(name, quick=True)
    again = family(name, quick=True)
    assert np.array_equal(made.problems[-1].matrix, again.problems[-1].matrix)
    rows = {"7_3-3": (3, 3), "7_1-5": (1, 5), "7_6-1-7": (6, 1, 7), "30": (6, 6, 3, 12, 30), "100": (15,) * 6}
    expected = rows.get(name, (12, 3, 6, 38) if name.startswith("humanoid") else (3, 3, 7))
    for problem in (made.problems[0], made.problems[-1]):
        assert tuple(np.diff(problem.offsets)) == expected
        if name.startswith("humanoid"):
            assert problem.hard is not None
            assert problem.hard.m == int(name.split("_")[1])
        assert hqp_rp.solve(problem, "hierarchical_active_set").status.ok


def test_neighbours_on_a_path_are_near_and_it_closes() -> None:
    problems = family("7_limits_path").problems
    steps = [np.abs(a.matrix - b.matrix).max() for a, b in zip(problems, problems[1:] + problems[:1], strict=True)]
    assert max(steps) < 0.1


def test_every_solver_takes_part() -> None:
    settings = " ".join(item.settings for item in our_entrants())
    for kind in hqp_rp.all_solvers().values():
        assert kind.__name__ in settings


def test_a_missing_peer_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(entrants_module.importlib.util, "find_spec", lambda name: None)
    found, missing = peer_entrants(["daqp"])
    assert found == []
    assert missing == [
        "daqp is not installed, so it takes no part (pip install daqp, or in an environment of its own and --peer-python PATH)."
    ]


def test_peers_solve_the_problem_that_they_are_given() -> None:
    peers, missing = peer_entrants()
    assert missing == []
    problems = [random_problem(np.random.default_rng(i), 7, (3, 3)) for i in range(2)]
    for peer in peers:
        found = judge(problems, peer.prepare(problems), peer.answer, references(problems))
        assert found.ok, (peer.label, found)
        assert found.distance < 1e-5
    limited = family("7_limits", quick=True).problems[:3]
    accurate = next(peer for peer in peers if peer.label == "DAQP, accurate")
    found = judge(limited, accurate.prepare(limited), accurate.answer, references(limited))
    assert found.ok
    assert found.distance < 1e-6
    numpy_peer = next(peer for peer in peers if peer.label == "numpy SVD cascade")
    assert numpy_peer.refuses(limited[0]) == "It solves equalities only."


def test_the_numpy_cascade_is_the_optimum() -> None:
    problem = random_problem(np.random.default_rng(5), 7, (6, 1, 7))
    x = numpy_cascade([(level.A, level.lower) for level in problem.levels])
    assert x == pytest.approx(hqp_rp.solve(problem, "null_space").x, abs=1e-10)


def test_wrong_answers_and_missing_ones_are_not_certified() -> None:
    problems = [random_problem(np.random.default_rng(i), 7, (3, 3)) for i in range(2)]
    right = hqp_rp.solve(problems[0], "null_space").x
    found = judge(problems, [lambda: right, lambda: None], lambda x: x, references(problems))
    assert (found.asked, found.answered, found.certified, found.ok) == (2, 1, 1, False)
    assert found.fault == "There is no answer."
    wrong = judge(problems[:1], [lambda: np.zeros(7)], lambda x: x, references(problems))
    assert wrong.certified == 0
    assert wrong.error > 0.1
    assert "level 1" in wrong.fault


def test_a_control_step_of_ours_and_of_mink() -> None:
    made = step_family("step_sawyer", quick=True)
    found, missing = steppers(made, ["mink"])
    assert missing == []
    answers = {item.label: item.answer(item.calls[3]()) for item in found}
    x = answers["null space"]
    assert x is not None
    assert x == pytest.approx(answers["active set, cold"], abs=1e-9)
    # Weights in place of priorities: near, and not the same.
    assert answers["mink daqp"] == pytest.approx(answers["null space, mink's tasks"], abs=0.05)
    assert hqp_rp.certify(found[0].problems[3], x).ok


def test_flop_count() -> None:
    assert flops(1, (1,)) == 4.0 + 1.0 + 4.0
    assert (
        flops(7, (3, 3))
        == sum(4 * (7 - j) * (6 - j) for j in range(3)) + 9 + 84 + sum(4 * (4 - j) * (3 - j) for j in range(3)) + 9 + 84
    )
    assert flops(4, (9,)) == flops(4, (9, 5)) - sum(4 * (4 - j) * 5 for j in range(4))  # the later rows are turned too


def test_growth_ends_where_the_flop_count_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_extra, "SIZES", (4, 8))
    curves = bench_extra.growth("unknowns", ["numpy"], calls=8, budget=0.001)
    assert {"null space", "active set, cold", "numpy SVD cascade", "flop count"} <= set(curves)
    assert (FLOOR in curves) == (shutil.which("cc") is not None)
    assert all([at for at, _ in points] == [4.0, 8.0] for points in curves.values())
    assert curves["flop count"][-1] == pytest.approx(curves["null space"][-1])
    assert curves["flop count"][0][1] / curves["flop count"][1][1] == pytest.approx(
        flops(4, (1,) * 3) / flops(8, (2,) * 3)
    )


def test_the_arm_as_urdf_is_the_arm(tmp_path: Path) -> None:
    arm = sawyer()
    path = tmp_path / "sawyer.urdf"
    path.write_text(arm_urdf(arm))
    robot = load_robot(path)
    q = np.linspace(-0.7, 0.9, 7)
    robot.update(q)
    assert robot.pose("tool")[1] == pytest.approx(arm.pose(q)[1], abs=1e-9)
    assert robot.pose("tool")[0] == pytest.approx(arm.pose(q)[0], abs=1e-9)


@pytest.mark.parametrize(("peer", "words"), [("no_such_peer", "KeyError"), ("roboplan", "ModuleNotFoundError")])
def test_a_peer_that_its_interpreter_lacks_is_a_sentence(peer: str, words: str) -> None:
    runner = RemoteRunner(peer, "x", Path(sys.executable), {})
    assert runner.version == ""
    assert f"{peer} takes no part" in runner.error
    assert words in runner.error


def test_instruction_counts_say_why_there_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_extra.shutil, "which", lambda name: None)
    assert bench_extra.instruction_counts(["null space"]) == (
        {},
        "Instruction counts are not available: the program perf is not installed.",
    )


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"families": ["7_3-4"]}, UnknownNameError, "7_3-3"),
        ({"peers": ["minkk"]}, UnknownNameError, "mink"),
        ({"peer_python": ["/no/such/python"]}, SettingError, "does not exist"),
        ({"lexls": "/no/such/checkout"}, SettingError, "give a checkout"),
    ],
)
def test_wrong_input_names_the_remedy(
    arguments: dict[str, Sequence[str]], error: type[Exception], words: str, tmp_path: Path
) -> None:
    with pytest.raises(error, match=words):
        bench(tmp_path / "out", **arguments)
    assert not (tmp_path / "out").exists()


def test_all_families_and_peers_without_a_choice() -> None:
    assert checked(None, None, (), False).families == EVERY_FAMILY
    assert checked(["100", "7_3-3"], ["mink"], (), True) == Asked(("7_3-3", "100"), ("mink",), (), True)


def test_a_folder_with_other_files_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.txt").write_text("kept")
    assert main(["bench", "--family", "7_3-3", "--quick", "--output", str(tmp_path)]) == MISUSE
    assert "holds files that hqp-rp bench did not write" in capsys.readouterr().err


def synthetic() -> Measured:
    def row(label: str, peer: bool, ns: int, certified: int) -> Row:
        accuracy = Accuracy(4, 4, certified, 1e-12 if certified == 4 else 0.3, 1e-13, "" if certified == 4 else "fault")
        return Row(label, peer, f"settings of {label}", timing(label, np.repeat([ns], 20)), accuracy)

    rows = (
        row("null space", False, 2000, 4),
        row("reverse priority", False, 1000, 0),
        row("DAQP, accurate", True, 8000, 4),
        row("DAQP, defaults", True, 500, 0),
    )
    result = Result("7_3-3", "7 joints, 3+3", "A and b normal", rows, {"weighted": "It refuses."})
    return Measured(
        (result,), ("pink is not installed.",), {}, {"levels": {"null space": [(1.0, 1e-6), (2.0, 2e-6)]}},
        (("null_space", 1, 1e6),), {"import": 0.1, "compiler": False, "first solve": 0.4}, {}, "No counts here.",
    )  # fmt: skip


def test_only_certified_solvers_of_ours_get_ratios() -> None:
    found = {(item.label, item.than): item.value for _, item in headline_ratios(synthetic())}
    assert found == {
        ("null space", "DAQP, accurate"): pytest.approx(4.0),
        ("null space", "DAQP, defaults"): pytest.approx(0.25),
    }


def test_what_is_wrong_with_a_peer_is_said() -> None:
    assert _fault(Accuracy(16, 16, 12, 0.25, 0.1, "fault")) == "error 0.25"
    assert _fault(Accuracy(16, 13, 13, 8e-10, 1e-9, "There is no answer.")) == "no answer on 3 of 16"
    assert _fault(Accuracy(16, 13, 12, 0.25, 0.1, "fault")) == "no answer on 3 of 16, error 0.25"


def test_the_answer_compares_certified_with_certified() -> None:
    told = answer(synthetic())
    assert (
        told[0] == "7 joints, 3+3: null space, 2 us, is 4 times as fast as the fastest certified peer, DAQP, accurate."
    )
    assert "without loading the compiler" in told[-1]


def test_the_report_holds_what_it_must(tmp_path: Path) -> None:
    done = Bench(synthetic(), ("Nothing to compare with.",), entry({"a": 1.0}), tmp_path)
    report = bench_report(done)
    titles = [section.title for section in report.sections]
    assert titles[:3] == ["The answer", "Ratios", "Against the last run"]
    groups = report.sections[1].sections
    assert [(group.title, [table.title for table in group.tables]) for group in groups] == [
        ("7 joints", ["7 joints, 3+3"])
    ]
    assert "How cost grows" in titles
    text = repr(report)
    for words in ("Nothing to compare with.", "pink is not installed.", "settings of DAQP, accurate", "It refuses.",
                  "No counts here.", "processor", "fault", "Not certified, so without ratios: reverse priority."):  # fmt: skip
        assert words in text
    assert [chart.name for chart in report.charts()] == ["ratios_7", "growth_levels"]


def test_a_run_writes_report_and_history(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Asked, "budget", property(lambda self: 0.002))
    monkeypatch.setattr(bench_measure, "start_up", lambda runs: {"import": 0.1, "compiler": False, "first solve": 0.2})
    monkeypatch.setattr(bench_measure, "instruction_counts", lambda labels, calls: ({}, "No counts."))
    monkeypatch.setattr(bench_measure, "measure_inside", lambda families, **settings: Inside())
    monkeypatch.setattr(bench_measure, "our_entrants", lambda: [e for e in our_entrants() if e.label == "null space"])
    folder = tmp_path / "bench"
    for runs in (1, 2):
        found = bench(folder, families=["7_3-3"], peers=["numpy"], quick=True, fresh_process=False)
        lines = (folder / HISTORY).read_text().splitlines()
        assert len(lines) == runs
        assert list(json.loads(lines[-1])["ratios"]) == ["7_3-3: null space over numpy SVD cascade"]
    assert "no earlier run" not in found.against[0]
    assert (folder / "report.html").exists()
    assert (folder / "figures" / "ratios_7.png").exists()
    text = (folder / "report.md").read_text()
    assert "numpy SVD cascade" in text
    assert "**hqp" not in text


def test_nested_compile_times_are_each_kernels_own() -> None:
    from hqp_rp.compare.bench_warmup import _own_seconds

    def outer() -> None: ...
    def inner() -> None: ...
    def library() -> None: ...

    outer.__module__ = inner.__module__ = "hqp_rp.core.kernels.fake"
    library.__module__ = "numba.np.linalg"

    @dataclasses.dataclass
    class Dispatcher:
        py_func: object

    @dataclasses.dataclass
    class Event:
        is_start: bool
        function: object

        @property
        def data(self) -> dict[str, object]:
            return {"dispatcher": Dispatcher(self.function)}

    events = [(0.0, Event(True, outer)), (1.0, Event(True, inner)), (2.0, Event(True, library)),
              (4.0, Event(False, library)), (5.0, Event(False, inner)), (10.0, Event(False, outer))]  # fmt: skip
    found = {item.name: item.seconds for item in _own_seconds(events)}
    assert found == {"fake.outer": 6.0, "fake.inner": 4.0}
