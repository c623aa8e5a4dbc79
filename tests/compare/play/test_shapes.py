"""What is drawn of a model: closed surfaces of the right volume and place, for every kind of geom."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from hqp_rp.compare.play.shapes import Shape, shapes_of, skeleton_of
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.named import named_robot

MODEL = """
<mujoco>
  <asset>
    <mesh name="wedge" vertex="0 0 0  0.2 0 0  0 0.3 0  0 0 0.4"/>
    <material name="red" rgba="1 0 0 1"/>
  </asset>
  <worldbody>
    <geom type="plane" size="1 1 0.1"/>
    <body name="first" pos="1 0 0">
      <joint/>
      <geom name="box" type="box" size="0.1 0.2 0.3" pos="0 0 1" euler="0 90 0" material="red"/>
      <geom name="sphere" type="sphere" size="0.2" rgba="0 1 0 0.5"/>
      <geom name="capsule" type="capsule" size="0.1 0.3"/>
      <geom name="cylinder" type="cylinder" size="0.1 0.3"/>
      <geom name="ellipsoid" type="ellipsoid" size="0.1 0.2 0.3"/>
      <geom name="wedge" type="mesh" mesh="wedge"/>
      <geom name="hidden" type="sphere" size="9" group="3"/>
      <geom name="invisible" type="sphere" size="9" rgba="0 0 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""


def volume(vertices: FloatArray, faces: NDArray[np.int64]) -> float:
    """By the divergence theorem: positive where the faces look outward."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6.0


def edges(faces: NDArray[np.int64]) -> list[tuple[int, int]]:
    return [(int(face[i]), int(face[(i + 1) % 3])) for face in faces for i in range(3)]


@pytest.fixture(scope="module")
def shapes() -> dict[str, Shape]:
    return {shape.name: shape for shape in shapes_of(mujoco.MjModel.from_xml_string(MODEL))}


@pytest.mark.parametrize(
    ("name", "exact"),
    [
        ("box", 8 * 0.1 * 0.2 * 0.3),
        ("sphere", 4 / 3 * math.pi * 0.2**3),
        ("capsule", 4 / 3 * math.pi * 0.1**3 + math.pi * 0.1**2 * 0.6),
        ("cylinder", math.pi * 0.1**2 * 0.6),
        ("ellipsoid", 4 / 3 * math.pi * 0.1 * 0.2 * 0.3),
        ("wedge", 0.2 * 0.3 * 0.4 / 6),
    ],
)
def test_a_surface_is_closed_looks_outward_and_has_the_geoms_volume(
    name: str, exact: float, shapes: dict[str, Shape]
) -> None:
    shape = shapes[name]
    found = edges(shape.faces)
    assert len(set(found)) == len(found)  # no edge twice in one direction
    assert {(b, a) for a, b in found} == set(found)  # and each once in the other
    assert volume(shape.vertices, shape.faces) == pytest.approx(exact, rel=0.03)  # a polyhedron within the round shape
    assert volume(shape.vertices, shape.faces) <= exact * (1.0 + 1e-6)


def test_what_is_hidden_invisible_or_unbounded_is_left_out(shapes: dict[str, Shape]) -> None:
    assert set(shapes) == {"box", "sphere", "capsule", "cylinder", "ellipsoid", "wedge"}


def test_a_shape_stands_where_its_geom_does_and_has_its_colour(shapes: dict[str, Shape]) -> None:
    box = shapes["box"]
    np.testing.assert_allclose(box.vertices.min(axis=0), [-0.3, -0.2, 0.9], atol=1e-7)
    np.testing.assert_allclose(box.vertices.max(axis=0), [0.3, 0.2, 1.1], atol=1e-7)
    np.testing.assert_allclose(box.color, [1.0, 0.0, 0.0, 1.0])
    np.testing.assert_allclose(shapes["sphere"].color, [0.0, 1.0, 0.0, 0.5])
    assert {shape.body for shape in shapes.values()} == {1}


def test_a_model_of_collision_geoms_alone_is_drawn_too() -> None:
    text = MODEL.replace("<geom name", '<geom group="4" name').replace(' group="3"/>', "/>")
    assert (
        len(shapes_of(mujoco.MjModel.from_xml_string(text))) == 7
    )  # the floor does not count, nor what is transparent


def test_a_model_without_geometry_is_drawn_as_bars_from_joint_to_joint() -> None:
    inertia = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    inner = f'<body name="b" pos="0.3 0 0.4"><joint/>{inertia}</body>'
    text = f'<mujoco><worldbody><body name="a" pos="0 0 1"><joint/>{inertia}{inner}</body></worldbody></mujoco>'
    model = mujoco.MjModel.from_xml_string(text)
    assert shapes_of(model) == ()
    found = {shape.name: shape for shape in skeleton_of(model)}
    assert {name: shape.body for name, shape in found.items()} == {
        "joint of a": 1, "bar to a": 0, "joint of b": 2, "bar to b": 1,
    }  # fmt: skip
    bar = found["bar to b"]
    np.testing.assert_allclose(bar.vertices[[-1, 0]], [[0.0, 0.0, 0.0], [0.3, 0.0, 0.4]], atol=1e-12)
    assert all(volume(shape.vertices, shape.faces) > 0.0 for shape in found.values())


@pytest.mark.parametrize("robot", ["sawyer", "planar4", "dual_sawyer", "humanoid"])
def test_every_robot_of_the_library_is_drawn_whole(robot: str) -> None:
    model = named_robot(robot).model  # type: ignore[attr-defined]
    drawn = {shape.body for shape in shapes_of(model)}
    assert drawn >= {int(model.geom_bodyid[g]) for g in range(model.ngeom) if model.geom_type[g] != 0}
