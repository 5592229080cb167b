"""Learned methods that score windows of the residual.

Support vector regression with the SRQ kernel, and a neural network.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.features.front_end import FrontEnd, FrontEndSettings, Scaling
from tauguard.detectors.features.windows import WindowShape, draw_windows, median_distance
from tauguard.detectors.frozen import Frozen
from tauguard.detectors.scores.kernel import KernelMachine, SrqRegressor
from tauguard.detectors.scores.network import Network
from tauguard.detectors.scores.windowed import Regressor, Windowed
from tauguard.traces.trace import Trace

#: Windows that the scale of the features is found with.
SAMPLED = 1000


@dataclass(frozen=True)
class SrqSvr(Windowed):
    """The dissertation's regressor on the residual in standard deviations.

    One factor brings the median distance between windows of collisions and of collision-free
    motion to ``distance``, a length that the kernel resolves. Beneath the score lie the thresholds
    of ``moving-thresholds``: they find what is far from anything that the regressor has seen.
    """

    windows: int = 3000
    mined: int = 300
    sigma: float = 3.0  #: of the SRQ kernel
    C: float = 1.0
    epsilon: float = 0.02
    distance: float = 2.0  #: median distance after scaling; 0 leaves the windows as they are
    vectors: int = 400  #: support vectors that are kept, at most; 0 keeps all
    name: ClassVar[str] = "srq-svr"
    floored: ClassVar[bool] = True
    mining_gap: ClassVar[float] = 0.1
    stream_of_seeds: ClassVar[int] = 1

    def learn(self, x: Array, y: Array) -> KernelMachine:
        """Epsilon-SVR."""
        return SrqRegressor(self.sigma, self.C, self.epsilon).fit(x, y).machine_

    def finished(self, regressor: Regressor) -> Regressor:
        """With no more than ``vectors`` support vectors."""
        assert isinstance(regressor, KernelMachine)
        few = 0 < self.vectors < len(regressor.vectors)
        return regressor.reduced(self.vectors) if few else regressor

    def scaling(
        self,
        traces: Sequence[Trace],
        targets: Sequence[Array],
        front: FrontEnd,
        shape: WindowShape,
    ) -> Scaling:
        """Bring the median distance of windows to ``distance``."""
        bare = self.bare(traces, front)
        if self.distance <= 0:
            return bare
        rng = np.random.default_rng(self.seed)
        prepared = self.prepared(traces, targets, front, bare)
        windows, target = draw_windows(rng, prepared, shape, SAMPLED)
        spread = median_distance(windows[target > 0], windows[target == 0], rng)
        return replace(bare, factor=self.distance / spread if spread > 0 else 1.0)


@dataclass(frozen=True)
class PlainSrqSvr(SrqSvr):
    """The dissertation's form: residuals in N m times one factor, labels 0/1, no friction model.

    Residuals in N m lie some 100 apart, where a kernel of sigma = 3 is diagonal and nothing is
    learnt; the factor brings the median distance to sigma. ``distance=0`` is the literal form.
    """

    mined: int = 0
    distance: float = 3.0
    vectors: int = 0
    graded: bool = False
    front: FrontEndSettings = field(
        default_factory=lambda: FrontEndSettings(adapt=False, settle=0.5, calibrate=False)
    )
    name: ClassVar[str] = "srq-svr-plain"
    floored: ClassVar[bool] = False

    def bare(self, traces: Sequence[Trace], front: FrontEnd) -> Scaling:
        """Residuals in N m."""
        return Scaling(front.joints)


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
