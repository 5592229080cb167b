"""Arms that nobody developed on, in the environments."""

import gymnasium as gym
import numpy as np
import pytest

from tauguard.envs import CollisionPlan, Episode, Simulation
from tauguard.envs.gym.settings import CONTROLS
from tauguard.models import Robot
from tests.models.arms import random_arm


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arms")

    def write(seed, gripper="none"):
        path = folder / f"arm{seed}{gripper}.xml"
        path.write_text(random_arm(seed, gripper))
        return str(path)

    return write


def make(robot, **keywords):
    settings = {"obstacles": (), "detector": "observer", "num_envs": 2, "threads": 1} | keywords
    return gym.make_vec("tauguard:tauguard/Reach-v0", robot=robot, **settings)


@pytest.mark.parametrize("control", CONTROLS)
@pytest.mark.parametrize("seed", range(20, 24))
def test_random_actions_neither_diverge_nor_alarm(arm, seed, control):
    envs = make(arm(seed, ("none", "fingers", "jaw")[seed % 3]), control=control)
    envs.reset(seed=seed)
    rng = np.random.default_rng(seed)
    for _ in range(200):
        _, _, _, _, info = envs.step(rng.uniform(-1, 1, envs.action_space.shape))
        assert not any(info["reason"])
        assert not info["alarm"].any()


def test_a_passive_gripper_works_in_every_environment(arm):
    robot = Robot(arm(20, "fingers"), gripper="passive")
    for name in ("Reach-v0", "React-v1", "TwoArms-v1"):
        env = gym.make(f"tauguard:tauguard/{name}", robot=robot, detector="observer")
        env.reset(seed=0)
        _, _, _, _, info = env.step(np.zeros(env.action_space.shape))
        assert info["reason"] == ""


def test_an_arm_with_a_passive_gripper_is_struck_and_clamped(arm, tmp_path):
    """Simulated whole: the gripper's joints are no part of what an arm hands to its obstacles."""
    robot = tmp_path / "arm.toml"
    robot.write_text(f'file = "{arm(20, "fingers")}"\ngripper = "passive"\n')
    plans = (CollisionPlan("strike", 1.0, 3), CollisionPlan("clamp", 3.0, 3))
    run = Simulation(Episode(5, 5.0, 60.0, arm=str(robot), collisions=plans))
    assert run.loop is run.striking.loop
    trace = run.run()
    assert [c.kind for c in trace.truth.collisions] == ["strike", "clamp"]
    assert np.isfinite(trace.q).all()


def test_the_velocity_servo_follows(arm):
    """Half speed on every joint for 0.3 s: the arm keeps up within a fiftieth of its speed."""
    envs = make(arm(21), num_envs=1)
    compiled = envs.unwrapped.compiled
    envs.reset(seed=0)
    n = len(compiled.scene.joint_names)
    low, high = np.clip(compiled.joint_range, -10, 10).T
    way = np.where(low + high > 2 * compiled.scene.home, 1.0, -1.0)
    for _ in range(30):
        seen, *_ = envs.step(0.25 * way[None])
    error = np.abs(seen[0, n : 2 * n] - 0.25 * way * compiled.max_speed)
    assert (error < 0.02 * compiled.max_speed).all()


def test_a_joint_at_its_end_raises_no_alarm(arm):
    """Full torque one way: the arm runs into its stops, which are no collision."""
    envs = make(arm(22), num_envs=1, control="torque")
    envs.reset(seed=0)
    for k in range(300):
        _, _, _, _, info = envs.step(np.full(envs.action_space.shape, -1.0 if k > 150 else 1.0))
        assert not info["alarm"].any()


def test_a_time_step_too_long_names_joint_and_remedy(arm):
    robot = Robot(arm(23), bandwidth=200.0)
    with pytest.raises(
        ValueError, match=r"timestep .* joint 'j\d' .* expected a timestep of at most"
    ):
        make(robot, control_rate=100.0, timestep=5e-3)
    make(robot, timestep=2.5e-4)
