"""Stress tests: which samples are drawn, how answers are judged, what is counted, and every wrong input named."""

from __future__ import annotations

import dataclasses
import functools
import pathlib
import re
from typing import Any

import numpy as np
import polars as pl
import pytest

import hqp_rp
from hqp_rp.compare.command_line import main
from hqp_rp.compare.contestants import choose_contestants
from hqp_rp.compare.stress.atlas import load_atlas, save_atlas
from hqp_rp.compare.stress.judge import REFERENCES, along_paths, level_errors, references
from hqp_rp.compare.stress.plan import APPROACH, FAR, LIMITS, NEAR, RANDOM, STEPS, Plan, Scene, approachable
from hqp_rp.compare.stress.rows import chunk_rows
from hqp_rp.compare.stress.stress import Stress, _contestants, stress
from hqp_rp.compare.stress.subject import subject_of
from hqp_rp.compare.stress.summary import BINS, quantile, sigma_bins, sigma_of_bins, value_bins
from hqp_rp.compare.stress.worst import spelled
from hqp_rp.control.catalogue import find_singularities
from hqp_rp.control.stack_file import load_stack
from hqp_rp.core import truth_active_set
from hqp_rp.core.diagnostics import spectra
from hqp_rp.core.errors import FileError, HqpError, RobotError, SettingError, UnknownNameError
from hqp_rp.core.solver import RANK_TOLERANCE
from hqp_rp.robot.named import named_robot
from tests.compare.small import CORRIDOR

SOLVERS = ("null_space", "singularity_robust")


def small_plan(samples: int = 270, seed: int = 0, stack: str = "planar4", solvers: tuple[str, ...] = SOLVERS) -> Plan:
    file = load_stack(stack)
    robot = named_robot(stack.removesuffix("_limits"))
    built = file.stack(robot)
    places = find_singularities(robot, built, starts=6, dt=file.dt).places
    plan = Plan(subject_of(stack.removesuffix("_limits"), file), choose_contestants(solvers), samples, seed, places)
    return dataclasses.replace(plan, places=approachable(plan.scene(), places))


@pytest.fixture(scope="module")
def plan() -> Plan:
    return small_plan()


@pytest.fixture(scope="module")
def test(tmp_path_factory: pytest.TempPathFactory) -> Stress:
    folder = tmp_path_factory.mktemp("stress") / "report"
    return stress("planar4", "planar4", samples=270, solvers=SOLVERS, starts=6, output=folder, workers=1)


def test_the_samples_add_up(plan: Plan) -> None:
    assert plan.counts == {RANDOM: 90, LIMITS: 90, APPROACH: 2 * STEPS}
    numbers = [chunk.first + i for chunk in plan.chunks for i in range(chunk.count)]
    assert numbers == list(range(270))
    for samples in (1, STEPS - 1, STEPS, 100, 12345, 1_000_000):
        other = dataclasses.replace(plan, samples=samples)
        assert sum(other.counts.values()) == sum(chunk.count for chunk in other.chunks) == samples
        assert max(chunk.count for chunk in other.chunks) <= 1024


def test_paths_lead_to_every_level_and_kind_in_turn(plan: Plan) -> None:
    kinds = [(plan.places[i].level, plan.places[i].kind) for i in plan.order]
    assert len(set(kinds[:2])) == len(set(kinds)) == 2
    chunk = next(chunk for chunk in plan.chunks if chunk.kind == APPROACH)
    samples = plan.samples_of(chunk)
    for first in range(0, chunk.count, STEPS):
        own = slice(first, first + STEPS)
        sigma = samples.sigma[own]
        assert (np.diff(sigma) < 0.0).all()
        assert FAR * 1.01 >= sigma[0] > 1e-3
        assert sigma[-1] == pytest.approx(NEAR, rel=0.02)
        place = plan.places[int(samples.place[first])]
        for q, value in zip(samples.q[own][::7], sigma[::7], strict=True):
            problem = plan.scene().problem(q)
            size = float(np.linalg.norm(problem.levels[place.level].A, 2))
            assert spectra(problem, 1e-14)[place.level].sigma_min / size == pytest.approx(value, rel=0.02, abs=1e-14)


def test_samples_near_the_limits_are_near_them(plan: Plan) -> None:
    chunk = next(chunk for chunk in plan.chunks if chunk.kind == LIMITS)
    q = plan.samples_of(chunk).q
    distance = np.minimum(q + np.pi, np.pi - q) / (2.0 * np.pi)
    assert (distance >= 0.0).all()
    assert (distance.min(axis=1) <= 0.1).all()
    assert distance.min() < 1e-6
    assert 0.3 < (distance <= 0.1).mean() < 0.9


def test_rows_depend_on_the_seed_and_on_nothing_else(plan: Plan) -> None:
    for index in (0, len(plan.chunks) - 1):
        rows = chunk_rows(plan, index).drop("time")
        assert rows.equals(chunk_rows(small_plan(), index).drop("time"))
    # The first two paths of a place follow its own direction; what is drawn depends on the seed.
    first = chunk_rows(plan, 0).drop("time")
    assert not first.equals(chunk_rows(small_plan(seed=1), 0).drop("time"))


def test_answers_are_judged_against_the_truth(plan: Plan) -> None:
    for index in (0, len(plan.chunks) - 1):
        samples, rows = plan.samples_of(plan.chunks[index]), chunk_rows(plan, index)
        rows = rows.filter(pl.col("contestant") == "singularity robust")
        for i in range(0, plan.chunks[index].count, 11):
            problem, row = samples.problems[i], rows.row(i, named=True)
            truth = hqp_rp.truth(problem, rank_rule=RANK_TOLERANCE)
            x = hqp_rp.solve(problem, "singularity_robust").x
            assert x is not None
            assert truth.x is not None
            assert row["ambiguous"] == truth.ambiguous
            apart = float(np.linalg.norm(x - truth.x) / (1.0 + np.linalg.norm(truth.x)))
            assert row["distance"] == pytest.approx(apart, rel=1e-6, abs=1e-9)
            assert row["optimum_norm"] == pytest.approx(float(np.linalg.norm(truth.x)), rel=1e-9)
            assert row["x_norm"] == pytest.approx(float(np.linalg.norm(x)), rel=1e-9)
            certificate = hqp_rp.certify(problem, x)
            for k, level in enumerate(certificate.levels):
                proven = max(level.excess - level.uncertainty, 0.0) / level.scale
                assert row[f"error_{k + 1}"] == pytest.approx(proven, rel=1e-3, abs=1e-9)


def test_a_wrong_answer_shows_at_its_level(plan: Plan) -> None:
    samples = plan.samples_of(plan.chunks[0])
    found = references(samples)
    right = level_errors(samples.problems, found, found.x)
    assert np.nanmax(right) < 1e-13
    for level in range(2):
        wrong = found.x.copy()
        for i, problem in enumerate(samples.problems):
            Z = np.eye(4) if level == 0 else np.linalg.svd(problem.levels[0].A)[2][2:].T
            wrong[i] += 0.01 * Z @ np.linalg.pinv(problem.levels[level].A @ Z) @ np.ones(problem.levels[level].m)
        errors = level_errors(samples.problems, found, wrong)
        assert (errors[:, level] > 1e-5).all()
        assert (errors[:, :level] < 1e-12).all()


def test_with_limits_the_certificate_judges(tmp_path: pathlib.Path) -> None:
    found = stress(
        "sawyer", "sawyer_limits", samples=90, solvers=["hierarchical_active_set", "null_space"], starts=2, workers=1,
        output=tmp_path / "limits",
    )  # fmt: skip
    assert [label for label, _ in found.left_out] == [item.label for item in choose_contestants(["null_space"])]
    rows = found.rows().collect()
    assert set(rows["reference"]) <= {"certificate", "exact"}
    assert rows.height == 90
    clear = rows.filter((pl.col("sigma") > 1e-6) & (pl.col("status") == "SOLVED"))
    assert clear.height >= 30
    assert clear.select(pl.max_horizontal(pl.col("^error_.*$")).max()).item() < 1e-9
    exact = clear.filter((pl.col("reference") == "exact") & ~pl.col("ambiguous"))
    assert exact.height >= 2
    assert exact["distance"].max() < 1e-6


@pytest.mark.parametrize("solvers", [None, ["closed_forms"], ["closed_forms", "reverse_priority_unilateral"]])
@pytest.mark.parametrize("stack", ["planar4", "sawyer_limits"])
def test_solvers_that_only_limits_set_apart_need_limits_or_their_name(stack: str, solvers: list[str] | None) -> None:
    file = load_stack(stack)
    robot = named_robot(stack.removesuffix("_limits"))
    scene = Scene(robot, file.stack(robot), file.dt)
    names = [contestant.name for contestant in _contestants(solvers, limits=not scene.plain)]
    limited = stack == "sawyer_limits"
    assert names.count("reverse_priority_unilateral") == int(limited or (solvers is not None and len(solvers) == 2))
    assert ("saturation_null_space" in names) == (limited and solvers is None)
    assert {"reverse_priority", "null_space", "singularity_robust"} <= set(names)


def test_an_exact_search_that_takes_too_long_leaves_the_sample_to_the_certificate(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plan = small_plan(stack="sawyer_limits", samples=40, solvers=("hierarchical_active_set",))
    samples = plan.samples_of(plan.chunks[0])
    whole = references(samples)
    known = np.isfinite(whole.x[:, 0])
    assert known.sum() >= 1
    # From nothing it takes more than two working sets; from an answer one, or two where a bound is met but for its last bit.
    monkeypatch.setattr(
        "hqp_rp.core.truth_active_set.solve_active_set", functools.partial(truth_active_set.solve_active_set, limit=2)
    )
    cut = references(samples)
    assert {REFERENCES[code] for code in cut.method} == {"certificate"}
    assert np.isnan(cut.x).all()
    assert not cut.ambiguous.any()
    # The column says so; and a solver's certified answer makes the search short.
    rows = chunk_rows(plan, 0)
    assert rows.height == len(samples.q)
    helped = (rows["reference"] == "exact").to_numpy()
    np.testing.assert_array_equal(helped, known)
    np.testing.assert_allclose(
        rows["optimum_norm"].to_numpy()[helped], np.linalg.norm(whole.x[helped], axis=1), rtol=1e-9
    )


def test_limits_that_hold_a_robot_at_rest_are_said() -> None:
    robot = named_robot("planar4")
    robot.update(robot.neutral)
    levels = [hqp_rp.PositionTask("tool", robot.pose("tool")[1], axes="xy"), hqp_rp.PostureTask(robot.neutral)]

    def held(dt: float, **limit: Any) -> str:
        stack = hqp_rp.Stack(levels, [hqp_rp.JointLimit(velocity=1.0, **limit)])
        return Scene(robot, stack, dt).held_at_rest()

    assert held(0.001) == held(0.1, acceleration=5.0) == held(0.1, jerk=50.0) == ""
    assert "come to 0.005 rad/s or m/s at most within dt = 0.001 s" in held(0.001, acceleration=5.0)
    assert "come to 0.002" in held(0.01, acceleration=50.0, jerk=20.0)
    soft = hqp_rp.Stack([hqp_rp.JointLimit(acceleration=5.0), *levels])
    with pytest.warns(UserWarning, match="'joint limits' lets joints come to 0.005"):
        found = stress(robot, soft, dt=0.001, samples=4, solvers=["hierarchical_active_set"], starts=1, workers=1)
    assert found.answer[0].startswith("Every sample is at rest, and 'joint limits'")


def test_a_jump_is_told_from_growth(plan: Plan) -> None:
    samples = plan.samples_of(plan.chunks[-1])
    sigma = sigma_of_bins()
    for power in (1.0, 2.0):
        x = np.tile((1.0 / sigma[:, None]) ** power * np.ones(4), (len(samples.q) // STEPS, 1))
        assert not along_paths(samples, x)[1].any()
    x[STEPS // 2] *= -1.0
    lipschitz, jump, known = along_paths(samples, x)
    assert np.flatnonzero(jump).tolist() == [STEPS // 2, STEPS // 2 + 1]
    assert known[STEPS // 2]
    apart = np.linalg.norm(x[5] - x[4]) / np.linalg.norm(samples.q[5] - samples.q[4])
    assert lipschitz[5] == pytest.approx(apart)
    assert np.isnan(lipschitz[0])


def test_histograms_give_quantiles_to_half_a_bin() -> None:
    rng = np.random.default_rng(0)
    values = 10.0 ** rng.uniform(-12.0, 5.0, 5001)
    counts = np.bincount(value_bins(values), minlength=BINS)
    for share in (0.1, 0.5, 0.9):
        assert float(quantile(counts, share)) == pytest.approx(np.quantile(values, share), rel=0.2)
    assert np.isnan(quantile(np.zeros(BINS, dtype=np.int64), 0.5))
    np.testing.assert_array_equal(sigma_bins(sigma_of_bins() * 1.05), np.arange(STEPS))


def test_the_summary_counts_what_the_rows_say(test: Stress) -> None:
    rows, summary = test.rows().collect(), test.summary
    assert rows.height == 270 * len(summary.labels)
    for k, label in enumerate(summary.labels):
        own = rows.filter(pl.col("contestant") == label)
        assert summary.status[k].sum() == 270
        assert int(summary.jumps[:, k].sum()) == own["jump"].sum()
        clear = own.filter(~pl.col("ambiguous") & pl.col("distance").is_not_null())
        assert summary.right[k].sum() == clear.filter(pl.col("distance") <= 1e-6).height
        assert summary.judged.sum() == clear.height
        assert summary.worst_norm[k].max() == own["x_norm"].max()
        assert summary.profile[k].sum() == clear.height
    # Every judged sample has a best solver: the profiles begin at no less than 1 in all.
    assert summary.profile[:, 0].sum() >= summary.judged.sum()
    for worst in summary.worst:
        row = rows.filter((pl.col("contestant") == worst.contestant) & (pl.col("sample") == worst.sample)).row(
            0, named=True
        )
        figure = {"far off": row["distance"], "jump": row["lipschitz"]}.get(
            worst.criterion, row["x_norm"] / (1 + row["optimum_norm"])
        )
        assert worst.value == figure


def test_the_report_and_the_replay_of_its_worst_cases(
    test: Stress, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert test.folder is not None
    report = (test.folder / "report.md").read_text()
    assert (test.folder / "report.html").stat().st_size > 1e6
    for words in (
        "Performance profiles",
        "Worst cases",
        "tool position, kinematic",
        "direction of link 2, algorithmic",
    ):
        assert words in report
    for name in re.findall(r"figures/([\w-]+\.png)", report):
        assert (test.folder / "figures" / name).exists()
    commands = re.findall(r"hqp-rp replay (worst/[^|]*?) --solver '([^']*)'", report)
    assert len(commands) == len(test.summary.worst)
    monkeypatch.chdir(test.folder)
    for (files, solver), worst in zip(commands[:4], test.summary.worst, strict=False):
        assert main(["replay", *files.split(), "--solver", solver]) == 0
        printed = capsys.readouterr().out
        assert f"sample {worst.sample}" in printed
        if worst.criterion == "far off":
            distance = re.search(r"distance from the optimum (\S+)", printed)
            assert distance is not None
            # A batch rounds in another order than a single solve; near a singularity that shows.
            assert max(float(distance[1]), 1e-9) == pytest.approx(max(worst.value, 1e-9), rel=0.9)


def test_infeasible_samples_are_said_with_their_limits_and_kept(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    pathlib.Path("bad.toml").write_text(CORRIDOR.format(speed=1.0, back=20.0))
    solvers = ["--solver", "hierarchical_active_set", "--solver", "daqp"]
    asked = [
        "stress",
        "--stack",
        "bad.toml",
        "--samples",
        "60",
        "--starts",
        "2",
        "--workers",
        "1",
        "--output",
        "report",
    ]
    assert main([*asked, *solvers]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    infeasible = hqp_rp.load_problem("report/worst/infeasible-1.npz")
    rows = pl.read_parquet("report/parts/*.parquet").filter(pl.col("status") == "INFEASIBLE")
    count = rows["sample"].n_unique()
    assert 0 < count <= 60
    words = rf"of the samples are infeasible \({count} of 60\): corridor against joint limits\."
    assert re.match(rf"- [\d.]+ % {words} In sample", first)
    report = pathlib.Path("report/report.md").read_text()
    assert report.index("of the samples are infeasible") < report.index("## The answer")
    assert "| every one | infeasible: corridor against joint limits |" in report
    conflict = hqp_rp.solve(infeasible, "hierarchical_active_set").conflict
    assert conflict is not None
    assert conflict.remedies == ("corridor", "joint limits")
    assert str(conflict) in first
    for command, code in (("replay", 0), ("check", 1)):
        assert main([command, "report/worst/infeasible-1.npz"]) == code
        assert f"conflict: {conflict}" in capsys.readouterr().out


def test_every_contestant_is_spelled_as_the_command_line_reads_it() -> None:
    for contestant in choose_contestants():
        read = choose_contestants([spelled(contestant.solver)])
        assert repr(contestant.solver) in [repr(item.solver) for item in read]


def test_the_atlas_comes_back_to_the_last_bit(plan: Plan, tmp_path: pathlib.Path) -> None:
    save_atlas(plan.places, tmp_path / "atlas.json")
    for before, after in zip(plan.places, load_atlas(tmp_path / "atlas.json"), strict=True):
        for field in dataclasses.fields(before):
            np.testing.assert_array_equal(getattr(before, field.name), getattr(after, field.name))
    (tmp_path / "atlas.json").write_text("{}")
    with pytest.raises(FileError, match=r"atlas.json: not a readable atlas"):
        load_atlas(tmp_path / "atlas.json")


@pytest.mark.parametrize(
    ("changed", "error", "words"),
    [
        ({"samples": 0}, SettingError, "samples is 0; it must be an integer of at least 1"),
        ({"seed": -1}, SettingError, "seed is -1"),
        ({"starts": 0}, SettingError, "starts is 0"),
        ({"workers": 0}, SettingError, "workers is 0"),
        ({"robot": "sawyr"}, UnknownNameError, "Did you mean 'sawyer'"),
        ({"robot": "/none.xml"}, RobotError, "'/none.xml' does not exist"),
        ({"stack": "none"}, FileError, "no such stack file"),
        ({"stack": "dual_sawyer"}, RobotError, "dual_sawyer: level 1, task 1 .*right_tool"),
        ({"solvers": ["null_spac"]}, UnknownNameError, "Did you mean 'null_space'"),
        ({"stack": "sawyer_limits", "robot": "sawyer"}, SettingError, "No solver takes this stack"),
        ({"dask": "tcp://127.0.0.1:1"}, SettingError, "no scheduler answers there"),
    ],
)
def test_wrong_input_is_named_before_any_work(
    changed: dict[str, Any], error: type[HqpError], words: str, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hqp_rp.compare.stress.run._CONNECT", 0.5)
    given = {"robot": "planar4", "stack": "planar4", "solvers": ["null_space"], "output": tmp_path / "out"} | changed
    with pytest.raises(error, match=words):
        stress(given.pop("robot"), given.pop("stack"), **given)
    assert not (tmp_path / "out").exists()


def test_broken_models_and_stacks_and_foreign_folders(
    tmp_path: pathlib.Path, test: Stress, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "broken.xml").write_text("<mujoco><worldbody><body></mujoco>")
    (tmp_path / "typo.toml").write_text("[[level]\n")
    output = tmp_path / "out"
    tried = (
        ([str(tmp_path / "broken.xml"), "--stack", "planar4"], "broken.xml"),
        (["planar4", "--stack", str(tmp_path / "typo.toml")], "typo.toml: not valid TOML: .*line 1"),
    )
    for arguments, words in tried:
        assert main(["stress", *arguments, "--output", str(output)]) == 2
        assert re.search(words, capsys.readouterr().err)
        assert not output.exists()
    assert main(["stress", "planar4", "--stack", "planar4", "--samples", "5", "--output", str(test.folder)]) == 2
    assert "holds the report of another run (it differs in samples" in capsys.readouterr().err
