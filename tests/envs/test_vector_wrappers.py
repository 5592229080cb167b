"""Wrappers of native vectors do what those of single environments do, bit for bit."""

import copy
import ctypes.util

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from tauguard.envs import vector_wrappers, wrappers
from tauguard.envs.gym.vector import VectorArmEnv
from tauguard.models import BodyProxy, SceneObject, Shape

from .test_vector import same

REACT = "tauguard:tauguard/React-v1"
HAND = BodyProxy("hand", position=(0.36, 0.4, 0.75), direction=(0.0, -1.0, 0.0))
#: Name of a wrapper, its settings, and the keywords of its environment.
CASES = {
    "stop1": ("Reaction", {"reaction": "stop1"}, {"detector": "observer"}),
    "retract": ("Reaction", {"reaction": "retract", "trigger": "contact"}, {}),
    "admittance": ("Reaction", {"reaction": "admittance"}, {"detector": "observer"}),
    "budget": ("CostBudget", {"limit": 0.0}, {}),
    "separation": ("SpeedAndSeparation", {"reaction_time": 0.05}, {}),
    "observation": ("DetectorObservation", {}, {"detector": "observer"}),
}


def pair(case, mode, copies=2):
    """The native vector and the synchronous one, each with the wrapper."""
    kind, settings, keywords = CASES[case]
    keywords = {"control": "cartesian", "max_episode_steps": 70} | keywords
    native = gym.make_vec(REACT, num_envs=copies, autoreset_mode=mode, **keywords)
    assert isinstance(native.unwrapped, VectorArmEnv)

    def single():
        return getattr(wrappers, kind)(gym.make(REACT, **keywords), **settings)

    sync = SyncVectorEnv([single] * copies, autoreset_mode=mode)
    return getattr(vector_wrappers, kind)(native, **settings), sync


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("case", CASES)
def test_copies_react_as_single_environments_do(case, mode):
    native, sync = pair(case, mode)
    same(sync.reset(seed=1), native.reset(seed=1), "reset")
    speeds, ends, seen = np.array([0.6, 0.3]), 0, set()
    for k in range(120):
        actions = np.zeros(native.action_space.shape, np.float32)
        actions[:, 1] = speeds
        results = sync.step(actions), native.step(actions)
        same(*results, f"step {k}")
        ends += (results[1][2] | results[1][3]).sum()
        infos = results[1][4]
        seen |= {k for k in ("reacting", "stopped", "alarm") if np.any(infos.get(k, False))}
    assert ends > 0
    expected = {"Reaction": "reacting", "SpeedAndSeparation": "stopped"}.get(CASES[case][0])
    assert expected is None or expected in seen


def test_a_budget_ends_an_episode_of_one_copy_only():
    native, _ = pair("budget", AutoresetMode.NEXT_STEP)
    native.reset(seed=1)
    actions = np.zeros((2, 6))
    actions[0, 1] = 1.0  # one copy hits the chest
    for _ in range(60):
        _, _, terminated, _, infos = native.step(actions)
        if terminated.any():
            break
    assert terminated.tolist() == [True, False]
    assert infos["cost_left"][0] < 0 == infos["cost_left"][1]


def test_a_snapshot_contains_the_reaction():
    env = wrappers.Reaction(gym.make(REACT, control="cartesian"), "retract", "contact")
    env.reset(seed=0)
    info = {"reacting": False}
    while not info["reacting"]:
        *_, info = env.step([0, 0.5, 0, 0, 0, 0])
    state, twin = env.unwrapped.get_state(), copy.deepcopy(env)
    expected = [env.step(np.zeros(6))[0] for _ in range(30)]
    env.reset(seed=4)
    env.unwrapped.set_state(state)
    for one in (env, twin):
        for seen in expected:
            np.testing.assert_array_equal(one.step(np.zeros(6))[0], seen)


def test_what_a_vector_cannot_have_is_said():
    with pytest.raises(ValueError, match=r"gymnasium\.make_vec"):
        vector_wrappers.CostBudget(SyncVectorEnv([lambda: gym.make(REACT)]), limit=1.0)
    envs = gym.make_vec(REACT, num_envs=2)
    with pytest.raises(ValueError, match="detector="):
        vector_wrappers.Reaction(envs)
    with pytest.raises(ValueError, match="limit"):
        vector_wrappers.CostBudget(envs, limit=-1.0)


WRIST = SceneObject(
    "camera",
    mjcf="<mujoco><worldbody><geom size='.01'/><camera name='wrist' euler='180 0 0'/></worldbody>"
    "</mujoco>",
    position=(0.0, 0.0, 0.03),
    motion="held",
    mass=0.1,
)
BLOCK = SceneObject("block", (Shape("box", (0.1, 0.1, 0.1)),), position=(0.4, 0.1, 0.2))


@pytest.mark.skipif(ctypes.util.find_library("EGL") is None, reason="no EGL library")
def test_pictures_of_every_copy_by_any_camera(tmp_path):
    keywords = {"obstacles": (), "objects": (WRIST, BLOCK), "height": 24, "width": 32}
    name, shapes = "tauguard:tauguard/Reach-v0", {}
    for mode in ("rgb_array", "depth_array", "segmentation_array"):
        env = gym.make(name, render_mode=mode, view="camera_wrist", **keywords)
        env.reset(seed=0)
        shapes[mode] = env.render()
        env.close()
    assert [shapes[mode].shape for mode in shapes] == [(24, 32, 3), (24, 32), (24, 32)]
    # The wrist looks down onto the block, half a metre below it.
    block = env.unwrapped.model.body("block").id
    seen = shapes["segmentation_array"] == block
    assert 0.05 < seen.mean() < 0.9
    top = env.unwrapped.data.body("block").xpos[2] + 0.1
    down = env.unwrapped.data.body("camera").xpos[2] - top
    assert np.median(shapes["depth_array"][seen]) == pytest.approx(down, rel=0.1)
    with pytest.raises(ValueError, match="front, left, right, top, camera_wrist"):
        gym.make(name, render_mode="rgb_array", view="elbow", **keywords).unwrapped.render()
    for wrong in ({"height": 0}, {"render_mode": "ansi"}):
        with pytest.raises(ValueError, match="expected"):
            gym.make(name, **keywords | wrong)
    envs = gym.make_vec(name, num_envs=3, render_mode="rgb_array", **keywords)
    watched = vector_wrappers.CameraObservation(envs, "rgbd", 12, 16, "camera_wrist")
    assert watched.observation_space.contains(watched.reset(seed=0)[0])
    seen, *_ = watched.step(np.zeros((3, 6)))
    alone = wrappers.CameraObservation(gym.make(name, **keywords), "rgbd", 12, 16, "camera_wrist")
    alone.reset(seed=2)
    expected, *_ = alone.step(np.zeros(6))
    for key in ("state", "rgb", "depth"):
        np.testing.assert_array_equal(seen[key][2], expected[key])
    video = pytest.importorskip("moviepy") and gym.wrappers.vector.RecordVideo(
        envs, str(tmp_path), video_length=5
    )
    video.reset(seed=0)
    for _ in range(8):
        video.step(video.action_space.sample())
    video.close()
    assert list(tmp_path.glob("*.mp4"))
