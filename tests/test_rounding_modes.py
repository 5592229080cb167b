"""Bounds assume round-to-nearest: a caller's other mode changes no answer and is put back."""

import mujoco
import numpy as np
import pytest

from tauguard.cloth import MeshCCD
from tauguard.cloth.scenes import SCENES
from tauguard.contacts import State, checker
from tauguard.geometry import _geometry
from tauguard.rigid import MeshTree, Motion

FALL = """
<mujoco><worldbody><geom type="box" size="1 1 .1"/>
  <body name="tool" pos="0 0 1"><freejoint/><geom type="capsule" size=".1 .2"/></body>
</worldbody></mujoco>
"""


def cloth_frame(threads):
    scene = SCENES["crumpling"](1000, 0)
    ccd = MeshCCD(scene.faces, groups=scene.groups, threads=threads)
    steps = list(scene.steps(6))

    def asked():
        found = ccd.find(*steps[-1])
        assert len(found.vf) + len(found.ee) > 50
        return found.vf, found.ee, found.vf_impacts.toi, found.ee_impacts.toi

    return asked


def rigid_meshes():
    rng = np.random.default_rng(0)
    vertices, faces = (
        rng.normal(size=(60, 3)),
        rng.permuted(np.tile(np.arange(60), (40, 1)), axis=1),
    )
    tree = MeshTree(vertices, faces[:, :3])
    pose = np.tile(np.eye(4), (20, 1, 1))
    pose[:, :3, 3] = rng.normal(size=(20, 3))
    far = np.tile(np.eye(4), (20, 1, 1))
    far[:, 0, 3] = 12
    motion = Motion(far, linear=np.tile([-9.0, 0, 0], (20, 1)), angular=rng.normal(size=(20, 3)))

    def asked():
        touch = tree.time_of_impact(tree, motion)
        assert touch.hit.any()
        return tree.overlap(tree, pose).hit, touch.hit, touch.time_of_impact

    return asked


def contact_checkers():
    model = mujoco.MjModel.from_xml_string(FALL)
    data = mujoco.MjData(model)
    before = State.of(model, data)
    data.qpos[2] = 0.25
    after = State.of(model, data)
    own = checker("rigid", model)

    def asked():
        found = own.check(before, after)
        assert len(found)
        return found.geom, found.time

    return asked


ENTRIES = {
    "cloth, a frame": lambda: cloth_frame(1),
    "cloth, a frame by two threads": lambda: cloth_frame(2),
    "rigid, meshes": rigid_meshes,
    "contacts, the rigid checker": contact_checkers,
}


@pytest.mark.parametrize("mode", [1, 2, 3])
@pytest.mark.parametrize("entry", ENTRIES)
def test_answers_stay_and_so_does_the_mode(entry, mode):
    asked = ENTRIES[entry]()
    expected = asked()
    try:
        _geometry.set_rounding(mode)
        got = asked()
        left = _geometry.get_rounding()
    finally:
        _geometry.set_rounding(0)
    assert left == mode
    for one, other in zip(got, expected, strict=True):
        np.testing.assert_array_equal(one, other)
