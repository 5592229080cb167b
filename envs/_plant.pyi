from collections.abc import Sequence

import numpy as np
from mujoco import MjData, MjModel
from numpy.typing import NDArray

_Array = NDArray[np.float64]

METRICS: int
CONTACT_WIDTH: int
PEAK_WIDTH: int
REACH_WIDTH: int
WALK_WIDTH: int
PERSON_SEGMENTS: int
SENSOR_WIDTH: int

class Joint:
    def __init__(
        self,
        *,
        qpos: int,
        dof: int,
        gain: float,
        nominal_gain: float,
        current_limit: float,
        gear: float,
        coulomb: float,
        breakaway: float,
        stribeck_velocity: float,
        viscous: float,
        bristle_stiffness: float,
        load: float,
        kp: float,
        kd: float,
        rated_speed: float,
        no_load_speed: float,
        known_coulomb: float,
        known_viscous: float,
        cycles: Sequence[float],
        amplitude: Sequence[float],
        phase: Sequence[float],
    ) -> None: ...

class Link:
    def __init__(
        self, *, joint: int, body: int, first: int, slide: bool, mass: float, com: Sequence[float]
    ) -> None: ...

class Tool:
    def __init__(self, *, site: int, body: int, first: int) -> None: ...

class Region:
    def __init__(
        self,
        *,
        body: int,
        joint: int,
        qpos: int,
        dof: int,
        mocap: int,
        held: bool,
        sensor: int,
        quasi_static: float,
        transient: float,
        span: float,
        speed: float,
    ) -> None: ...

class Anatomy:
    def __init__(
        self,
        *,
        hip_height: float = ...,
        trunk: float = ...,
        shoulder: float = ...,
        hip_half: float = ...,
        neck: float = ...,
        head: float = ...,
        upper_arm: float = ...,
        lower_arm: float = ...,
        hand: float = ...,
        grip: float = ...,
        thigh: float = ...,
        shank: float = ...,
        floor: float = ...,
        facing: float = ...,
        hand_speed: float = ...,
        walk_speed: float = ...,
        reaction_time: float = ...,
        seated: bool = ...,
        hanging: bool = ...,
        reacts: bool = ...,
    ) -> None: ...

class Surroundings:
    def __init__(
        self,
        *,
        links: Sequence[Link],
        gravity: Sequence[float],
        tools: Sequence[Tool],
        regions: Sequence[Region],
        person_begin: int,
        person: Anatomy,
        sensor_begin: int,
        low: Sequence[float],
        high: Sequence[float],
    ) -> None: ...

class Rows:
    def __init__(
        self,
        *,
        observation: _Array,
        metrics: _Array,
        tau_ext: _Array,
        target: _Array,
        q: _Array,
        qd: _Array,
        current: _Array,
        tau: _Array,
        contact: _Array,
        region: _Array,
        tau_peak: _Array,
        peak: _Array,
        reaches: _Array,
        walks: _Array,
    ) -> None: ...

class Track:
    def __init__(
        self,
        *,
        q: _Array,
        qd: _Array,
        current: _Array,
        sensors: _Array,
        poses: _Array,
        bodies: Sequence[int],
        sensor_begin: int,
    ) -> None: ...

class Controls:
    def __init__(
        self,
        *,
        mode: int,
        period: float,
        scale: Sequence[float],
        centre: Sequence[float],
        max_speed: Sequence[float],
        torque_limit: Sequence[float],
        low: Sequence[float],
        high: Sequence[float],
    ) -> None: ...

class Physics:
    def __init__(self, model: MjModel, data: MjData, *, step: int, kinematics: int) -> None: ...

class Plant:
    def __init__(
        self, physics: Physics, joints: Sequence[Joint], *, dt: float, decay: float
    ) -> None: ...
    def surround(
        self, around: Surroundings, controls: Controls, rows: Rows, *, substeps: int
    ) -> None: ...
    def reset(self) -> None: ...
    def relax(self) -> None: ...
    def step(self, action: _Array) -> None: ...
    def begin(self, action: _Array) -> None: ...
    def run(self, steps: int) -> None: ...
    def finish(self) -> None: ...
    def refresh(self) -> None: ...
    def aim(self, place: _Array, hold: float) -> None: ...
    def override(self, kind: int, speed: _Array) -> None: ...
    def follow(
        self,
        q_des: _Array,
        qd_des: _Array,
        tau_ff: _Array,
        wrench: _Array,
        wrench_body: int,
        track: Track,
    ) -> int: ...
    def state(self) -> list[float]: ...
    def restore(self, state: Sequence[float]) -> None: ...

def step_all(
    plants: Sequence[Plant], actions: _Array, mask: NDArray[np.bool_], threads: int
) -> None: ...
def poses(
    physics: Physics,
    qpos: Sequence[int],
    q: _Array,
    bodies: Sequence[int],
    joints: Sequence[int],
    *,
    position: _Array,
    rotation: _Array,
    anchor: _Array,
    axis: _Array,
) -> None: ...
