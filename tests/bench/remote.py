"""Peers whose versions clash with ours: each in a process of another interpreter, asked for its turns in turn."""

from __future__ import annotations

import contextlib
import json
import math
import os
import pathlib
import subprocess
from collections.abc import Mapping
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.dh import DHArm

say = Sentences(__file__)

REMOTE_PEERS = ("pink", "placo", "roboplan")
"""Peers that may run in an environment of their own: names for `--peer`."""


class RemoteRunner:
    """A peer in a process of its own. A turn is timed there, so that passing messages costs it nothing.

    Args:
        peer: one of `REMOTE_PEERS`. label: in tables. python: its interpreter.
        asked: the robot, the configurations, and the tasks, as `peer_worker` reads them.

    Attributes:
        version: of the peer's package, or "" when it could not be set up; then `error` is the sentence.
    """

    def __init__(self, peer: str, label: str, python: pathlib.Path, asked: Mapping[str, Any]) -> None:
        self.label = label
        worker = pathlib.Path(__file__).with_name("peer_worker.py")
        one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        try:
            self._process = subprocess.Popen(
                [str(python), str(worker)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                env={**os.environ, **one},
                cwd=worker.anchor,
            )
        except OSError as error:
            raise SettingError(
                f"peer_python is {str(python)!r}, which cannot be run ({error.strerror}); give a Python interpreter's path."
            ) from error
        self.version, self.error = "", ""
        found = self._ask({**asked, "peer": peer})
        if "version" in found:
            self.version = str(found["version"])
        else:
            said, code = found.get("error", ""), found.get("ended")
            self.error = say("not_set_up", peer=peer, python=str(python), error=said, code=code)
            self.close()

    def turn(self, first: int, count: int) -> list[int]:
        return [int(t) for t in self._ask({"first": first, "count": count})["times"]]

    def answer(self, i: int) -> FloatArray:
        """The joint velocity (nv,) at configuration i, rad/s."""
        return np.array(self._ask({"answer": i})["v"], dtype=np.float64)

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait(timeout=30)

    def _ask(self, request: Mapping[str, Any]) -> dict[str, Any]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()
            for line in self._process.stdout:  # a library may print on its way
                if line.startswith("{"):
                    return dict(json.loads(line))
        except BrokenPipeError:
            pass
        return {"ended": self._process.wait(timeout=30)}


def arm_urdf(arm: DHArm) -> str:
    """The kinematics of an arm as URDF: links world, link1 ... linkn, tool; joints joint1 ... jointn about z.

    Each link has its mass and inertia; there are no shapes. Angles in rad, lengths in m.
    """
    lines = ['<?xml version="1.0"?>', f"<robot name={quoteattr(arm.name)}>", '<link name="world"/>']
    parent = "world"
    for i, link in enumerate(arm.links):
        inertia, center = link.inertia, " ".join(repr(float(c)) for c in link.center)
        terms = " ".join(f'i{"xyz"[a]}{"xyz"[b]}="{float(inertia[a, b])!r}"' for a in range(3) for b in range(a, 3))
        lines += [
            f'<link name="{link.name}"><inertial><origin xyz="{center}"/><mass value="{link.mass!r}"/><inertia {terms}/>'
            "</inertial></link>",
            f'<joint name="{link.joint}" type="revolute"><parent link="{parent}"/><child link="{link.name}"/>'
            f'{_origin(link.rotation, link.position)}<axis xyz="0 0 1"/>'
            f'<limit lower="{arm.lower[i]!r}" upper="{arm.upper[i]!r}" velocity="{arm.velocity_limit[i]!r}"'
            ' effort="1e3"/></joint>',
        ]
        parent = link.name
    lines += [
        '<link name="tool"/>',
        f'<joint name="to_tool" type="fixed"><parent link="{parent}"/><child link="tool"/>{_origin(*arm.tool_placement)}'
        "</joint>",
        "</robot>",
    ]
    return "\n".join(lines) + "\n"


def _origin(rotation: FloatArray, position: FloatArray) -> str:
    """R = Rz(yaw) Ry(pitch) Rx(roll), as URDF has it."""
    pitch = math.asin(max(-1.0, min(1.0, -float(rotation[2, 0]))))
    roll = math.atan2(float(rotation[2, 1]), float(rotation[2, 2]))
    yaw = math.atan2(float(rotation[1, 0]), float(rotation[0, 0]))
    xyz = " ".join(repr(float(p)) for p in position)
    return f'<origin xyz="{xyz}" rpy="{roll!r} {pitch!r} {yaw!r}"/>'
