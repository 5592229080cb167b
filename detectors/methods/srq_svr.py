"""SVR with the SRQ kernel behind the shared interface, in its strong and in its plain form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.detector import check_interval, common_interval
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.methods.pipeline import CollisionDetector, DetectorSettings
from tauguard.traces.trace import Trace

Array = NDArray[np.float64]


@dataclass
class SvrDetector:
    """:class:`~tauguard.detectors.methods.pipeline.CollisionDetector` as a ranking.

    Attributes:
        chain: the detector inside; its own threshold plays no part here.
    """

    chain: CollisionDetector = field(default_factory=CollisionDetector)
    name: str = "srq-svr"

    @classmethod
    def plain(cls) -> SvrDetector:
        """The dissertation's form: residuals times one factor, labels 0/1, no friction model."""
        return cls(CollisionDetector(DetectorSettings.plain_form()), "srq-svr-plain")

    @property
    def settle(self) -> float:
        """Seconds at the beginning of a trace whose scores mean nothing yet."""
        return self.chain.settings.settle

    @property
    def arm(self) -> ArmModel:
        """The calibrated arm."""
        return self.chain._fitted()[0]

    def fit(self, traces: Sequence[Trace], robot: ArmModel) -> SvrDetector:
        """Calibrate, scale and train; needs collisions and collision-free motion."""
        common_interval(traces, robot)
        self.chain.fit(traces, robot.robot, robot.drive_gain, friction=robot.friction)
        return self

    def parts(self) -> dict[str, Any]:
        """What a model file keeps."""
        from tauguard.detectors.model_file import detector_parts

        return {"chain": detector_parts(self.chain), "name": self.name}

    @classmethod
    def from_parts(cls, parts: dict[str, Any]) -> SvrDetector:
        """The detector again from :meth:`parts`."""
        from tauguard.detectors.model_file import rebuilt

        return cls(rebuilt(parts["chain"]), str(parts["name"]))

    def scores(self, trace: Trace) -> Array:
        """Output of the regressor, shape (T,)."""
        check_interval("the trace", trace, self.chain.dt)
        return self.chain.detect(trace).score
