"""A network on windows of the residual: the equal of a 1-D CNN that needs no further library.

The published detectors of this kind (Park et al. 2021) run a 1-D CNN over a window of residuals. A
dense network on the same 44 numbers can learn every filter that such a CNN can; it needs more
windows to do so, which simulation and mining provide. Frameworks for convolutions weigh hundreds of
megabytes and are not worth that here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.methods.network import Network
from tauguard.detectors.methods.windowed import Windowed

Array = NDArray[np.float64]


@dataclass
class WindowNetwork(Windowed):
    """A feed-forward network that ranks windows by the severity of what happens in them."""

    hidden: tuple[int, ...] = (48, 24)
    epochs: int = 40
    network: Network | None = None
    name: ClassVar[str] = "window-network"

    def _learn(self, x: Array, y: Array) -> None:
        self.network = Network.fit(x, y, self.hidden, seed=self.seed, epochs=self.epochs)

    def _predict(self, x: Array) -> Array:
        assert self.network is not None
        return self.network(x)[:, 0]

    def _own_parts(self) -> dict[str, Any]:
        assert self.network is not None
        return {"network": self.network.parts()}

    def _restore(self, parts: dict[str, Any]) -> None:
        self.network = Network.from_parts(parts["network"])
