"""Tasks of one's own: the two examples, goals, free objects; the same bits single and native."""

import copy
import pickle
import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from tauguard.envs.gym.vector import VectorArmEnv
from tauguard.envs.tasks import Entry, Outcome, Reach, register
from tauguard.models import SceneObject, Shape

from .test_vector import same

EXAMPLES = Path(__file__).parents[2] / "examples"
sys.path.insert(0, str(EXAMPLES))
import hand_over  # noqa: E402
import pick  # noqa: E402

REACH = "tauguard:tauguard/Reach-v0"
IDS = (pick.PICK, pick.FROM_BELT, hand_over.HAND_OVER)
POLICIES = {pick.PICK: pick.policy, pick.FROM_BELT: pick.policy}
BALL = SceneObject(
    "ball", (Shape("sphere", (0.05,)),), position=(1.2, 0.8, -0.3), motion="free", mass=0.3
)


def policy_of(name):
    return POLICIES.get(name, hand_over.policy)


@pytest.mark.parametrize("goal", [False, True])
@pytest.mark.parametrize("name", IDS)
def test_check_env_has_nothing_to_say(name, goal, recwarn):
    env = gym.make(name, goal=goal).unwrapped
    check_env(env, skip_render_check=True)
    assert not [w.message for w in recwarn if "env" in str(w.message).lower()]


@pytest.mark.parametrize("name", IDS)
def test_stable_baselines_has_nothing_to_say(name, recwarn):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gym.make(name, goal=True).unwrapped)


@pytest.mark.parametrize("goal", [False, True])
@pytest.mark.parametrize("name", [*IDS, REACH, "tauguard:tauguard/TwoArms-v1"])
def test_native_copies_have_the_bits_of_single_environments(name, goal):
    keywords = {"max_episode_steps": 30, "goal": goal}
    sync = SyncVectorEnv([lambda: gym.make(name, **keywords)] * 2)
    native = gym.make_vec(name, num_envs=2, **keywords)
    assert isinstance(native.unwrapped, VectorArmEnv)
    same(sync.reset(seed=3), native.reset(seed=3), "reset")
    rng = np.random.default_rng(0)
    for k in range(45):
        actions = rng.uniform(-1, 1, native.action_space.shape).astype(np.float32)
        same(sync.step(actions), native.step(actions), f"step {k}")


def outcome(name, seed, **keywords):
    """Success, number of actions and last observation of the example's policy."""
    env = gym.make(name, **keywords)
    observation, info = env.reset(seed=seed)
    over, actions = False, 0
    while not (over or info["success"]):
        observation, _, terminated, truncated, info = env.step(policy_of(name)(observation))
        over, actions = terminated or truncated, actions + 1
    return info["success"], actions, observation


@pytest.mark.parametrize("name", IDS)
def test_the_examples_policies_succeed(name):
    assert all(outcome(name, seed)[0] for seed in range(3))


def test_another_process_gives_the_same_bits():
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); import pick, gymnasium, numpy\n"
        "envs = gymnasium.make_vec(pick.FROM_BELT, num_envs=2)\n"
        "o, _ = envs.reset(seed=1)\n"
        "for _ in range(40): o, *_ = envs.step(numpy.array([pick.policy(row) for row in o]))\n"
        "print(o.tobytes().hex())"
    )
    run = [sys.executable, "-c", code, str(EXAMPLES)]
    once, again = (subprocess.run(run, capture_output=True, text=True, check=True) for _ in "ab")
    assert once.stdout == again.stdout
    rows = np.frombuffer(bytes.fromhex(once.stdout)).reshape(2, -1)
    for seed, row in zip((1, 2), rows, strict=True):
        env = gym.make(pick.FROM_BELT)
        observation, _ = env.reset(seed=seed)
        for _ in range(40):
            observation, *_ = env.step(pick.policy(observation))
        np.testing.assert_array_equal(observation, row)


@pytest.mark.parametrize("name", IDS)
def test_snapshots_with_a_held_part_go_on_with_the_same_bits(name):
    env = gym.make(name, detector="observer").unwrapped
    observation, _ = env.reset(seed=0)
    for _ in range(25):
        observation, *_ = env.step(policy_of(name)(observation))
    state, actions = env.get_state(), np.random.default_rng(1).uniform(-1, 1, (20, 6))
    twins = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    expected = [env.step(action)[:2] for action in actions]
    env.reset(seed=9)
    env.set_state(state)
    for one in (env, *twins):
        for (seen, reward), action in zip(expected, actions, strict=True):
            observation, paid, *_ = one.step(action)
            np.testing.assert_array_equal(observation, seen)
            assert paid == reward


def test_a_held_part_does_not_move_in_the_hand():
    env = gym.make(hand_over.HAND_OVER).unwrapped
    env.reset(seed=0)
    tool = env.compiled.tools[0][1]

    def relative():
        turned = env.data.xmat[tool].reshape(3, 3)
        return turned.T @ (env.batch.where(0, "part") - env.data.xpos[tool])

    before = relative()
    for action in np.random.default_rng(0).uniform(-1, 1, (60, 6)):
        env.step(action)
    assert np.linalg.norm(relative() - before) < 2e-3  # a soft constraint [m]
    env.batch.release(0, "part")
    env.step(np.zeros(6))
    assert np.linalg.norm(relative() - before) > 5e-3  # it falls 12 mm in an action
    with pytest.raises(ValueError, match="expected a graspable object: part"):
        env.batch.grasp(0, "block")


class Branching(Reach):
    """Scores one copy only."""

    def score(self, step, memory):
        if step.distance < 0.1:
            return Outcome({"progress": 1.0, "target": 0.0}, True, memory)
        return super().score(step, memory)


class Minimum(Reach):
    """Scores arrays, but not as it scores one copy."""

    def score(self, step, memory):
        reached = step.distance < np.mean(step.distance)
        return Outcome({"progress": 0.0 * memory, "target": 1.0 * reached}, reached, memory)


class Wrong(Reach):
    """Measures something else than it says."""

    measures = ("height",)

    def measure(self, i):
        return {"depth": 1.0}


class Reserved(Reach):
    """Measures under a name that is taken."""

    measures = ("force",)


class Short(Reach):
    """Observes fewer numbers than it says."""

    @classmethod
    def entries(cls, compiled):
        return [Entry("a", 0.0, 1.0, "m"), Entry("b", 0.0, 1.0, "m")]

    def observe(self, i):
        return [0.0]


@pytest.mark.parametrize(("task", "said"), [(Branching, "np.where"), (Minimum, "target")])
def test_a_task_that_cannot_score_arrays_is_refused_by_the_vector_only(task, said):
    gym.make(REACH, task=task).reset(seed=0)
    with pytest.raises(ValueError, match=f"task {task.__name__}: score.*{said}"):
        gym.make_vec(REACH, num_envs=3, task=task)


@pytest.mark.parametrize(
    ("task", "said"),
    [
        (Wrong, "returned depth; expected height"),
        (Reserved, "'force'; expected a new name"),
        (Short, r"shape \(1,\), expected \(2,\): a, b"),
        (Reach(gym.make(REACH).unwrapped.batch), "not an object"),
        ("nowhere:Task", "expected module:Name"),
        ("tauguard.envs.tasks:Task2", "Task2"),
    ],
)
def test_what_is_wrong_with_a_task_is_said(task, said):
    with pytest.raises(ValueError, match=said):
        gym.make(REACH, task=task).reset(seed=0)


def test_a_task_can_be_named_and_registered():
    register("mine/Reach-v3", "tauguard.envs.tasks:CarefulReach", max_episode_steps=7)
    named, own = gym.make("mine/Reach-v3"), gym.make(REACH, task="tauguard.envs.tasks:CarefulReach")
    same(named.reset(seed=1)[0], own.reset(seed=1)[0], "reset")
    assert "reward_contact" in named.step(np.zeros(6))[-1]
    with pytest.raises(ValueError, match="expected a subclass"):
        register("mine/Reach-v4", gym.Env)


@pytest.mark.parametrize("name", [REACH, "tauguard:tauguard/TwoArms-v1", pick.PICK])
def test_rewards_of_goals_and_observations_without_them(name):
    env = gym.make(name, goal=True).unwrapped
    begun = env.reset(seed=0)[0]
    other = env.reset(seed=0, options={"target": begun["desired_goal"] + 0.1})[0]
    np.testing.assert_array_equal(begun["observation"], other["observation"])
    np.testing.assert_allclose(other["desired_goal"], begun["desired_goal"] + 0.1)
    rows, rewards = [], []
    for action in np.random.default_rng(0).uniform(-1, 1, (20, *env.action_space.shape)):
        seen, reward, *_, info = env.step(action)
        assert info["reward_goal"] == reward
        rows.append(seen)
        rewards.append(reward)
    reached, wanted = (np.array([r[f"{k}_goal"] for r in rows]) for k in ("achieved", "desired"))
    np.testing.assert_array_equal(env.compute_reward(reached, wanted, {}), rewards)
    assert env.compute_reward(wanted[0], wanted[0], {}) == 0.0
    assert env.compute_reward(wanted[0] + 1.0, wanted[0], {}) == -1.0
    with pytest.raises(ValueError, match="expected one shape"):
        env.compute_reward(reached, wanted[0], {})


def test_targets_of_ones_own():
    env = gym.make(REACH)
    _, info = env.reset(seed=0, options={"target": (0.3, 0.3, 0.3)})
    np.testing.assert_array_equal(env.unwrapped.batch.target[0, 0], 0.3)
    tool = env.unwrapped.batch.observation[0, 18:21]
    assert info["distance"] == pytest.approx(np.linalg.norm(tool - 0.3))
    envs = gym.make_vec(REACH, num_envs=2)
    places = np.array([[0.3, 0.3, 0.3], [0.4, 0.2, 0.5]])
    envs.reset(seed=0, options={"target": places})
    np.testing.assert_array_equal(envs.unwrapped.batch.target[:, 0], places)
    for wrong in ((0.3, 0.3), "there", (0.3, np.nan, 0.3)):
        with pytest.raises(ValueError, match=r"target .*shape \(3,\) or \(1, 3\)"):
            env.reset(options={"target": wrong})


def dropped(seconds=3.0, **keywords):
    """An environment with a ball that is not supported, after some time."""
    env = gym.make(REACH, obstacles=(), objects=(BALL,), **keywords)
    env.reset(seed=0)
    for _ in range(round(100 * seconds)):
        *_, over, _, info = env.step(np.zeros(6))
        if over:
            break
    return env.unwrapped, info


def test_the_floor_holds_what_falls_and_the_picture_shows_it_there():
    env, _ = dropped()
    floor = env.model.geom("ground")
    assert env.batch.where(0, "ball")[2] == pytest.approx(floor.pos[2] + 0.05, abs=2e-3)
    shown = mujoco.MjModel.from_xml_string(env.scene.xml)
    np.testing.assert_array_equal(shown.geom("ground").pos, floor.pos)
    assert dropped(floor=-2.0)[0].batch.where(0, "ball")[2] == pytest.approx(-1.95, abs=5e-3)
    assert dropped(floor=False)[0].batch.where(0, "ball")[2] < -40


def test_an_arm_alone_has_the_bits_it_had_without_a_floor():
    rows = []
    for objects, floor in (((), True), ((BALL,), -2.0), ((BALL,), False)):
        env = gym.make(REACH, obstacles=(), objects=objects, floor=floor)
        env.reset(seed=0)
        rows.append([env.step(np.full(6, 0.3))[0][:18] for _ in range(30)])
    np.testing.assert_array_equal(rows[0], rows[1])
    np.testing.assert_array_equal(rows[0], rows[2])


def test_what_leaves_the_workspace_ends_the_episode_or_begins_again():
    env, info = dropped(leaving="end")
    assert info["reason"] == "ball left the workspace"
    assert info["time"] < 1.0
    env, _ = dropped(leaving="reset", workspace=((-2, -2, -0.6), (2, 2, 2)))
    assert -0.65 < env.batch.where(0, "ball")[2] <= -0.3
    vector = gym.make_vec(
        REACH,
        num_envs=2,
        autoreset_mode=AutoresetMode.NEXT_STEP,
        obstacles=(),
        objects=(BALL,),
        leaving="end",
    )
    vector.reset(seed=0)
    for _ in range(100):
        *_, over, _, infos = vector.step(np.zeros((2, 6)))
        if over.any():
            break
    assert list(infos["reason"]) == ["ball left the workspace"] * 2
    for wrong, said in (({"leaving": "stop"}, "None, end, reset"), ({"workspace": 3}, "corner")):
        with pytest.raises(ValueError, match=said):
            gym.make(REACH, **wrong)
