"""A network on windows of the residual, in the place of the published 1-D CNNs.

The published detectors of this kind (Park et al. 2021) run a 1-D CNN over a window of residuals. A
dense network on the same 44 numbers can represent every filter of such a CNN; it needs more
windows to learn them, which simulation and mining provide. It needs no deep-learning framework.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tauguard.arrays import Array
from tauguard.detectors.frozen import Frozen
from tauguard.detectors.methods.network import Network
from tauguard.detectors.methods.windowed import Windowed


@dataclass(frozen=True)
class WindowNetwork(Windowed):
    """A feed-forward network that ranks windows by the severity of what happens in them."""

    hidden: tuple[int, ...] = (48, 24)
    epochs: int = 40
    name: ClassVar[str] = "window-network"

    def learn(self, x: Array, y: Array) -> OneOutput:
        """Least squares."""
        return OneOutput(Network.fit(x, y, self.hidden, seed=self.seed, epochs=self.epochs))


@dataclass(frozen=True, eq=False)
class OneOutput(Frozen):
    """A network with one output as a function of windows."""

    network: Network

    def __call__(self, x: Array) -> Array:
        """Values at the rows of x, shape (N, d) -> (N,)."""
        return self.network(x)[:, 0]
