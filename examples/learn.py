"""Train a policy by PPO, or by PPO with a budget of contact: the learned baselines.

    uv run --extra learn python examples/learn.py Reach-v0 --budget 0.2 --out policy.npz
    uv run python examples/baselines.py 20 1000 Reach-v0 policy.npz    # beside the baselines

With a budget it is PPO-Lagrangian (Ray, Achiam & Amodei, "Benchmarking safe exploration in deep
reinforcement learning", 2019): each step's reward is reduced by lambda times its cost, and lambda
grows while an episode's mean cost is above the budget. The cost is the force on the arm over 100 N,
at most 1, times the step's duration: seconds in hard contact. The file that it writes loads with
`tauguard.envs.policies.MlpPolicy.load`, without PyTorch.
"""

import argparse
from pathlib import Path

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnvWrapper, VecNormalize

from tauguard.envs.policies import MlpPolicy
from tauguard.envs.stable_baselines import NativeVecEnv

#: Of every baseline: tool velocities, 20 actions a second, episodes of 5 s; a coarse time step.
KEYWORDS = {
    "control": "cartesian",
    "control_rate": 20.0,
    "timestep": 2e-3,
    "max_episode_steps": 100,
}
TASKS = ("Reach-v0", "React-v1", "ClothReach-v1", "TwoArms-v1")
#: Force that counts as hard contact [N].
HARD = 100.0


class Priced(VecEnvWrapper):
    """Rewards less lambda times the cost; keeps the costs of whole episodes."""

    def __init__(self, envs, period):
        super().__init__(envs)
        self.price, self.period = 0.0, period
        self.running, self.episodes = np.zeros(envs.num_envs), []

    def reset(self):
        self.running[:] = 0
        return self.venv.reset()

    def step_wait(self):
        seen, reward, over, infos = self.venv.step_wait()
        force = np.array([info["force"] for info in infos])
        cost = self.period * np.minimum(force / HARD, 1.0)
        self.running += cost
        self.episodes += self.running[over].tolist()
        self.running[over] = 0
        return seen, reward - self.price * cost, over, infos


class Budget(BaseCallback):
    """Raises lambda while the mean cost of the last episodes is above the budget."""

    def __init__(self, priced, budget, rate=4.0):
        super().__init__()
        self.priced, self.budget, self.rate = priced, budget, rate
        self.found = float("nan")  # seconds in hard contact of the last episodes, a mean

    def _on_step(self):
        return True

    def _on_rollout_end(self):
        if self.priced.episodes:
            self.found = float(np.mean(self.priced.episodes))
            if self.budget is not None:
                excess = self.found - self.budget
                self.priced.price = max(0.0, self.priced.price + self.rate * excess)
            print(
                f"\r{self.num_timesteps} steps, {self.found:.2f} s in hard contact an episode, "
                f"lambda {self.priced.price:.1f}  ",
                end="",
                flush=True,
            )
        self.priced.episodes.clear()


def train(task, budget=None, steps=200_000, seed=0, copies=16):
    """The trained policy, its lambda, and the last episodes' seconds in hard contact."""
    torch.set_num_threads(1)
    native = NativeVecEnv(f"tauguard/{task}", copies, **KEYWORDS)
    native.seed(seed)
    priced = Priced(native, 1 / KEYWORDS["control_rate"])
    envs = VecNormalize(priced, gamma=0.98)
    model = PPO(
        "MlpPolicy", envs, n_steps=256, batch_size=512, n_epochs=6, gamma=0.98, gae_lambda=0.95,
        ent_coef=0.0, learning_rate=lambda left: 5e-4 * left, seed=seed, device="cpu",
        policy_kwargs={"net_arch": [64, 64], "log_std_init": -0.7},
    )  # fmt: skip
    spent = Budget(priced, budget)
    model.learn(steps, callback=spent)
    print()
    return MlpPolicy.from_sb3(model, envs), priced.price, spent.found


def main():
    """Train and save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("task", choices=TASKS)
    parser.add_argument(
        "--budget", type=float, help="seconds in hard contact an episode of 5 s (default: none)"
    )
    parser.add_argument("--steps", type=int, default=200_000, help="actions to learn from")
    parser.add_argument("--seed", type=int, default=0, help="of everything drawn")
    parser.add_argument("--out", type=Path, default=Path("policy.npz"), help="file to write")
    options = parser.parse_args()
    policy, price, hard = train(options.task, options.budget, options.steps, options.seed)
    policy.save(options.out)
    print(f"{options.out}: {policy}, lambda {price:.2f}, {hard:.2f} s in hard contact an episode")
    if options.budget is not None and hard > options.budget:
        print(f"the budget of {options.budget:g} s is not met: more --steps, or a larger budget")


if __name__ == "__main__":
    main()
