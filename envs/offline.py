"""Write episodes of a policy as a Minari dataset for offline learning (extra ``export``)."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

import tauguard  # noqa: F401  (registers the environments)
from tauguard.arrays import Array
from tauguard.extras import extra
from tauguard.findings import ArgumentError

#: Keys of ``info`` that are stored at every step.
KEYS = ("cost", "success", "force", "limit_ratio", "tau_ext_peak")


def record_policy(
    name: str,
    policy: Callable[[Array], Any],
    dataset: str,
    episodes: int = 10,
    seed: int = 0,
    **keywords: Any,
) -> int:
    """Play a policy and write its episodes into Minari's folder; returns the number of episodes.

    Args:
        name: name of the environment, such as "tauguard/Reach-v0".
        policy: maps an observation to an action.
        dataset: Minari's id, ``namespace/name-v0``.
        episodes: number of episodes; episode i has the seed ``seed + i``.
        seed: seed of the first episode.
        **keywords: keywords of the environment, and ``max_episode_steps``.

    Raises:
        ArgumentError: Minari is not installed or has a dataset of that name, or ``episodes`` is
            below 1.
    """
    try:
        import minari
    except ImportError:
        raise ArgumentError(f"Minari needs {extra('export')}") from None
    if episodes < 1:
        raise ArgumentError(f"episodes {episodes}: expected 1 or more")
    if dataset in minari.list_local_datasets():
        raise ArgumentError(f"{dataset}: Minari has a dataset of that name; name another version")
    env = gymnasium.make(name, **keywords)
    try:  # record all episodes first, so that a stored dataset is complete
        buffers = [_episode(env, policy, number, seed + number) for number in range(episodes)]
        minari.create_dataset_from_buffers(
            dataset, buffers, env=env, algorithm_name=getattr(policy, "__name__", "policy")
        )
    finally:
        env.close()
    return episodes


def _episode(
    env: gymnasium.Env[Array, Array], policy: Callable[[Array], Any], number: int, seed: int
) -> Any:
    """Run one episode; it has one observation and one row of infos more than actions."""
    from minari.data_collector import EpisodeBuffer

    observation, info = env.reset(seed=seed)
    seen, infos, actions, outcomes = [observation], [info], [], []
    over = False
    while not over:
        action: Any = np.clip(np.asarray(policy(observation), dtype=np.float32), -1.0, 1.0)
        observation, reward, terminated, truncated, info = env.step(action)
        seen.append(observation)
        infos.append(info)
        actions.append(action)
        outcomes.append((float(reward), terminated, truncated))
        over = terminated or truncated
    rewards, terminations, truncations = (np.array(part) for part in zip(*outcomes, strict=True))
    return EpisodeBuffer(
        id=number,
        seed=seed,
        observations=np.array(seen),
        actions=np.array(actions),
        rewards=rewards,
        terminations=terminations,
        truncations=truncations,
        infos={key: np.array([info[key] for info in infos]) for key in KEYS},
    )
