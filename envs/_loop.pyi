import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]

class Loop:
    def __init__(
        self,
        *,
        step: int,
        model: int,
        data: int,
        dt: float,
        decay: float,
        qpos: int,
        qvel: int,
        qfrc_applied: int,
        xfrc_applied: int,
        xpos: int,
        xquat: int,
        sensordata: int,
        qpos_adr: list[int],
        dof_adr: list[int],
        obstacle_bodies: list[int],
        sensor_begin: int,
        sensor_count: int,
    ) -> None: ...
    def set_joint(
        self,
        i: int,
        *,
        gain: float,
        nominal_gain: float,
        limit: float,
        gear: float,
        coulomb: float,
        breakaway: float,
        stribeck_velocity: float,
        viscous: float,
        bristle_stiffness: float,
        load: float,
        kp: float,
        kd: float,
        cycles: list[float],
        amplitude: list[float],
        phase: list[float],
    ) -> None: ...
    def get_state(self, out: _Array) -> None: ...
    def set_state(self, state: _Array) -> None: ...
    def run(
        self,
        q_des: _Array,
        qd_des: _Array,
        tau_ff: _Array,
        wrench: _Array,
        wrench_body: int,
        q: _Array,
        qd: _Array,
        current: _Array,
        sensor: _Array,
        poses: _Array,
    ) -> int: ...
    @property
    def joints(self) -> int: ...
