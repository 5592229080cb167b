"""Arm, score and state of a running detector in rerun's viewer."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.replay.live import LiveView
from tauguard.replay.robot import load_model

#: Frame rate of the display [Hz].
FRAMES = 30
#: Height of each state in the chart.
STATES = {"free": 0, "collision": 1, "fault": 2}


class StateView:
    """Shows the arm, the score in thresholds, and the state; at most ``FRAMES`` times a second."""

    def __init__(
        self,
        robot: str | Path,
        joint_names: Sequence[str],
        threshold: float,
        save: Path | None = None,
    ) -> None:
        """Open the viewer, or record the display.

        Args:
            robot: URDF or MJCF file.
            joint_names: the robot's joints in the order of ``q``.
            threshold: of the score.
            save: an .rrd file to write instead of opening the viewer.
        """
        model = load_model(robot)
        self._model, self._data = model, mujoco.MjData(model)
        self._rows = [model.jnt_qposadr[model.joint(name).id] for name in joint_names]
        self._view = LiveView(model, save)
        charts = {"score": "Score (1: threshold)", "state": "0 free, 1 collision, 2 fault"}
        self._view.layout(charts)
        self._threshold, self._due = max(threshold, 1e-9), -np.inf

    def show(self, t: float, q: Array, state: str, score: float) -> None:
        """Show a state.

        Args:
            t: the robot's time [s].
            q: joint positions [rad], shape (n,); the arm keeps its pose if they are not finite.
            state: "free", "collision" or "fault".
            score: the detector's score.
        """
        soon = self._due <= t < self._due + 1 / FRAMES
        if soon or not np.isfinite(t):
            return
        self._due = t
        if np.isfinite(q).all():
            self._data.qpos[self._rows] = q
            mujoco.mj_kinematics(self._model, self._data)
        self._view.show(self._data, t, [])
        self._view.chart("score", ["score"], [score / self._threshold])
        self._view.chart("state", ["state"], [STATES[state]])
