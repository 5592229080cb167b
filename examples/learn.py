"""Train a policy by PPO, or by PPO with a budget of contact: the learned baselines.

    uv run --extra learn python examples/learn.py Reach-v0 --out policy.npz
    uv run tauguard watch Reach-v0 --policy policy.npz
    uv run python examples/baselines.py 20 1000 Reach-v0 policy.npz    # and the baselines

`--set NAME=VALUE` gives keywords of the environment, as in `--set objects=cell.toml`.

With a budget the method is PPO-Lagrangian (Ray, Achiam & Amodei, "Benchmarking safe exploration in
deep reinforcement learning", 2019). The reward of a step is reduced by lambda * min(1, cost /
budget); the minimum limits the effect of a hard impact. lambda grows while the mean cost of an
episode is above the budget, and falls otherwise. The cost is `info["cost"]` [N s]: the impulse of
forces beyond the limits of people and objects, and of forces between two arms.

`tauguard.envs.policies.MlpPolicy.load` loads the policy file without PyTorch.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnvWrapper, VecNormalize

from tauguard.cli.watch import parsed
from tauguard.envs.policies import MlpPolicy
from tauguard.envs.stable_baselines import NativeVecEnv

#: Keywords of every baseline: tool velocities, 20 actions per second, episodes of 5 s.
KEYWORDS = {"control": "cartesian", "control_rate": 20.0, "max_episode_steps": 100}
#: Time step of the training [s], coarser than that of the evaluation.
COARSE = 2e-3
#: Phases of a task's training: fraction of the steps, steps of a copy between updates, keywords.
#: A step with cloth takes ten times as long, so reaching is learned without cloth first.
LESSONS = {"ClothReach-v1": ((0.8, 256, {"cloth": None}), (0.2, 64, {}))}
USUAL = ((1.0, 256, {}),)
TASKS = ("Reach-v0", "React-v1", "ClothReach-v1", "TwoArms-v1")


class Priced(VecEnvWrapper):
    """Subtracts lambda * min(1, cost / budget) from rewards; keeps the costs of whole episodes."""

    def __init__(self, envs, budget):
        super().__init__(envs)
        self.budget, self.price, self.episodes = budget, 0.0, []

    def reset(self):
        return self.venv.reset()

    def step_wait(self):
        seen, reward, over, infos = self.venv.step_wait()
        cost = np.array([info["cost"] for info in infos])
        self.episodes += [infos[i]["cost_sum"] for i in np.flatnonzero(over)]
        spent = np.minimum(cost / self.budget, 1.0) if self.budget else 0.0
        return seen, reward - self.price * spent, over, infos


class Budget(BaseCallback):
    """Raises lambda if the mean cost of the last episodes is above the budget, else lowers it."""

    def __init__(self, priced, rate=0.1):
        super().__init__()
        self.priced, self.rate = priced, rate
        self.found = float("nan")  # mean cost of the last episodes [N s]

    def _on_step(self):
        return True

    def _on_rollout_end(self):
        if self.priced.episodes:
            self.found = float(np.mean(self.priced.episodes))
            if budget := self.priced.budget:
                change = self.rate * np.clip(self.found / budget - 1, -1, 1)
                self.priced.price = max(0.0, self.priced.price + change)
            print(
                f"\r{self.num_timesteps} steps, cost {self.found:.3f} N s an episode, "
                f"lambda {self.priced.price:.2f}  ",
                end="",
                flush=True,
            )
        self.priced.episodes.clear()


def train(task, budget=None, steps=200_000, seed=0, copies=16, start=None, **keywords):
    """The trained policy, its lambda, and the last episodes' mean cost [N s]."""
    torch.set_num_threads(1)
    policy = MlpPolicy.load(start) if start is not None else None
    keywords = KEYWORDS | keywords
    for share, rollout, about in LESSONS.get(task, USUAL):
        native = NativeVecEnv(
            f"tauguard/{task}", copies, **{"timestep": COARSE, **keywords, **about}
        )
        native.seed(seed)
        priced = Priced(native, budget)
        envs = VecNormalize(priced, gamma=0.98)
        rate, spread = (5e-4, -0.7) if policy is None else (3e-4, -1.2)
        model = PPO(
            "MlpPolicy", envs, n_steps=rollout, batch_size=512, n_epochs=6, gamma=0.98,
            gae_lambda=0.95, ent_coef=0.0, learning_rate=lambda left, most=rate: most * left,
            seed=seed, device="cpu",
            policy_kwargs={"net_arch": [64, 64], "log_std_init": spread},
        )  # fmt: skip
        if policy is not None:
            policy.to_sb3(model, envs)
        spent = Budget(priced)
        model.learn(round(share * steps), callback=spent)
        print()
        policy = replace(
            MlpPolicy.from_sb3(model, envs),
            environment={"id": f"tauguard:tauguard/{task}", **keywords},
        )
    return policy, priced.price, spent.found


def judge(policy, episodes=96, seed=1_000_000):
    """Success and mean cost of an episode [N s] of the policy without exploration."""
    keywords = dict(policy.environment)
    envs = NativeVecEnv(keywords.pop("id").removeprefix("tauguard:"), 16, **keywords)
    envs.seed(seed)
    seen, won, costs, wins = envs.reset(), np.zeros(16, dtype=bool), [], []
    while len(costs) < episodes:
        seen, _, over, infos = envs.step(policy(seen))
        won |= [info["success"] for info in infos]
        for i in np.flatnonzero(over):
            costs.append(infos[i]["cost_sum"])
            wins.append(won[i])
        won[over] = False
    return np.mean(wins), np.mean(costs)


def main():
    """Train and save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("task", choices=TASKS)
    parser.add_argument(
        "--budget", type=float, help="mean cost of an episode of 5 s [N s] (default: none)"
    )
    parser.add_argument("--start", type=Path, help="policy file to continue from (default: none)")
    parser.add_argument("--robot", default="cura6", help="arm: a name, or a file (%(default)s)")
    parser.add_argument(
        "--set", nargs="+", default=[], metavar="NAME=VALUE", help="keywords of the environment"
    )
    parser.add_argument(
        "--steps", type=int, default=200_000, help="actions to learn from (%(default)s)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of all random numbers (%(default)s)")
    parser.add_argument(
        "--out", type=Path, default=Path("policy.npz"), help="file to write (%(default)s)"
    )
    options = parser.parse_args()
    if options.budget is not None and options.task == "ClothReach-v1":
        parser.error("--budget: ClothReach-v1 has no people, so no action has a cost")
    if options.budget is not None and not options.budget > 0:
        parser.error(f"--budget {options.budget:g}: expected more than 0 N s")
    policy, price, _ = train(
        options.task, options.budget, options.steps, options.seed,
        start=options.start, robot=options.robot, **parsed(options.set),
    )  # fmt: skip
    policy.save(options.out)
    success, cost = judge(policy)
    print(
        f"{options.out}: {policy}, lambda {price:.2f}; {success:.2f} of 96 fresh episodes reach "
        f"the goal, cost {cost:.3f} N s each"
    )
    print(f"see it move: tauguard watch {options.task} --policy {options.out}")
    if options.budget is not None and cost > options.budget:
        print(f"the budget of {options.budget:g} N s is not met: more --steps, or a larger budget")


if __name__ == "__main__":
    main()
