"""Write Minari datasets (extra ``export``): each sample is one step."""

import warnings
from collections.abc import Iterable
from typing import Any

import numpy as np

from tauguard.extras import extra
from tauguard.findings import ArgumentError
from tauguard.traces import Trace

#: Minari's warnings that author, code and environments are not given.
NOT_GIVEN = r"`(code_permalink|author|author_email|eval_env)` is set to None|env_spec is None"


def write_minari(traces: Iterable[Trace], name: str, rate: int) -> int:
    """Write traces with truth as a dataset into Minari's folder; returns the number of episodes.

    The observation is (q, qd, current), the action is the references (q_des, qd_des), the reward
    is 0. ``infos`` has the truth: ``tau_ext``, ``contact_force`` (x, y, z) and ``contact_link``.
    Each trace is one episode, truncated at its last step.

    Args:
        traces: one per episode, all with the same number of joints.
        name: Minari's id, ``namespace/name-v0``.
        rate: sample rate of the traces [Hz], for the description.

    Raises:
        ArgumentError: Minari is not installed or has a dataset of this name, there are no traces,
            or traces have no truth.
    """
    try:
        import minari
    except ImportError:
        raise ArgumentError(f"Minari needs {extra('export')}") from None
    from gymnasium.spaces import Box

    if name in minari.list_local_datasets():
        raise ArgumentError(f"{name}: Minari has a dataset of that name; name another version")
    dataset: Any = None
    count = 0
    for trace in traces:
        buffer = _buffer(trace, count)
        if dataset is None:
            n = len(trace.joint_names)
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", NOT_GIVEN, UserWarning)
                dataset = minari.create_dataset_from_buffers(
                    name,
                    [buffer],
                    observation_space=Box(-np.inf, np.inf, (3 * n,), np.float32),
                    action_space=Box(-np.inf, np.inf, (2 * n,), np.float32),
                    algorithm_name="tauguard",
                    description=f"Simulated arm motion with labelled collisions, {rate} Hz.",
                )
        else:
            dataset.update_dataset_from_buffer([buffer])
        count += 1
    if not count:
        raise ArgumentError("no episodes to export")
    return count


def _buffer(trace: Trace, number: int) -> Any:
    """One episode; Minari expects one more observation, and one more row of infos, than actions."""
    from minari.data_collector import EpisodeBuffer

    truth = trace.truth
    if truth is None or trace.q_des is None or trace.qd_des is None:
        raise ArgumentError("a trace without truth or references cannot be exported to Minari")
    seen = np.hstack([trace.q, trace.qd, trace.current]).astype(np.float32)
    wanted = np.hstack([trace.q_des, trace.qd_des]).astype(np.float32)
    steps = len(seen) - 1
    return EpisodeBuffer(
        id=number,
        seed=int(trace.meta["seed"]) % 2**31 if "seed" in trace.meta else None,
        observations=seen,
        actions=wanted[:-1],
        rewards=np.zeros(steps),
        terminations=np.zeros(steps, bool),
        truncations=np.arange(steps) == steps - 1,
        infos={
            "tau_ext": truth.tau_ext.astype(np.float32),
            "contact_force": truth.contact_vector.astype(np.float32),
            "contact_link": truth.contact_link,
        },
    )
