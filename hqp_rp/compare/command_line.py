"""`hqp-rp`: compare solvers, stress them, replay a case, play with a robot, time them, list solvers, list scenarios."""

from __future__ import annotations

import pathlib
import sys
from collections.abc import Callable, Sequence
from typing import Any, Literal

import tyro

from hqp_rp.compare.robot_options import as_options, robot_options, warnings_in_lines
from hqp_rp.core.errors import HqpError, SettingError
from hqp_rp.core.paths import user_path

INTERRUPTED = 130
MISUSE = 2


def compare(
    scenario: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    solver: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    seeds: int | None = None,
    output: pathlib.Path = pathlib.Path("report"),
    quick: bool = False,
    overwrite: bool = False,
    workers: int | None = None,
) -> int:
    """Compare solvers on scenarios and write a report: report.html, report.md with figures, Parquet files.

    A comparison that was stopped goes on where it stopped when the same command is given again.

    Args:
        scenario: a scenario's name; repeat it for more. Without it, every scenario. See `hqp-rp scenarios`.
        solver: a solver's name, which picks all its variants, or NAME:KEY=VALUE,KEY=VALUE for settings of your own, such as
            reverse_priority:damping=constant(0.1),form=projector, or PACKAGE.MODULE:CLASS for a solver of your own; repeat it
            for more. See `hqp-rp solvers`.
        seeds: how many seeds; 3, or 1 with --quick, when not given.
        output: the folder to write.
        quick: fewer steps, for a first look.
        overwrite: replace the report of another run in that folder.
        workers: processes; one for each core when not given.
    """
    from hqp_rp.compare.comparison.comparison import compare as run

    output = user_path(output)
    try:
        found = run(
            scenario or None,
            solver or None,
            seeds=seeds,
            output=output,
            quick=quick,
            overwrite=overwrite,
            workers=workers,
            progress=True,
        )
    except KeyboardInterrupt:
        print(f"\nStopped. What is finished is kept in {output}; the same command goes on from there.", file=sys.stderr)
        return INTERRUPTED
    for sentence in (*found.left_out, *found.answer):
        print(f"- {sentence}")
    print(f"The report: {output / 'report.html'}")
    return 0


def stress(
    model: tyro.conf.Positional[str | None] = None,
    *,
    stack: str,
    library: Literal["mujoco", "pinocchio"] | None = None,
    meshes: bool = True,
    package_path: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    floating_base: bool = False,
    repair_inertias: bool = False,
    keyframe: str | None = None,
    samples: int = 10_000,
    solver: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    output: pathlib.Path = pathlib.Path("stress"),
    seed: int = 0,
    starts: int = 64,
    overwrite: bool = False,
    workers: int | None = None,
    dask: str | None = None,
) -> int:
    """Stress every solver on a robot and a stack: at random, near the joint limits, towards every singularity found.

    Writes a report: report.html, report.md with figures, worst cases as .npz, all rows as Parquet parts. A test that was
    stopped, or killed, goes on where it stopped when the same command is given again.

    Args:
        model: an MJCF or URDF file, or sawyer, planar4 (planarN), dual_sawyer, humanoid; without it, the one that the stack
            file says under [robot]. What is given here counts before what that says.
        stack: a stack file (TOML), or the name of one that comes with the library: sawyer, sawyer_limits, planar4,
            dual_sawyer, humanoid.
        library: what computes the robot; mujoco when not given.
        meshes: --no-meshes reads no mesh files; otherwise those that are there, and that MuJoCo reads, are read.
        package_path: a folder where packages of package://PACKAGE/FILE are; repeat it for more. The folders above the robot
            file, ROS_PACKAGE_PATH and AMENT_PREFIX_PATH are looked through as well.
        floating_base: give the root link of a URDF a free joint.
        repair_inertias: replace inertias that MuJoCo refuses by the nearest that it accepts.
        keyframe: the keyframe of an MJCF that is the robot's neutral configuration, such as home.
        samples: how many configurations.
        solver: as in `hqp-rp compare`, and closed_forms for all of them; repeat it for more. Without it, every solver.
        output: the folder to write.
        seed: of every draw.
        starts: of the search for singularities, for each level.
        overwrite: replace the report of another run in that folder.
        workers: processes; one for each core when not given.
        dask: address of a running dask scheduler that takes the work instead, such as tcp://10.0.0.1:8786.
    """
    from hqp_rp.compare.stress.stress import stress as run
    from hqp_rp.control.stack_file import load_stack

    file = load_stack(stack)
    given = robot_options(library, meshes, package_path, floating_base, repair_inertias, keyframe)
    robot, output = file.robot_source(model, **given), user_path(output)
    try:
        found = run(
            robot,
            file,
            samples=samples,
            solvers=solver or None,
            output=output,
            seed=seed,
            starts=starts,
            overwrite=overwrite,
            workers=workers,
            dask=dask,
            progress=True,
        )
    except KeyboardInterrupt:
        print(f"\nStopped. What is finished is kept in {output}; the same command goes on from there.", file=sys.stderr)
        return INTERRUPTED
    for sentence in found.answer:
        print(f"- {sentence}")
    print(f"The report: {output / 'report.html'}")
    return 0


def replay(
    file: tyro.conf.Positional[tuple[pathlib.Path, ...]],
    solver: str | None = None,
    figure: pathlib.Path | None = None,
    port: int = 8080,
) -> int:
    """Solve saved cases again and judge the answers; or show a run again that `hqp-rp play` recorded.

    Args:
        file: .npz files, as a stress test keeps its worst cases; of several, by how much x changes from each to the next.
            Or one recording, which is shown as a page.
        solver: a solver's name, NAME:KEY=VALUE,KEY=VALUE or PACKAGE.MODULE:CLASS; without it, the one that the case was
            saved for.
        figure: of a recording, the figure to write instead of showing it: .png, .pdf or .svg.
        port: of the page of a recording.
    """
    from hqp_rp.compare.play.recording import is_recording

    if len(file) == 1 and is_recording(file[0]):
        from hqp_rp.compare.play.command import replay_recording

        if solver is not None:
            raise SettingError(f"{file[0]} is a recorded run, which is shown as it was; leave --solver out.")
        print(replay_recording(file[0], figure=figure, port=port))
        return 0
    if figure is not None:
        raise SettingError("--figure is for one recording of hqp-rp play; these files are other ones.")
    from hqp_rp.compare.stress.worst import replay_all

    if not file:
        raise SettingError("replay needs a file: hqp-rp replay worst/CASE.npz.")
    for sentence in replay_all(file, solver):
        print(sentence)
    return 0


def play(
    robot: tyro.conf.Positional[str | None] = None,
    *,
    stack: str | None = None,
    solver: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    meshes: bool = True,
    package_path: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    floating_base: bool = False,
    repair_inertias: bool = False,
    keyframe: str | None = None,
    starts: int = 16,
    file: str = "play.npz",
    host: str = "127.0.0.1",
    port: int = 8080,
) -> int:
    """Play with a robot on a page in the browser: drag its target, switch the solver, drive to singularities, record it.

    Args:
        robot: an MJCF or URDF file, or sawyer, planar4 (planarN), dual_sawyer, humanoid; without it, the one that the stack
            file says under [robot], or the Sawyer.
        stack: a stack file (TOML), or the name of one that comes with the library; without it, the one of the robot's name.
        solver: as in `hqp-rp compare`; a second one is seen beside the first, as a ghost. Without it, null_space.
        meshes, package_path, floating_base, repair_inertias, keyframe: as in `hqp-rp stress`.
        starts: of the search for singularities, for each level; 0 for none.
        file: where the page saves recordings.
        host: the address to serve the page at; 0.0.0.0 lets other machines see it, and play.
        port: of the page; 0 for any that is free.
    """
    from hqp_rp.compare.play.command import page_of
    from hqp_rp.compare.settings_text import parse_contestant

    given = robot_options(None, meshes, package_path, floating_base, repair_inertias, keyframe)
    solvers = [parse_contestant(text) for text in solver]
    page = page_of(robot, stack, solvers, host=host, port=port, starts=starts, file=file, **given)
    print(f"The page: {page.address} (Ctrl-C ends it)", flush=True)
    page.run()
    return 0


def statistics(
    solver: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    arm: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    configurations: int | None = None,
    paths: int | None = None,
    seed: int = 0,
    output: pathlib.Path = pathlib.Path("statistics"),
    quick: bool = False,
    overwrite: bool = False,
    workers: int | None = None,
) -> int:
    """Drive three arms along 400 paths each through their singularities: medians, intervals, and which verdicts hang on what.

    It takes some fifteen minutes on two cores. A study that was stopped goes on where it stopped when the same command is given
    again.

    Args:
        solver: as of `compare`; without it, every solver.
        arm: sawyer, panda_like or planar4; repeat it for more. Without it, all three.
        configurations: singular ones, for each arm; 20, or 3 with --quick, when not given.
        paths: through each of them; 20, or 3 with --quick, when not given.
        seed: of every draw.
        output: the folder to write.
        quick: few configurations and paths, for a first look.
        overwrite: replace the report of another run in that folder.
        workers: processes; one for each core when not given.
    """
    import dataclasses

    from hqp_rp.compare.statistics.passages import Design
    from hqp_rp.compare.statistics.study import QUICK
    from hqp_rp.compare.statistics.study import statistics as run

    asked = {name: value for name, value in (("configurations", configurations), ("paths", paths)) if value is not None}
    design = dataclasses.replace(QUICK if quick else Design(), seed=seed, **asked)
    output = user_path(output)
    try:
        run(
            design,
            arms=arm or None,
            solvers=solver or None,
            output=output,
            overwrite=overwrite,
            workers=workers,
            progress=True,
        )
    except KeyboardInterrupt:
        print(f"\nStopped. What is finished is kept in {output}; the same command goes on from there.", file=sys.stderr)
        return INTERRUPTED
    print(f"The report: {output / 'report.html'}")
    return 0


def claims(
    output: pathlib.Path = pathlib.Path("report"),
    quick: bool = False,
    overwrite: bool = False,
    workers: int | None = None,
    films: bool = True,
) -> int:
    """Run the paper's force experiments with every kind of solver and write the verdict on each of its claims.

    Args:
        output: the folder to write: report.html, report.md, figures, films, and a row for each run as Parquet.
        quick: the short study of some three minutes; what it does not run it does not rule on.
        overwrite: replace the report of another run in that folder.
        workers: processes; one for each core when not given.
        films: render short films too, where a GL back end is there; the short study has none.
    """
    from hqp_rp.compare.claims.report import study_claims

    if workers is not None and workers < 1:
        raise SettingError(f"workers is {workers!r}; it must be an integer of at least 1.")
    output = user_path(output)
    for sentence in study_claims(output, quick=quick, overwrite=overwrite, workers=workers, films=films, progress=True):
        print(sentence)
    print(f"The report: {output / 'report.md'}")
    return 0


def bench(
    family: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    peer: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    peer_python: tyro.conf.UseAppendAction[tuple[pathlib.Path, ...]] = (),
    output: pathlib.Path = pathlib.Path("bench"),
    quick: bool = False,
    lexls: pathlib.Path | None = None,
    eigen: pathlib.Path | None = None,
) -> int:
    """Time every solver beside what a user would pick instead, in one run, and say what got worse since the last one.

    Writes a report with the ratios first: report.html, report.md with figures; and adds a line to history.jsonl.

    Args:
        family: a family of problems (7_3-3, 30, humanoid_40, 100, step_sawyer ...); repeat it for more. Without it, all.
        peer: daqp, numpy, qpsolvers, mink, pink, placo or roboplan; repeat it for more. Without it, all that are installed.
        peer_python: the Python interpreter of an environment where pink, placo or roboplan is installed; repeat it for more.
        output: the folder to write; it is the history that the next run is compared with.
        quick: fewer calls, and no figures of how cost grows.
        lexls: a checkout of github.com/jrl-umi3218/lexls (C++), timed beside our kernel; needs a C++ compiler and Eigen.
        eigen: the folder that holds the folder Eigen, when it is not where it usually is.
    """
    from hqp_rp.compare.bench.bench import bench as run

    output = user_path(output)
    found = run(
        output,
        families=family or None,
        peers=peer or None,
        peer_python=peer_python,
        quick=quick,
        lexls=lexls,
        eigen=eigen,
        progress=True,
    )
    from hqp_rp.compare.bench.report import answer

    for sentence in (*answer(found.measured), *found.against, *found.measured.missing, *found.measured.inside.missing):
        print(f"- {sentence}")
    print(f"The report: {output / 'report.html'}")
    return 0


def solvers() -> int:
    """List every solver: name, what it does, what it accepts, its settings and where it comes from."""
    import dataclasses

    from hqp_rp.core.solver import all_solvers

    blocks = []
    for name, kind in all_solvers().items():
        taken = ["equalities"]
        taken += ["two-sided rows"] if kind.takes_inequalities else []
        taken += ["hard rows"] if kind.takes_hard else []
        settings = [f"{field.name}={field.default!r}" for field in dataclasses.fields(kind) if field.init]
        blocks.append((name, [
            ("does", kind.summary.rstrip(".")),
            ("accepts", ", ".join(taken)),
            ("settings", ", ".join(settings) or "none"),
            ("source", kind.source),
        ]))  # fmt: skip
    _print_blocks(blocks)
    return 0


def scenarios() -> int:
    """List every scenario: name, its question, its settings."""
    import dataclasses

    from hqp_rp.scenarios.scenario import all_scenarios

    blocks = []
    for name, kind in all_scenarios().items():
        settings = [f"{field.name}={field.default!r}" for field in dataclasses.fields(kind) if field.init]
        blocks.append((name, [
            ("asks", kind.question),
            ("along", kind.abscissa),
            ("settings", ", ".join(settings) or "none"),
        ]))  # fmt: skip
    _print_blocks(blocks)
    return 0


def _print_blocks(blocks: Sequence[tuple[str, Sequence[tuple[str, str]]]]) -> None:
    import shutil
    import textwrap

    width = max(min(shutil.get_terminal_size((100, 24)).columns, 110), 40)
    for name, lines in blocks:
        print(name)
        for key, text in lines:
            first = f"  {key:<10}"
            print(textwrap.fill(text, width, initial_indent=first, subsequent_indent=" " * len(first)))
        print()


COMMANDS: dict[str, Callable[..., int]] = {
    "compare": compare,
    "stress": stress,
    "replay": replay,
    "play": play,
    "statistics": statistics,
    "claims": claims,
    "bench": bench,
    "solvers": solvers,
    "scenarios": scenarios,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 done, 2 wrong input (one line says what and the remedy), 130 interrupted."""
    try:
        with warnings_in_lines():
            code: Any = tyro.extras.subcommand_cli_from_dict(
                COMMANDS,
                prog="hqp-rp",
                description="One prioritized robot task stack, every hierarchical controller, and the truth about each.",
                args=list(sys.argv[1:] if arguments is None else arguments),
                config=(tyro.conf.FlagCreatePairsOff,),
            )
    except HqpError as error:
        print(f"hqp-rp: {as_options(str(error))}", file=sys.stderr)
        return MISUSE
    except KeyboardInterrupt:
        print("Stopped.", file=sys.stderr)
        return INTERRUPTED
    return int(code)


if __name__ == "__main__":
    from hqp_rp.script import main as program  # which knows what to do when a reader closes the pipe

    sys.exit(program())
