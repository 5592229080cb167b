"""The momentum observer as textbooks write it, stepped by explicit Euler; for comparison."""

from typing import Any

import mujoco
import numpy as np


class ExplicitObserver:
    """r += K dt (dp/dt - tau - r) of one joint about a fixed axis, without gravity."""

    name = "explicit-observer"

    def observer(self, mjcf: str, t: Any, q: Any, qd: Any, tau: Any, gain: float) -> float:
        """The residual of the last sample."""
        model = mujoco.MjModel.from_xml_string(mjcf)
        if model.nv != 1:
            raise NotImplementedError("one joint only")
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        inertia = float(data.M[0])
        residual = 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            for k, dt in enumerate(np.diff(t), 1):
                rate = inertia * np.float64(qd[k][0] - qd[k - 1][0]) / dt - tau[k - 1][0]
                residual += gain * dt * (rate - residual)
        return float(residual)
