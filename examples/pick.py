"""Two tasks of one's own: pick parts from a belt beside a person; bring a part to a goal.

    uv run python examples/pick.py 60 pick.png

plays a simple policy for 60 s, prints how many parts it picked and what the person felt, and draws
a picture. `examples/learn_goals.py` learns the second task.
"""

import sys

import gymnasium as gym
import numpy as np

import tauguard  # noqa: F401
from tauguard.envs.tasks import Entry, Outcome, Task, register, tool_position
from tauguard.models import SceneObject, Shape

TOP, HALF = 0.25, 0.025  # height of belt and table; half edge of the part [m]
GRIP = 0.04  # the vacuum cup holds from this distance of the part's upper face on [m]
BOARD = Shape("box", (0.13, 0.6, 0.02))
PART = SceneObject(
    "part",
    (Shape("box", (HALF,) * 3, rgba=(0.9, 0.5, 0.1, 1.0)),),
    position=(0.5, 0.0, TOP + HALF),
    motion="free",
    mass=0.2,
    graspable=True,
)


class Pick(Task):
    """Bring the part from the table to the target, and end there."""

    defaults = {
        "control": "cartesian",
        "control_rate": 10.0,
        "objects": (PART, SceneObject("table", (BOARD,), position=(0.5, 0.0, TOP - 0.02))),
    }
    terms = ("progress", "done", "cost")
    measures = ("gap", "part_distance", "held")
    ended = "the part is at the target"
    options = {"begin_held": 0.0}  # fraction of the episodes that begin with the part in the cup
    tolerance = 0.05
    begin_low, begin_high = (0.42, -0.08), (0.58, 0.08)  # where the part lies (x, y) [m]
    goal_low, goal_high = (0.4, -0.15, TOP + 0.1), (0.6, 0.15, TOP + 0.25)  # [m]

    def __init__(self, batch, begin_held):
        super().__init__(batch)
        self.begin_held = begin_held
        self.above = self.joints_at(np.array([0.5, 0.0, TOP + 0.1]))

    def start(self, i, rng):
        """Put the tool above the table, and the part and its target at drawn places."""
        batch = self.batch
        batch.place(i, self.above)
        self.spawn(i, rng)
        batch.send_people(i, rng)
        batch.start(i)
        if rng.random() < self.begin_held:
            batch.put(i, "part", self.tool(i) - [0.0, 0.0, HALF])
            batch.grasp(i, "part")
        self.memory[i] = np.nan  # of the last action: there is none yet

    def spawn(self, i, rng):
        x, y = rng.uniform(self.begin_low, self.begin_high)
        self.batch.put(i, "part", (x, y, TOP + HALF))
        self.batch.target[i, 0] = rng.uniform(self.goal_low, self.goal_high)

    def measure(self, i):
        """Distances; the cup holds a part that it touches."""
        batch, part = self.batch, self.achieved(i)
        gap = np.linalg.norm(self.face(part) - self.tool(i))
        if gap < GRIP and not batch.grasped(i, "part"):
            batch.grasp(i, "part")
        away = np.linalg.norm(self.desired(i) - part)
        return {"gap": gap, "part_distance": away, "held": float(batch.grasped(i, "part"))}

    def score(self, step, memory):
        """How much nearer: of the tool to the part, and of the part to the target."""
        left = step.gap * (1 - step.held) + step.part_distance
        before = np.where(np.isnan(memory), left, memory)
        done = (step.part_distance < self.tolerance) & (step.held > 0)
        rewards = {"progress": before - left, "done": 1.0 * done, "cost": -step.cost}
        return Outcome(rewards, done, left, done)

    @classmethod
    def entries(cls, compiled):
        rows = [Entry(f"part less tool, {axis}", -2.0, 2.0, "m") for axis in "xyz"]
        rows += [Entry(f"target less part, {axis}", -2.0, 2.0, "m", goal=True) for axis in "xyz"]
        return [*rows, Entry("part is held", 0.0, 1.0, "")]

    def observe(self, i):
        part, held = self.achieved(i), self.batch.grasped(i, "part")
        return [*(self.face(part) - self.tool(i)), *(self.desired(i) - part), float(held)]

    def achieved(self, i):
        return self.batch.where(i, "part")

    def tool(self, i):
        return tool_position(self.batch.compiled, self.batch.datas[i])

    @staticmethod
    def face(part):
        """The middle of the upper face of the part [m]."""
        return part + [0.0, 0.0, HALF]


class PickFromBelt(Pick):
    """Parts come on a belt beside a person; the next one comes when one is delivered."""

    defaults = Pick.defaults | {
        "obstacles": ("person",),
        "control_rate": 20.0,
        "leaving": "reset",
        "workspace": ((-1.0, -1.0, TOP - 0.1), (1.0, 1.0, 2.0)),
        "objects": (
            PART,
            SceneObject("belt", (BOARD,), position=(0.5, 0.0, TOP - 0.02), belt=(0.0, 0.1, 0.0)),
        ),
    }
    begin_low, begin_high = (0.45, -0.5), (0.55, -0.45)
    goal_low, goal_high = (0.2, 0.4, TOP + 0.1), (0.3, 0.5, TOP + 0.15)

    @classmethod
    def person(cls, bare, layout):
        return layout.someone(1.2, 0.0, np.pi)

    def score(self, step, memory):
        return super().score(step, memory)._replace(terminated=step.held < 0)

    def after(self, i, rng):
        """Deliver the part: the next one comes."""
        self.spawn(i, rng)
        self.memory[i] = np.nan


PICK, FROM_BELT = "examples/Pick-v0", "examples/PickFromBelt-v0"
register(PICK, Pick, max_episode_steps=40)
register(FROM_BELT, PickFromBelt, max_episode_steps=1200)


def policy(observation):
    """Down onto the part, which it follows; with the part up, then to the target."""
    part, target, held = observation[-7:-4], observation[-4:-1], observation[-1]
    if held:
        way = np.array(target)
        way[2] = target[2] if np.linalg.norm(target[:2]) < 0.1 else max(target[2], 0.0)
    else:
        way = np.array(part) + [0.0, 0.02, 0.0]
        way[2] += 0.0 if np.linalg.norm(part[:2]) < 0.03 else 0.06
    return np.append(np.clip(4.0 * way / 0.5, -1.0, 1.0), np.zeros(3))


def main(seconds=30.0, picture=None):
    env = gym.make(FROM_BELT, render_mode="rgb_array" if picture else None)
    observation, info = env.reset(seed=0)
    picked, cost, worst = 0, 0.0, 0.0
    for _ in range(round(seconds * 20)):
        observation, _, _, truncated, info = env.step(policy(observation))
        picked, cost = picked + info["success"], cost + info["cost"]
        worst = max(worst, info["limit_ratio"])
        if picture and info["held"] and info["part_distance"] < 0.3:
            from PIL import Image

            Image.fromarray(env.render()).save(picture)
            picture = None
        if truncated:
            observation, info = env.reset()
    env.close()
    print(f"{picked} parts in {seconds:g} s; cost {cost:.2f} N s, {worst:.2f} of a limit")
    return picked


if __name__ == "__main__":
    main(*map(float, sys.argv[1:2]), *sys.argv[2:])
