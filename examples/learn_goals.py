"""Learn a goal-conditioned pick by hindsight experience replay (HER) with SAC.

    uv run --extra learn python examples/learn_goals.py --minutes 10

The task is `Pick` of `examples/pick.py`. The policy moves the tool and does not turn it. Half of
the episodes of the training begin with the part in the vacuum cup, as in Andrychowicz et al.,
"Hindsight experience replay" (2017). The curve is the success rate of other episodes, which all
begin with the part on the table. The time is the processor time of this program.
"""

import argparse
import time

import numpy as np
import pick
import torch
from gymnasium import spaces
from stable_baselines3 import SAC, HerReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnvWrapper

from tauguard.envs.stable_baselines import NativeVecEnv

#: Keywords of the environment; the coarse time step halves the time of the simulation [s].
KEYWORDS = {"goal": True, "timestep": 2e-3, "max_episode_steps": 40}


class Straight(VecEnvWrapper):
    """Actions are the three velocities of the tool; it does not turn."""

    def __init__(self, copies, **keywords):
        envs = NativeVecEnv(pick.PICK, copies, keys=("is_success",), **KEYWORDS, **keywords)
        super().__init__(envs, action_space=spaces.Box(-1.0, 1.0, (3,), np.float32))

    def reset(self):
        return self.venv.reset()

    def step_async(self, actions):
        self.venv.step_async(np.pad(actions, ((0, 0), (0, 3))))

    def step_wait(self):
        return self.venv.step_wait()


def success(model, episodes=40, seed=10_000):
    """Fraction of episodes in which the part reaches its goal."""
    envs = Straight(episodes)
    envs.seed(seed)
    seen, over, reached = envs.reset(), np.zeros(episodes, bool), np.zeros(episodes, bool)
    while not over.all():
        seen, _, ends, infos = envs.step(model.predict(seen, deterministic=True)[0])
        reached |= ~over & [bool(info["is_success"]) for info in infos]
        over |= ends
    envs.close()
    return float(reached.mean())


class Curve(BaseCallback):
    """Prints the success rate once a minute, and ends the training."""

    def __init__(self, minutes):
        super().__init__()
        self.minutes, self.rows = minutes, []
        self.begun = self.paused = 0.0

    def _on_training_start(self):
        self.begun = time.process_time()

    def _on_step(self):
        begun = time.process_time()
        spent = (begun - self.begun - self.paused) / 60
        if spent >= len(self.rows) + 1:
            self.rows.append((spent, self.num_timesteps, success(self.model)))
            print("{:.1f} min, {} actions: success {:.2f}".format(*self.rows[-1]), flush=True)
            self.paused += time.process_time() - begun
        return spent < self.minutes


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    torch.set_num_threads(1)
    envs = Straight(8, begin_held=0.5)
    envs.seed(args.seed)
    model = SAC(
        "MultiInputPolicy",
        envs,
        replay_buffer_class=HerReplayBuffer,
        replay_buffer_kwargs={"n_sampled_goal": 4, "goal_selection_strategy": "future"},
        learning_starts=2000,
        batch_size=256,
        learning_rate=1e-3,
        gamma=0.95,
        tau=0.02,
        train_freq=1,
        gradient_steps=4,
        buffer_size=200_000,
        policy_kwargs={"net_arch": [128, 128]},
        seed=args.seed,
        device="cpu",
    )
    curve = Curve(args.minutes)
    model.learn(10**9, callback=curve)
    envs.close()
    return curve.rows


if __name__ == "__main__":
    main()
