"""A mesh by its surface: what falls into a cup reaches the bottom, not the lid of its hull."""

import mujoco
import numpy as np
import pytest

from tauguard.contacts import State, checker

#: An open box of 1 m sides, its floor at z = 0: corners below, corners above, two triangles a side.
CORNERS = [
    (x, y, z) for z in (0, 1) for x, y in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
]
FACES = [(0, 2, 1), (0, 3, 2)] + [
    f for i in range(4) for f in ((i, (i + 1) % 4, 4 + i), ((i + 1) % 4, 4 + (i + 1) % 4, 4 + i))
]
CUP = (
    f'<mesh name="cup" inertia="shell" vertex="{" ".join(str(x) for c in CORNERS for x in c)}" '
    f'face="{" ".join(str(x) for f in FACES for x in f)}"/>'
)
POINTS = " ".join(str(0.1 * x) for c in CORNERS for x in (2 * c[0], 2 * c[1], 2 * c[2] - 1))
SHAPES = {
    "sphere": 'type="sphere" size=".1"',
    "capsule": 'type="capsule" size=".05 .05"',
    "cylinder": 'type="cylinder" size=".1 .1"',
    "ellipsoid": 'type="ellipsoid" size=".2 .15 .1"',
    "box": 'type="box" size=".1 .1 .1"',
    "mesh": 'type="mesh" mesh="cube"',
}


def fall(shape, start, way, turn=0.0):
    text = f"""<mujoco><asset>{CUP}<mesh name="cube" vertex="{POINTS}"/></asset><worldbody>
      <geom type="plane" size="9 9 9" pos="0 0 -5"/>
      <geom name="cup" type="mesh" mesh="cup"/>
      <body><freejoint/><geom {SHAPES[shape]} mass="1"/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:3] = start
    before = State.of(model, data)
    mujoco.mj_integratePos(model, data.qpos, np.array([*way, 0, 0, turn]), 1)
    after = State.of(model, data)
    return {m: checker("rigid", model, mesh=m).check(before, after) for m in ("hull", "surface")}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("turn", [0.0, 0.5])
def test_into_the_cup(shape, turn):
    found = fall(shape, (0.05, 0.02, 1.5), (0, 0, -1.7), turn)
    assert found["hull"].time == pytest.approx(
        [0.4 / 1.7], abs=2e-7
    )  # MuJoCo keeps mesh vertices in single precision
    assert found["surface"].time == pytest.approx([1.4 / 1.7], abs=2e-7)
    assert found["surface"].point[0, 2] == pytest.approx(0, abs=2e-7)
    assert abs(found["surface"].normal[0, 2]) == pytest.approx(1, abs=1e-6)
    assert set(found["surface"].feature[0].tolist()) & {0, 1}


@pytest.mark.parametrize("shape", SHAPES)
def test_resting_inside_touches_nothing(shape):
    found = fall(shape, (0, 0, 0.5), (0.01, 0, 0.01))
    assert len(found["hull"]) == 1
    assert found["hull"].time[0] == 0
    assert found["hull"].distance[0] < -0.3
    assert len(found["surface"]) == 0


def test_far_from_the_cup_nothing_is_tested():
    for shape in SHAPES:
        assert len(fall(shape, (5, 0, 0.5), (0.1, 0, 0))["surface"]) == 0


def test_an_unknown_meaning_is_named():
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    with pytest.raises(ValueError, match="mesh 'solid': expected hull or surface"):
        checker("rigid", model, mesh="solid")
