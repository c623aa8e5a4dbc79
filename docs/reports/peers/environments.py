"""Which peers there are, and how the environment of each is made: plain records."""

from __future__ import annotations

from typing import NamedTuple


class Peer(NamedTuple):
    """A peer.

    Attributes:
        name: of its environment, DIR/name, and of its worker, workers/name_worker.py ("-" becomes "_").
        title: in tables. install: the pip line of a fresh environment. what: what it promises, in a sentence.
    """

    name: str
    title: str
    install: str
    what: str

    @property
    def worker(self) -> str:
        return f"{self.name.replace('-', '_')}_worker.py"


OURS = Peer(
    "hqp_rp",
    "hqp_rp",
    'pip install ".[mujoco]"    # in a checkout',
    "N strict levels of equalities and inequalities, hard rows, the least-norm answer of all",
)

PEERS = (
    OURS,
    Peer(
        "embodik",
        "embodik 0.23",
        "pip install embodik==0.23.2",
        "N strict levels of equalities, hard rows; a level that limits do not allow is scaled, its direction kept",
    ),
    Peer(
        "daqp",
        "DAQP 0.11",
        "pip install daqp==0.11.0 numpy",
        "N strict levels of equalities and inequalities, hard rows (hierarchical mode)",
    ),
    Peer(
        "tsid",
        "tsid 1.10",
        "pip install tsid==1.10.0 pin==4.0.0",
        "two levels: hard rows, then one weighted sum",
    ),
    Peer(
        "mink",
        "mink 1.3",
        "pip install mink==1.3.0 daqp==0.11.0",
        "one weighted sum of tasks; limits and constraints hard",
    ),
    Peer(
        "pink",
        "pink 4.4",
        "pip install pin-pink==4.4.0 daqp==0.11.0",
        "one weighted sum of tasks; limits and constraints hard",
    ),
    Peer(
        "placo",
        "placo 0.10",
        "pip install placo==0.10.0",
        "one weighted sum of soft constraints, equalities or inequalities; hard constraints",
    ),
    Peer(
        "roboplan",
        "roboplan 0.7",
        "pip install roboplan==0.7.0",
        "N priorities of frame and configuration tasks by null-space projection, one QP; limits hard",
    ),
    Peer(
        "mink-warp",
        "mink-warp 0.1",
        "pip install mink-warp==0.1.0",
        "one weighted sum of tasks, float32, for many worlds on a GPU; here one world on the processor",
    ),
)

ABSENT = {
    "frax 0.1": "kinematics and dynamics in JAX; the package has no solver of prioritized or weighted tasks to put a "
    "problem to",
    "LexLS 1.0": "no package on the index; `python -m tests.bench --lexls FOLDER` times a checkout's equality solver",
    "soth, HoQp, NIPM-HLSP": "C++ libraries without a package on the index",
    "newton 1.8": "batched differential IK without N strict levels; not measured",
}
"""Who is not measured, and why."""


def how_to() -> str:
    """How every environment is made."""
    lines = [f"    python3.11 -m venv DIR/{p.name}; DIR/{p.name}/bin/{p.install}" for p in PEERS]
    return "\n".join(lines)
