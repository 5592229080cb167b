"""A task of one's own: hand a part to a person who reaches out for it.

    uv run python examples/hand_over.py 10 hand_over.png

plays 10 episodes of a simple policy, prints how many ended with the part in the person's hand and
what the person felt, and draws a picture.
"""

import sys

import gymnasium as gym
import numpy as np
from pick import HALF, PART

import tauguard  # noqa: F401
from tauguard.envs.tasks import Entry, Outcome, Task, register, tool_position

NEAR, SLOW = 0.12, 0.1  # the person takes the part at this distance [m] and below this speed [m/s]
WAITS = 20.0  # how long the hand stays where it was reached out to [s]


class HandOver(Task):
    """Bring the part to the hand, slowly at the end, within the limits of the person."""

    defaults = {
        "control": "cartesian",
        "control_rate": 20.0,
        "obstacles": ("person",),
        "objects": (PART,),
    }
    terms = ("progress", "taken", "cost")
    measures = ("hand_distance", "part_speed")
    ended = "the person has the part"

    def __init__(self, batch):
        super().__init__(batch)
        regions = batch.compiled.regions
        self.hands = [r.body for r in regions if r.mocap >= 0 and r.name.endswith("hand")]
        self.before = np.zeros((batch.rows, 3))

    def start(self, i, rng):
        """Begin near home with the part in the cup; the person reaches out to a drawn place."""
        batch = self.batch
        home = batch.compiled.scene.home
        batch.place(i, home + rng.uniform(-0.1, 0.1, len(home)))
        batch.put(i, "part", (0.0, 0.0, 3.0))
        batch.target[i, 0] = rng.uniform((0.5, -0.25, 0.3), (0.65, 0.25, 0.5))
        batch.send_people(i, rng)
        batch.start(i)
        batch.put(i, "part", tool_position(batch.compiled, batch.datas[i]) - [0.0, 0.0, HALF])
        batch.grasp(i, "part")
        batch.plants[i].aim(batch.target[i, 0], WAITS)
        self.before[i], self.memory[i] = self.achieved(i), np.nan

    def measure(self, i):
        data, part = self.batch.datas[i], self.achieved(i)
        speed = np.linalg.norm(part - self.before[i]) * self.batch.compiled.settings.control_rate
        self.before[i] = part
        away = np.linalg.norm(data.xpos[self.hands] - part, axis=1).min()
        return {"hand_distance": away, "part_speed": speed}

    def score(self, step, memory):
        taken = (step.hand_distance < NEAR) & (step.part_speed < SLOW) & (step.time > 0.5)
        before = np.where(np.isnan(memory), step.hand_distance, memory)
        rewards = {
            "progress": before - step.hand_distance,
            "taken": 1.0 * taken,
            "cost": -step.cost,
        }
        return Outcome(rewards, taken, step.hand_distance, taken)

    @classmethod
    def entries(cls, compiled):
        return [Entry(f"nearest hand less part, {axis}", -3.0, 3.0, "m") for axis in "xyz"]

    def observe(self, i):
        ways = self.batch.datas[i].xpos[self.hands] - self.achieved(i)
        return ways[np.argmin(np.linalg.norm(ways, axis=1))]

    def achieved(self, i):
        return self.batch.where(i, "part")

    def get_state(self):
        return self.before.copy()

    def set_state(self, state):
        self.before[:] = state


HAND_OVER = "examples/HandOver-v0"
register(HAND_OVER, HandOver, max_episode_steps=200)


def policy(observation):
    """Towards the hand; slower when it is near."""
    way = observation[-3:]
    away = np.linalg.norm(way)
    speed = min(0.4, 1.5 * max(0.0, away - 0.08))
    return np.append(speed * way / max(away, 1e-9) / 0.5, np.zeros(3))


def main(episodes=10, picture=None):
    env = gym.make(HAND_OVER, render_mode="rgb_array" if picture else None)
    handed, cost, worst = 0, 0.0, 0.0
    for seed in range(int(episodes)):
        observation, info = env.reset(seed=seed)
        over = False
        while not over:
            observation, _, terminated, truncated, info = env.step(policy(observation))
            over, worst = terminated or truncated, max(worst, info["limit_ratio"])
        handed, cost = handed + info["success"], cost + info["cost_sum"]
        if picture and info["success"]:
            from PIL import Image

            Image.fromarray(env.render()).save(picture)
            picture = None
    env.close()
    print(f"{handed} of {episodes} handed over; cost {cost:.2f} N s, {worst:.2f} of a limit")
    return handed


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]), *sys.argv[2:])
