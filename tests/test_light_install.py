"""What the library does with numpy alone, and what it says of the packages that are missing."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from hqp_rp.core.extras import PACKAGES

ROOT = Path(__file__).parents[1]
QP = "qpsolvers, proxsuite and osqp", "qpsolvers proxsuite osqp"
REPORT = (
    "jinja2, joblib, matplotlib, plotly, polars, rich, tyro, cloudpickle, scipy, mujoco, qpsolvers and flint",
    "jinja2 joblib matplotlib plotly polars rich tyro cloudpickle scipy mujoco qpsolvers python-flint",
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


def run(code: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", REFUSE + code]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


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
        ("from hqp_rp.robot import MujocoRobot", "hqp_rp.robot.MujocoRobot", "mujoco", "mujoco", "mujoco"),
        ("from hqp_rp.robot import PinocchioRobot", "hqp_rp.robot.PinocchioRobot", "pinocchio", "pin", "pinocchio"),
        ("from hqp_rp import load_robot", "hqp_rp.load_robot", "mujoco", "mujoco", "mujoco"),
        ("hqp_rp.stress", "hqp_rp.stress", *REPORT, "report"),
        ("import hqp_rp.core.torch_layer", "hqp_rp.core.torch_layer", "torch", "torch", "torch"),
        ("import hqp_rp.core.jax_layer", "hqp_rp.core.jax_layer", "jax", "jax", "jax"),
        ("hqp_rp.solve(p, 'null_space').plot()", "Solution.plot", "matplotlib", "matplotlib", "report"),
        ("from hqp_rp.robot import load_robot", "hqp_rp.robot.load_robot", "mujoco", "mujoco", "mujoco"),
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
    start = "import hqp_rp, numpy as np\np = hqp_rp.Problem([hqp_rp.Level.equality(np.eye(2), [1.0, 2.0])])\n"
    done = run(f"{start}try:\n    {code}\nexcept hqp_rp.MissingExtraError as error:\n    print(error)\n")
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"{sentence(what, modules, packages, extra)}\n"


def test_the_command_line_says_what_it_lacks() -> None:
    done = run("from hqp_rp.script import main\nsys.exit(main())\n")
    assert done.returncode == 2
    assert done.stderr == f"hqp-rp: {sentence('The command line hqp-rp', *REPORT, 'report')}\n"


def sentence(what: str, modules: str, packages: str, extra: str) -> str:
    verb = "are" if " and " in modules else "is"
    return (
        f"{what} needs {modules}, which {verb} not installed: pip install {packages}, or install hqp-rp with its extra "
        f'"{extra}"'
    )


def test_the_packages_that_messages_name_are_those_of_the_extras() -> None:
    stated = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    for extra, packages in PACKAGES.items():
        required = [Requirement(text) for text in stated[extra]]
        names = {name for package in required for name in (package.name, *package.extras)}
        assert set(packages.values()) <= names, extra
        own = {package.name for package in required} - {"hqp-rp", "mujoco", "scipy"}
        assert own <= set(packages.values()), f"{extra}: a package that no message knows"
