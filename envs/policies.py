"""Trained policies as NumPy archives: small networks, without pickle and without PyTorch."""

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
from tauguard.findings import ArgumentError
from tauguard.untrusted_input import reading

#: Observations are normalised and clipped to this many standard deviations, as VecNormalize does.
CLIP = 10.0
#: Weight of a loaded policy's normalisation when training continues, as a number of observations.
SEEN = 1e5


@dataclass(frozen=True, eq=False)
class MlpPolicy:
    """A perceptron with tanh between its layers, on the normalised observation.

    ``policy(observation)`` is the action, shape (m,). For observations of shape (N, size) the
    actions have the shape (N, m).
    """

    mean: Array  #: mean observation, shape (size,)
    deviation: Array  #: standard deviation of the observation, shape (size,)
    weights: tuple[Array, ...]  #: of each layer, shape (outputs, inputs)
    biases: tuple[Array, ...]  #: of each layer, shape (outputs,)
    #: ``gymnasium.make(**policy.environment)`` makes the environment of training; empty: unknown.
    environment: Mapping[str, Any] = field(default_factory=dict)

    def __call__(self, observation: ArrayLike) -> Array:
        """The action, within [-1, 1].

        Raises:
            ArgumentError: an observation of another size.
        """
        seen = np.asarray(observation, dtype=float)
        if seen.shape[-1] != len(self.mean):
            raise ArgumentError(
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
        """The sizes of the layers."""
        sizes = [len(self.mean), *(len(bias) for bias in self.biases)]
        return f"MlpPolicy({' -> '.join(map(str, sizes))})"

    def save(self, path: str | Path) -> None:
        """Write the policy as a NumPy archive in single precision.

        Raises:
            TypeError: ``environment`` cannot be written as JSON.
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
            ArgumentError: not such a file.
            FileNotFoundError: no such file.
        """
        with reading(Path(path), "expected a policy that MlpPolicy.save wrote"):
            with np.load(path, allow_pickle=False) as file:
                names = set(file.files) - {"environment"}
                arrays = {name: np.asarray(file[name], dtype=float) for name in names}
                environment = json.loads(str(file.get("environment", "{}")))
            if not isinstance(environment, dict):
                raise ArgumentError("an environment that is no table of keywords")
            count = sum(name.startswith("weight") for name in arrays)
            weights = tuple(arrays[f"weight{k}"] for k in range(count))
            biases = tuple(arrays[f"bias{k}"] for k in range(count))
            widths = [len(arrays["mean"]), *map(len, biases)]
            shapes = [(b, a) for a, b in itertools.pairwise(widths)]
            if not count or [w.shape for w in weights] != shapes:
                raise ArgumentError("layers whose shapes do not fit together")
            return cls(arrays["mean"], arrays["deviation"], weights, biases, environment)

    def to_sb3(self, model: Any, normalize: Any) -> None:
        """Copy this policy into a Stable-Baselines3 actor-critic, to continue its training.

        Args:
            model: gets the layers that lead to the mean action.
            normalize: its ``VecNormalize``, which gets mean and variance of the observation.

        Raises:
            ArgumentError: layers of other sizes.
        """
        rms, layers = normalize.obs_rms, _actor(model)
        found = [tuple(layer.weight.shape) for layer in layers]
        if found != [weight.shape for weight in self.weights]:
            raise ArgumentError(f"{self}: the learner's layers have the shapes {found}")
        for layer, weight, bias in zip(layers, self.weights, self.biases, strict=True):
            layer.weight.data[:] = layer.weight.new_tensor(weight)
            layer.bias.data[:] = layer.bias.new_tensor(bias)
        rms.mean, rms.var, rms.count = self.mean, self.deviation**2 - normalize.epsilon, SEEN

    @classmethod
    def from_sb3(cls, model: Any, normalize: Any) -> MlpPolicy:
        """The policy of a Stable-Baselines3 actor-critic with ``VecNormalize``: its mean action."""
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
