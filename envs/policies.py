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
    """A perceptron on the normalised observation.

    ``policy(observation)`` is the action, shape (m,). For observations of shape (N, size) the
    actions have the shape (N, m). The parts of a dictionary follow one another, sorted by name.
    """

    mean: Array  #: mean observation, shape (size,)
    deviation: Array  #: standard deviation of the observation, shape (size,)
    weights: tuple[Array, ...]  #: of each layer, shape (outputs, inputs)
    biases: tuple[Array, ...]  #: of each layer, shape (outputs,)
    #: ``gymnasium.make(**policy.environment)`` makes the environment of training; empty: unknown.
    environment: Mapping[str, Any] = field(default_factory=dict)
    activation: str = "tanh"  #: between the layers: "tanh" or "relu"
    squash: bool = False  #: whether the last layer ends with tanh
    clip: float = CLIP  #: the normalised observation lies between -clip and clip

    def __call__(self, observation: ArrayLike | Mapping[str, ArrayLike]) -> Array:
        """The action, within [-1, 1].

        Raises:
            ArgumentError: an observation of another size.
        """
        if isinstance(observation, Mapping):
            observation = np.concatenate(
                [np.asarray(observation[key], dtype=float) for key in sorted(observation)], axis=-1
            )
        seen = np.asarray(observation, dtype=float)
        if seen.shape[-1] != len(self.mean):
            raise ArgumentError(
                f"observation of {seen.shape[-1]} numbers: the policy expects {len(self.mean)}; "
                f"make the environment with the keywords of its training, {dict(self.environment)}"
            )
        x = np.clip((seen - self.mean) / self.deviation, -self.clip, self.clip)
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = x @ weight.T + bias
            if k + 1 < len(self.weights):
                x = np.tanh(x) if self.activation == "tanh" else np.maximum(x, 0.0)
        return np.tanh(x) if self.squash else np.clip(x, -1.0, 1.0)

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
        form = {name: getattr(self, name) for name in ("activation", "squash", "clip")}
        texts = {"environment": json.dumps(dict(self.environment)), "form": json.dumps(form)}
        np.savez_compressed(path, **texts, **single)  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: str | Path) -> MlpPolicy:
        """The policy of a file.

        Raises:
            ArgumentError: not such a file.
            FileNotFoundError: no such file.
        """
        with reading(Path(path), "expected a policy that MlpPolicy.save wrote"):
            with np.load(path, allow_pickle=False) as file:
                names = set(file.files) - {"environment", "form"}
                arrays = {name: np.asarray(file[name], dtype=float) for name in names}
                environment = json.loads(str(file.get("environment", "{}")))
                form = json.loads(str(file.get("form", "{}")))
            if not isinstance(environment, dict):
                raise ArgumentError("an environment that is no table of keywords")
            _check_form(form)
            count = sum(name.startswith("weight") for name in arrays)
            weights = tuple(arrays[f"weight{k}"] for k in range(count))
            biases = tuple(arrays[f"bias{k}"] for k in range(count))
            widths = [len(arrays["mean"]), *map(len, biases)]
            shapes = [(b, a) for a, b in itertools.pairwise(widths)]
            if not count or [w.shape for w in weights] != shapes:
                raise ArgumentError("layers whose shapes do not fit together")
            return cls(arrays["mean"], arrays["deviation"], weights, biases, environment, **form)

    def to_sb3(self, model: Any, normalize: Any) -> None:
        """Copy this policy into a Stable-Baselines3 actor-critic, to continue its training.

        Args:
            model: gets the layers that lead to the mean action.
            normalize: its ``VecNormalize``, which gets mean and variance of the observation.

        Raises:
            ArgumentError: layers of other sizes.
        """
        rms, layers = normalize.obs_rms, _layers(_actor(model))
        found = [tuple(layer.weight.shape) for layer in layers]
        if found != [weight.shape for weight in self.weights]:
            raise ArgumentError(f"{self}: the learner's layers have the shapes {found}")
        for layer, weight, bias in zip(layers, self.weights, self.biases, strict=True):
            layer.weight.data[:] = layer.weight.new_tensor(weight)
            layer.bias.data[:] = layer.bias.new_tensor(bias)
        rms.mean, rms.var, rms.count = self.mean, self.deviation**2 - normalize.epsilon, SEEN

    @classmethod
    def from_sb3(cls, model: Any, normalize: Any = None) -> MlpPolicy:
        """The deterministic policy of a Stable-Baselines3 model: PPO, A2C, SAC, TD3 or DDPG.

        Args:
            model: with a perceptron on a plain or dictionary observation.
            normalize: its ``VecNormalize``; default: the model's own, if it has one.

        Raises:
            ArgumentError: another policy, or an activation other than tanh and ReLU.
        """
        normalize = normalize or model.get_vec_normalize_env()
        parts, layers = _actor(model), _layers(_actor(model))
        kinds = [type(part).__name__.lower() for part in parts if not hasattr(part, "weight")]
        between = set(kinds[: len(layers) - 1]) or {"tanh"}
        if len(between) > 1 or not between <= {"tanh", "relu"}:
            raise ArgumentError(f"model: activations {', '.join(kinds)}; expected tanh or ReLU")
        mean, deviation, clip = np.zeros(layers[0].weight.shape[1]), 1.0, np.inf
        if getattr(normalize, "norm_obs", False):
            rms = normalize.obs_rms
            moments = [rms[key] for key in sorted(rms)] if isinstance(rms, dict) else [rms]
            mean = np.concatenate([np.ravel(part.mean) for part in moments])
            variance = np.concatenate([np.ravel(part.var) for part in moments])
            deviation, clip = np.sqrt(variance + normalize.epsilon), float(normalize.clip_obs)
        return cls(
            mean,
            np.broadcast_to(deviation, mean.shape),
            tuple(layer.weight.detach().cpu().numpy().astype(float) for layer in layers),
            tuple(layer.bias.detach().cpu().numpy().astype(float) for layer in layers),
            activation=between.pop(),
            squash=hasattr(model.policy, "actor"),
            clip=clip,
        )


def _check_form(form: Any) -> None:
    """Check what a file says about activation, squash and clip."""
    known = {"activation": str, "squash": bool, "clip": float}
    right = isinstance(form, dict) and form.keys() <= known.keys()
    if not (right and all(isinstance(value, known[key]) for key, value in form.items())):
        raise ArgumentError("a form of the network that this version does not know")
    if form.get("activation", "tanh") not in ("tanh", "relu") or not form.get("clip", CLIP) > 0:
        raise ArgumentError("an activation or clip that this version does not know")


def _actor(model: Any) -> list[Any]:
    """The modules that lead from the observation to the action, in order."""
    net = model.policy
    if hasattr(net, "mlp_extractor"):  # PPO, A2C
        return [*net.mlp_extractor.policy_net, net.action_net]
    actor: Any = getattr(net, "actor", None)
    if hasattr(actor, "latent_pi"):  # SAC: mu is the mean before tanh
        return [*actor.latent_pi, actor.mu]
    if actor is not None:  # TD3, DDPG
        return list(actor.mu)
    raise ArgumentError(f"model {type(model).__name__}: expected PPO, A2C, SAC, TD3 or DDPG")


def _layers(parts: list[Any]) -> list[Any]:
    return [part for part in parts if hasattr(part, "weight")]
