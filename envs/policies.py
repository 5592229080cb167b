"""Trained policies as plain files: a small network in NumPy, without pickle and without PyTorch."""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array
from tauguard.untrusted_input import reading

#: Observations are normalised and clipped to this many standard deviations, as VecNormalize does.
CLIP = 10.0
#: Number of observations that a loaded policy's statistics stand for when training continues.
SEEN = 1e5


@dataclass(frozen=True, eq=False)
class MlpPolicy:
    """Layers with tanh between them, after a normalisation of the observation.

    ``policy(observation)`` is the action, shape (m,); of observations (N, size) it is (N, m).
    """

    mean: Array  #: of the observation, shape (size,)
    deviation: Array  #: shape (size,)
    weights: tuple[Array, ...]  #: of each layer, shape (outputs, inputs)
    biases: tuple[Array, ...]  #: shape (outputs,)
    #: Where it was trained, as ``gymnasium.make(**policy.environment)`` takes it: ``id`` and
    #: keywords; empty where that is not known.
    environment: Mapping[str, Any] = field(default_factory=dict)

    def __call__(self, observation: ArrayLike) -> Array:
        """The action, within [-1, 1].

        Raises:
            ValueError: an observation of another size.
        """
        seen = np.asarray(observation, dtype=float)
        if seen.shape[-1] != len(self.mean):
            raise ValueError(
                f"observation of {seen.shape[-1]} numbers: the policy expects {len(self.mean)}; "
                f"make the environment with the keywords of its training, {dict(self.environment)}"
            )
        x = np.clip((seen - self.mean) / self.deviation, -CLIP, CLIP)
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = x @ weight.T + bias
            if k + 1 < len(self.weights):
                x = np.tanh(x)
        return np.clip(x, -1.0, 1.0)

    def __repr__(self) -> str:
        """The sizes of its layers."""
        sizes = [len(self.mean), *(len(bias) for bias in self.biases)]
        return f"MlpPolicy({' -> '.join(map(str, sizes))})"

    def save(self, path: str | Path) -> None:
        """Write it as a NumPy archive of single precision.

        Raises:
            TypeError: a value in ``environment`` that is not text, a number or a list of them.
        """
        layers = {f"weight{k}": w for k, w in enumerate(self.weights)}
        layers |= {f"bias{k}": b for k, b in enumerate(self.biases)}
        arrays = {"mean": self.mean, "deviation": self.deviation, **layers}
        single: dict[str, Any] = {name: value.astype("f4") for name, value in arrays.items()}
        np.savez_compressed(path, environment=json.dumps(dict(self.environment)), **single)

    @classmethod
    def load(cls, path: str | Path) -> MlpPolicy:
        """The policy of a file.

        Raises:
            ValueError: not such a file.
            FileNotFoundError: no such file.
        """
        with reading(Path(path), "expected a policy that MlpPolicy.save wrote"):
            with np.load(path, allow_pickle=False) as file:
                names = set(file.files) - {"environment"}
                arrays = {name: np.asarray(file[name], dtype=float) for name in names}
                environment = json.loads(str(file.get("environment", "{}")))
            if not isinstance(environment, dict):
                raise ValueError("an environment that is no table of keywords")
            count = sum(name.startswith("weight") for name in arrays)
            weights = tuple(arrays[f"weight{k}"] for k in range(count))
            biases = tuple(arrays[f"bias{k}"] for k in range(count))
            widths = [len(arrays["mean"]), *map(len, biases)]
            shapes = [(b, a) for a, b in itertools.pairwise(widths)]
            if not count or [w.shape for w in weights] != shapes:
                raise ValueError("layers whose shapes do not fit together")
            return cls(arrays["mean"], arrays["deviation"], weights, biases, environment)

    def to_sb3(self, model: Any, normalize: Any) -> None:
        """Give a Stable-Baselines3 actor-critic this mean action, to go on learning from.

        Raises:
            ValueError: layers of other sizes, or an environment of other observations.
        """
        rms, layers = normalize.obs_rms, _actor(model)
        found = [tuple(layer.weight.shape) for layer in layers]
        if found != [weight.shape for weight in self.weights]:
            raise ValueError(f"{self}: the learner's layers have the shapes {found}")
        for layer, weight, bias in zip(layers, self.weights, self.biases, strict=True):
            layer.weight.data[:] = layer.weight.new_tensor(weight)
            layer.bias.data[:] = layer.bias.new_tensor(bias)
        rms.mean, rms.var, rms.count = self.mean, self.deviation**2 - normalize.epsilon, SEEN

    @classmethod
    def from_sb3(cls, model: Any, normalize: Any) -> MlpPolicy:
        """The mean action of a Stable-Baselines3 actor-critic with a ``VecNormalize``."""
        rms, layers = normalize.obs_rms, _actor(model)
        return cls(
            np.asarray(rms.mean),
            np.sqrt(np.asarray(rms.var) + normalize.epsilon),
            tuple(layer.weight.detach().numpy().astype(float) for layer in layers),
            tuple(layer.bias.detach().numpy().astype(float) for layer in layers),
        )


def _actor(model: Any) -> list[Any]:
    """The layers of an actor-critic that lead to the mean action."""
    net = model.policy
    return [
        *(part for part in net.mlp_extractor.policy_net if hasattr(part, "weight")),
        net.action_net,
    ]
