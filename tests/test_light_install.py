"""What the library does with numpy alone, and what it says of the packages that are missing."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from hqp_rp import Level, Problem, save_problem
from hqp_rp.core.extras import PACKAGES

ROOT = Path(__file__).parents[1]
QP = "qpsolvers, proxsuite and osqp", "qpsolvers proxsuite osqp"
PIN = "pinocchio", "pin", "pinocchio"
REPORT = (
    "jinja2, joblib, matplotlib, plotly, polars, rich, cloudpickle, scipy, mujoco, qpsolvers and flint",
    "jinja2 joblib matplotlib plotly polars rich cloudpickle scipy mujoco qpsolvers python-flint",
)

REFUSE = '''
import importlib.machinery, sys
ALLOWED = {"numpy", "hqp_rp"} | set(sys.stdlib_module_names)

class Refuse:
    """Finds nothing but numpy, the standard library and hqp_rp: an environment in which nothing else is installed."""
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ALLOWED:
            return None
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)

import importlib.util
_find = importlib.util.find_spec
importlib.util.find_spec = lambda name, package=None: _find(name, package) if name.partition(".")[0] in ALLOWED else None
sys.meta_path.insert(0, Refuse())
'''


HIDE = """
import importlib.util, sys
HIDDEN = {hidden!r}

class Hide:
    \"\"\"Finds none of the packages that extras bring but those that the command line needs.\"\"\"
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in HIDDEN:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
        return None

_find = importlib.util.find_spec
importlib.util.find_spec = lambda name, package=None: None if name.partition(".")[0] in HIDDEN else _find(name, package)
sys.meta_path.insert(0, Hide())
"""


def run(code: str, first: str = "") -> subprocess.CompletedProcess[str]:
    """Python with nothing but numpy; `first` runs before everything else is hidden."""
    return _python(first + REFUSE + code)


def command(*arguments: str, show: tuple[str, ...] = (), cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
    """`hqp-rp` with tyro and what tyro needs, and of all other packages only `show`."""
    hidden = {module for extra, packages in PACKAGES.items() if extra != "cli" for module in packages}
    hidden -= {"rich", *show}  # which tyro draws its help with
    code = f"sys.argv[1:] = {list(arguments)!r}; from hqp_rp.script import main; sys.exit(main())"
    return _python(HIDE.format(hidden=hidden) + code, cwd, path=True)


def sentence(what: str, modules: str, packages: str, extra: str) -> str:
    verb = "are" if " and " in modules else "is"
    return (
        f"{what} needs {modules}, which {verb} not installed: pip install {packages}, or install hqp-rp with its extra "
        f'"{extra}"'
    )


def _python(code: str, cwd: Path = ROOT, path: bool = False) -> subprocess.CompletedProcess[str]:
    """Run `code` in `cwd`; path: with this library in front, where `cwd` is not its folder."""
    first = f"import sys; sys.path.insert(0, {str(ROOT)!r})\n" if path else ""
    command = [sys.executable, "-c", first + code]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


def test_everything_light_works_with_numpy_alone(tmp_path: Path) -> None:
    smoke = (ROOT / "tests" / "wheel_smoke.py").read_text(encoding="utf-8")
    more = f"""
path = {str(tmp_path / "problem.npz")!r}
hqp_rp.save_problem(boxed, path)
assert hqp_rp.load_problem(path).hard_rows == 7
assert len(hqp_rp.all_solvers()) >= 11
for name in ("pseudo_inverse", "damped_least_squares", "singularity_robust"):
    assert hqp_rp.solve(free, name).status.ok
assert hqp_rp.solve(boxed, "reverse_priority_unilateral").status.ok
assert hqp_rp.solve(free, "null_space", variant="projector").status.ok
assert hqp_rp.solve(free, "reverse_priority", form="projector").status.ok
assert [level.rank for level in hqp_rp.diagnose(free, np.zeros(7))] == [3, 3]
assert len(hqp_rp.problems.names()) > 100 if hasattr(hqp_rp.problems, "names") else True
for shown in (free, hqp_rp.solve(free, "null_space"), hqp_rp.certify(free, np.zeros(7))):
    assert shown._repr_html_().startswith("<div>")
from hqp_rp.robot import planar_arm, sawyer
assert sawyer().kinematics(np.zeros((3, 7)))[2].shape == (3, 6, 7)
assert "hqp_rp.control.stack" not in sys.modules and "hqp_rp.robot.robot" not in sys.modules
stack = hqp_rp.Stack([hqp_rp.PostureTask(np.zeros(7))], limits=[hqp_rp.JointLimit(), hqp_rp.VelocityLimit(1.0)])
assert stack.names == ("posture",)
import hqp_rp.control
for name in hqp_rp.control.__all__:
    if name in hqp_rp.__all__:
        assert getattr(hqp_rp, name) is getattr(hqp_rp.control, name)
"""
    done = run(smoke + more)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("code", "what", "modules", "packages", "extra"),
    [
        ("hqp_rp.solve(p, 'qp_cascade')", "A QP back end", *QP, "qp"),
        ("hqp_rp.get_solver('weighted')", "A QP back end", *QP, "qp"),
        ("hqp_rp.solve(p, 'daqp')", "The solver daqp", "daqp", "daqp", "qp"),
        ("hqp_rp.truth(p)", "hqp_rp.truth", "flint", "python-flint", "truth"),
        ("hqp_rp.distance(p, [0, 0])", "hqp_rp.distance", "flint", "python-flint", "truth"),
        ("from hqp_rp import *; truth(p)", "hqp_rp.truth", "flint", "python-flint", "truth"),
        ("hqp_rp.robot.MujocoRobot(p)", "hqp_rp.robot.MujocoRobot", "mujoco", "mujoco", "mujoco"),
        ("hqp_rp.robot.MujocoRobot.from_file('a')", "hqp_rp.robot.MujocoRobot", "mujoco", "mujoco", "mujoco"),
        ("type('Own', (hqp_rp.robot.PinocchioRobot,), {})", "hqp_rp.robot.PinocchioRobot", *PIN),
        ("from hqp_rp.robot import *; PinocchioRobot(p)", "hqp_rp.robot.PinocchioRobot", *PIN),
        ("hqp_rp.load_robot('arm.xml')", "load_robot", "mujoco", "mujoco", "mujoco"),
        ("hqp_rp.load_robot('a.urdf', 'pinocchio')", 'load_robot(..., library="pinocchio")', *PIN),
        ("hqp_rp.stress('sawyer', 'sawyer')", "hqp_rp.stress", *REPORT, "report"),
        ("hqp_rp.compare.compare()", "hqp_rp.compare.compare", *REPORT, "report"),
        ("import hqp_rp.compare.statistics", "hqp_rp.compare.statistics", *REPORT, "report"),
        ("import hqp_rp.compare.stress.stress", "hqp_rp.compare.stress", *REPORT, "report"),
        ("import hqp_rp.core.torch_layer", "hqp_rp.core.torch_layer", "torch", "torch", "torch"),
        ("import hqp_rp.core.jax_layer", "hqp_rp.core.jax_layer", "jax", "jax", "jax"),
        ("hqp_rp.solve(p, 'null_space').plot()", "Solution.plot", "matplotlib", "matplotlib", "report"),
        (
            "from hqp_rp.scenarios.scenario import all_scenarios; all_scenarios()",
            "The scenarios",
            "mujoco",
            "mujoco",
            "mujoco",
        ),
    ],
)
def test_what_is_missing_is_said_with_the_line_that_installs_it(
    code: str, what: str, modules: str, packages: str, extra: str
) -> None:
    start = "import hqp_rp.robot, hqp_rp.compare, numpy as np\nfrom hqp_rp import *\n"
    start += "p = hqp_rp.Problem([hqp_rp.Level.equality(np.eye(2), [1.0, 2.0])])\n"
    done = run(f"{start}try:\n    {code}\nexcept hqp_rp.MissingExtraError as error:\n    print(error)\n")
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"{sentence(what, modules, packages, extra)}\n"


def test_help_dir_and_star_go_on_without_the_extras() -> None:
    done = run(
        """
import hqp_rp, hqp_rp.compare, hqp_rp.robot
from hqp_rp import *
from hqp_rp.robot import *
for package in (hqp_rp, hqp_rp.robot, hqp_rp.compare):
    assert set(package.__all__) <= {name for name, _ in inspect.getmembers(package)}
    assert package.__doc__.splitlines()[0] in pydoc.render_doc(package)
assert "truth needs flint, which is not installed: pip install python-flint" in pydoc.render_doc(hqp_rp)
assert "MujocoRobot needs mujoco" in pydoc.render_doc(hqp_rp.robot.MujocoRobot)
assert truth is hqp_rp.truth and "truth" in repr(truth)
assert not isinstance(1, MujocoRobot) and not hasattr(PinocchioRobot, "_private")
for module in pkgutil.walk_packages(hqp_rp.compare.__path__, "hqp_rp.compare.", onerror=lambda name: None):
    try:
        importlib.import_module(module.name)
    except hqp_rp.MissingExtraError:
        continue
print("done")
""",
        first="import inspect, pkgutil, pydoc\n",
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "done\n"


def test_the_command_line_says_what_it_lacks() -> None:
    done = run("from hqp_rp.script import main\nsys.exit(main())\n")
    assert done.returncode == 2
    assert done.stderr == f"hqp-rp: {sentence('The command line hqp-rp', 'tyro', 'tyro', 'cli')}\n"


def test_the_command_line_needs_no_more_than_it_uses(tmp_path: Path) -> None:
    for arguments in (["--help"], ["solvers"], ["stress", "--help"], ["play", "--help"], ["check", "--help"]):
        done = command(*arguments)
        assert done.returncode == 0, done.stderr
        assert done.stdout
    levels = [Level.equality([[1.0, 0.0]], [1.0], name="reach")]
    save_problem(Problem(levels), tmp_path / "problem.npz")
    done = command("check", "problem.npz", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert ", rank 1 of 1 row. NONE: " in done.stdout


@pytest.mark.parametrize(
    ("arguments", "show", "lacks"),
    [
        (["compare", "--quick"], (), sentence("hqp-rp compare", *REPORT, "report")),
        (["stress", "sawyer", "--stack", "sawyer"], (), sentence("hqp-rp stress", *REPORT, "report")),
        (["replay", "case.npz"], (), sentence("hqp-rp replay", *REPORT, "report")),
        (["statistics"], (), sentence("hqp-rp statistics", *REPORT, "report")),
        (["claims"], (), sentence("hqp-rp claims", *REPORT, "report")),
        (["play"], ("mujoco",), sentence("hqp-rp play", "viser", "viser", "play")),
        (["scenarios"], (), sentence("The scenarios", "mujoco", "mujoco", "mujoco")),
        (["check", "sawyer", "--robot", "sawyer"], (), sentence("The robot 'sawyer'", "mujoco", "mujoco", "mujoco")),
    ],
)
def test_a_subcommand_says_what_it_lacks(arguments: list[str], show: tuple[str, ...], lacks: str) -> None:
    done = command(*arguments, show=show)
    assert done.returncode == 2
    assert done.stderr.replace(", rich", "").replace(" rich", "") == f"hqp-rp: {lacks}\n".replace(", rich", "").replace(
        " rich", ""
    )


@pytest.mark.skipif(importlib.util.find_spec("pinocchio") is None, reason="pinocchio is not installed")
def test_pinocchio_does_without_mujoco(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(
        '<robot name="arm"><link name="base"/><link name="link"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><sphere radius="0.1"/>'
        '</geometry></collision></link><joint name="turn" type="revolute"><parent link="base"/><child link="link"/>'
        '<axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>'
    )
    (tmp_path / "arm.xml").write_text("<mujoco/>")
    done = _python(
        HIDE.format(hidden={"mujoco", "scipy"})
        + """
import hqp_rp, numpy as np
from hqp_rp.robot import PinocchioRobot, sawyer
robot = PinocchioRobot.from_arm(sawyer())
robot.update(robot.neutral)
target = robot.pose("tool")[1] + [0.0, 0.1, 0.0]
stack = hqp_rp.Stack([hqp_rp.PositionTask("tool", target)], limits=[hqp_rp.JointLimit()])
assert hqp_rp.solve(stack.problem(robot, 0.01), "hierarchical_active_set").status.ok
robot = hqp_rp.load_robot("arm.urdf", "pinocchio")
assert robot.geometry.ngeoms == 1
try:
    hqp_rp.load_robot("arm.xml", "pinocchio")
except hqp_rp.MissingExtraError as error:
    print(error)
""",
        tmp_path,
        path=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"{sentence('An MJCF file in Pinocchio', 'mujoco', 'mujoco', 'mujoco')}\n"


def test_the_packages_that_messages_name_are_those_of_the_extras() -> None:
    stated = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    for extra, packages in PACKAGES.items():
        required = [Requirement(text) for text in stated[extra]]
        names = {name for package in required for name in (package.name, *package.extras)}
        assert set(packages.values()) <= names, extra
        own = {package.name for package in required} - {"hqp-rp", "mujoco", "scipy"}
        assert own <= set(packages.values()), f"{extra}: a package that no message knows"
