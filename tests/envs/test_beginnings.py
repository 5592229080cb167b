"""Episodes begin clear of everything, and forces are ones that the arm can exert."""

import subprocess
import sys

import gymnasium as gym
import mujoco
import numpy as np
import pytest

from tauguard.environments import ENVIRONMENTS
from tauguard.envs import try_arm
from tauguard.envs.gym.placing import StartsInContact
from tauguard.models import BodyProxy, Person, SceneObject, Shape, Table
from tests.models.arms import random_arm

REACH = "tauguard:tauguard/Reach-v0"


@pytest.mark.parametrize("seed", [31, 32])
def test_an_arm_that_nobody_developed_on_passes_the_trial(seed, tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(random_arm(seed, "none"))
    for row in try_arm(str(path), episodes=3, seed=100):
        assert row.passed, row
        assert row.episodes == 3
        assert row.bound < 1e5


def small(path):
    """The bundled arm's chain at a third of its size, with a collision shape on its base."""
    text = random_arm(33, "none")
    spec = mujoco.MjSpec.from_string(text)
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[0.08, 0.05, 0], contype=1, conaffinity=1
    )
    spec.compile()
    path.write_text(spec.to_xml())
    return str(path)


def test_the_base_of_the_second_arm_does_not_touch_its_own_first_link(tmp_path):
    env = gym.make("tauguard:tauguard/TwoArms-v1", robot=small(tmp_path / "arm.xml")).unwrapped
    model = env.model
    bases = [g for g in range(model.ngeom) if model.geom_bodyid[g] == 0 and model.geom_contype[g]]
    second = [g for g in bases if model.geom(g).name.startswith("arm2_")]
    assert second
    own = int(env.scene.link_bodies[len(env.scene.link_bodies) // 2])
    for base in second:
        for geom in np.flatnonzero(model.geom_bodyid == own):
            meets = model.geom_contype[base] & model.geom_conaffinity[geom]
            assert not meets | (model.geom_contype[geom] & model.geom_conaffinity[base])
    env.reset(seed=0)
    assert env.step(np.zeros(env.action_space.shape))[4]["force"] == 0


def test_what_was_placed_by_hand_inside_the_arm_is_refused_by_name():
    table = Table(position=(0.0, 0.0, 0.5), half_extents=(0.2, 0.2, 0.2))
    with pytest.raises(StartsInContact, match=r"begins in contact: link\d is .* mm inside table"):
        gym.make(REACH, table=table, obstacles=())


def test_a_person_does_not_stand_where_a_cart_will_come():
    box, rows = Shape("box", (0.15, 0.1, 0.3)), ((0, 1.0, -1.5, 0), (2, 1.0, 1.5, 0))
    cart = SceneObject("cart", (box,), path=rows)
    env = gym.make(REACH, obstacles=("person",), objects=(cart,)).unwrapped
    env.reset(seed=0)
    model, data = env.model, env.data
    trunk = ("pelvis", "abdomen", "chest", "left_thigh", "right_thigh")
    own = [model.geom(f"person_{name}").id for name in trunk]
    (other,) = [g for g in range(model.ngeom) if model.geom_bodyid[g] == model.body("cart").id]
    nearest = np.inf
    for _ in range(400):  # the cart passes twice
        env.step(np.zeros(6))
        between = [mujoco.mj_geomDistance(model, data, g, other, 1.0, None) for g in own]
        nearest = min(nearest, *between)
    assert 0 < nearest < 0.2  # as near as it can be
    with pytest.raises(StartsInContact, match="inside cart as it comes by"):
        gym.make(REACH, obstacles=(Person(position=(1.1, 0)),), objects=(cart,))


def test_a_region_that_begins_inside_the_arm_is_drawn_again():
    """At seed 0 the chest's first place on its line is 95 mm inside a link."""
    chest = BodyProxy("chest", position=(0.21, 0.7, 0.9), direction=(0.0, -1.0, 0.0))
    env = gym.make(REACH, obstacles=(chest,)).unwrapped
    for seed in range(20):
        env.reset(seed=seed)
        data = mujoco.MjData(env.model)
        data.qpos[:] = env.data.qpos
        mujoco.mj_forward(env.model, data)
        assert data.ncon == 0


@pytest.mark.parametrize("vector", [False, True])
def test_a_force_beyond_the_arm_truncates_and_costs_nothing(vector):
    if vector:
        env = gym.make_vec(
            REACH, num_envs=2, vectorization_mode="vector_entry_point", obstacles=("hand",)
        ).unwrapped
        zero = np.zeros((2, 6))
    else:
        env = gym.make(REACH, obstacles=("hand",)).unwrapped
        zero = np.zeros(6)
    env.reset(seed=0)
    model, data = env.compiled.scene.model, env.batch.datas[0]
    hand = model.joint("hand")
    # A hand inside the arm's third link, whose contact is thirty times as stiff as it says.
    model.body_pos[model.body("hand").id] = data.xpos[env.compiled.scene.link_bodies[2]]
    model.pair_solref[:, 0] *= 30
    data.qpos[hand.qposadr[0]], data.qvel[hand.dofadr[0]] = 0.0, 0.0
    _, _, ended, cut, info = env.step(zero)
    first = (lambda value: value[0]) if vector else (lambda value: value)
    assert first(cut)
    assert not first(ended)
    assert "a force beyond the" in first(info["reason"])
    assert first(info["cost"]) == first(info["cost_sum"]) == 0
    assert first(info["force"]) <= env.compiled.force_bound.total


def test_the_trial_is_a_command():
    command = [sys.executable, "-m", "tauguard", "robot", "cura6", "--try", "--episodes", "1"]
    out = subprocess.run(command, capture_output=True, text=True)
    assert out.returncode == 0, out.stderr
    assert out.stdout.count("tauguard/") == len(ENVIRONMENTS)
    assert "largest force on a skull" in out.stdout
