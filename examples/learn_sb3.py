"""Learn to reach with Stable-Baselines3's PPO: `uv run --extra learn python examples/learn_sb3.py`.

Prints the return over training, and that of the mean action afterwards.
"""

import argparse

import gymnasium as gym
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecNormalize

ENV = "tauguard:tauguard/Reach-v0"
KEYWORDS = {"max_speed": 1.0}


def main():
    """Train, then play one episode in every copy with the mean action."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=400_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    envs = make_vec_env(
        lambda: gym.wrappers.TimeLimit(gym.make(ENV, **KEYWORDS), 250), 8, seed=options.seed
    )
    envs = VecNormalize(envs)
    model = PPO("MlpPolicy", envs, n_steps=512, batch_size=512, gamma=0.98, seed=options.seed)
    rounds = 10
    for _ in range(rounds):
        model.learn(options.steps // rounds, reset_num_timesteps=False)
        returns = [episode["r"] for episode in model.ep_info_buffer]
        print(f"{model.num_timesteps:8d} steps: return {np.mean(returns):6.2f}")
    envs.training, envs.norm_reward = False, False
    observation, total = envs.reset(), 0.0
    for _ in range(250):
        action, _ = model.predict(observation, deterministic=True)
        observation, reward, _, _ = envs.step(action)
        total += reward
    print(f"mean return of one more episode in each of 8 copies: {np.mean(total):.2f}")


if __name__ == "__main__":
    main()
