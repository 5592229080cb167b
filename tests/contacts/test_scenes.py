"""The contact scenes start free of contact, and what they are for does touch."""

import mujoco
import numpy as np
import pytest

from tauguard.contacts.scenes import SCENES, ball_cloth
from tauguard.contacts.scenes.fabrics import tube
from tauguard.models import Cloth, SceneSpec

#: What must touch at 1 ms within the scene's time: geoms, links or "flex".
TOUCHES = {
    "arm_cloth": [("link5", "flex")],
    "sleeve_arm": [("link3", "flex")],
    "garment_chest": [("chest", "flex"), ("link5", "chest")],
    "ball_cloth": [("ball", "flex")],
    "sphere_plate": [("plate", "ball")],
    "arm_boxes": [("link6", "loose"), ("box0", "link5")],
    "two_arms": [("link6", "table"), ("link5", "other_link5")],
}


def name_of(model, geom):
    if geom < 0:
        return "flex"
    return (
        model.body(model.geom_bodyid[geom]).name
        if not model.geom(geom).name
        else (model.geom(geom).name.removesuffix("_collision0"))
    )


@pytest.mark.parametrize("name", SCENES)
def test_starts_free_and_touches_what_it_is_for(name):
    scene = SCENES[name]()
    model, data = scene.start(1e-3)
    assert data.ncon == 0
    wanted = {frozenset(pair) for pair in TOUCHES[name]}
    for _ in range(round(scene.seconds / model.opt.timestep)):
        if scene.control is not None:
            scene.control(model, data)
        mujoco.mj_step(model, data)
        for contact in data.contact:
            wanted.discard(frozenset(name_of(model, g) for g in contact.geom))
        if not wanted:
            break
    assert not wanted, f"never touched: {wanted}"
    assert not data.warning.number.any()


@pytest.mark.parametrize("name", SCENES)
def test_the_same_bits_every_time(name):
    states = []
    for _ in range(2):
        scene = SCENES[name]()
        model, data = scene.start()
        for _ in range(5):
            if scene.control is not None:
                scene.control(model, data)
            mujoco.mj_step(model, data)
        states.append(data.qpos.tobytes() + data.qvel.tobytes())
    assert states[0] == states[1]


def test_the_ball_reaches_the_cloth_when_it_should():
    """Free flight: gap plus offset at constant speed, from the analytic height."""
    scene = ball_cloth(speed=4.0, offset=0.003, impact="vertex")
    model, data = scene.start(1e-4)
    steps = round((0.005 + 0.003) / 4.0 / 1e-4)
    mujoco.mj_step(model, data, steps)
    ball = model.body("ball").jntadr[0]
    height = data.qpos[model.jnt_qposadr[ball] + 2]
    assert height == pytest.approx(0.010 + 0.001, abs=1e-12)
    gap = np.linalg.norm(data.flexvert_xpos[:, :2] - data.qpos[-7:-5], axis=1)
    assert gap.min() == pytest.approx(0, abs=1e-12)  # straight above a vertex


def test_a_tube_is_closed_around_and_open_at_both_ends():
    points, faces = tube(9, 5, 0.1, 0.4)
    assert points.shape == (45, 3)
    np.testing.assert_allclose(np.linalg.norm(points[:, :2], axis=1), 0.1)
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, uses = np.unique(edges, axis=0, return_counts=True)
    assert (uses == 1).sum() == 2 * 9
    assert set(uses) == {1, 2}
    corners = points[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = np.einsum("ij,ij->i", normal[:, :2], corners.mean(axis=1)[:, :2])
    assert (outward > 0).all()


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: ball_cloth(impact="corner"), "impact 'corner': expected one of vertex, edge"),
        (lambda: ball_cloth(speed=-1), "speed -1 m/s"),
        (lambda: ball_cloth().start(0.0), "timestep 0.0"),
        (lambda: SceneSpec(cloth=Cloth(young=1e5)), "a cloth with young= needs 'discrete'"),
        (lambda: Cloth(young=-1.0), r"Cloth.young"),
    ],
)
def test_bad_input_is_named(build, message):
    with pytest.raises(ValueError, match=message):
        build()
