from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

class Chain:
    def __init__(
        self,
        parent: NDArray[np.int64],
        prismatic: NDArray[np.int64],
        rotation: Array,
        translation: Array,
        axis: Array,
        inertial: Array,
        armature: Array,
        gravity: Array,
    ) -> None: ...
    def momentum(self, q: Array, qd: Array, p: Array, beta: Array, threads: int) -> None: ...
    def rnea(self, q: Array, qd: Array, qdd: Array, tau: Array, threads: int) -> None: ...
    def mass_matrix(self, q: Array, m: Array, threads: int) -> None: ...
    def regressor(self, q: Array, qd: Array, p: Array, beta: Array, threads: int) -> None: ...
    def link_regressor(
        self, link: int, q: Array, qd: Array, p: Array, beta: Array, threads: int
    ) -> None: ...

class Observer:
    def __init__(self, chain: Chain, gain: Array) -> None: ...
    @property
    def started(self) -> bool: ...
    def reset(self, q: Array, qd: Array, tau: Array) -> None: ...
    def step(self, q: Array, qd: Array, tau: Array, dt: float, out: Array) -> None: ...
    def state(self) -> list[float]: ...
    def restore(self, state: list[float]) -> None: ...

def filter(gain: Array, dt: Array, p: Array, beta: Array, tau: Array, out: Array) -> None: ...

class FrictionBasis:
    def __init__(
        self,
        bristles: list[float],
        stops: list[float],
        stribeck: list[float],
        slopes: list[float],
        loaded: list[float],
        saturation: bool,
        modelled: bool,
        cycles: list[float],
        play: float,
        joints: int,
    ) -> None: ...
    @property
    def columns(self) -> int: ...
    def evaluate(self, q: Array, qd: Array, tau: Array, load: Array, out: Array) -> None: ...

class Estimator:
    def __init__(
        self,
        chain: Chain,
        basis: FrictionBasis,
        drive_gain: list[float],
        gain: list[float],
        weights: list[float],
        deviation: list[float],
        persistence: list[float],
        noise: list[float],
        clip: float,
        every: int,
        lasting: float,
        transition: float,
        weighted: bool,
        fusion: list[float],
        plain_gain: float,
    ) -> None: ...
    @property
    def started(self) -> bool: ...
    def theta(self, out: Array) -> None: ...
    def reset(self) -> None: ...
    def run(
        self,
        dt: Array,
        q: Array,
        qd: Array,
        current: Array,
        residual: Array,
        unexplained: Array,
        acceleration: Array,
        plain: Array,
        theta: Array,
    ) -> None: ...
    def step(
        self,
        q: Array,
        qd: Array,
        current: Array,
        dt: float,
        residual: Array,
        unexplained: Array,
        acceleration: Array,
    ) -> None: ...

REGIME_SLOW: float

class FreeMotion:
    def __init__(
        self,
        chain: Chain,
        basis: FrictionBasis,
        drive_gain: list[float],
        weights: list[float],
        level: list[float],
        mass: float,
        moment: float,
        rest: list[float],
        stop: list[float],
        least: list[float],
        moving: list[float],
        start: list[float],
    ) -> None: ...
    def reset(self) -> None: ...
    def run(
        self,
        dt: Array,
        q: Array,
        qd: Array,
        current: Array,
        ratio: Array,
        bound: Array,
        residual: Array,
        qdd: Array,
        rest: Array,
    ) -> None: ...
    def step(self, q: Array, qd: Array, current: Array, dt: float) -> float: ...

class FaultCheck:
    def __init__(
        self,
        dt: float,
        longest: float,
        odd: int,
        speed: float,
        repeats: int,
        window: int,
        share: float,
        step_share: float,
        current: Array,
        step: Array,
        drift: Array,
        stuck: NDArray[np.int64],
    ) -> None: ...
    def step(self, t: float, q: Array, qd: Array, current: Array) -> tuple[int, int, float]: ...
    def reset(self) -> None: ...

class TorqueCheck:
    def __init__(
        self, gain: Array, noise: Array, rate: float, opposed: Array, least: Array, most: Array
    ) -> None: ...
    def step(self, residual: Array, current: Array, dt: float) -> tuple[int, int, float]: ...
    def extremes(self) -> list[float]: ...

class Scores:
    @property
    def joints(self) -> int: ...
    def step(self, q: Array, qd: Array, current: Array, dt: float) -> float: ...

def free_scores(stream: FreeMotion) -> Scores: ...
def limit_scores(
    estimator: Estimator,
    joints: list[int],
    weights: list[float],
    units: float,
    factor: float,
    compress: bool,
    limits: list[float],
) -> Scores: ...
def kernel_scores(
    estimator: Estimator,
    joints: list[int],
    weights: list[float],
    units: float,
    factor: float,
    compress: bool,
    lag: int,
    count: int,
    vectors: Array,
    coef: Array,
    intercept: float,
    sigma: float,
    graded: bool,
) -> Scores: ...
def python_scores(make: Callable[[], object], joints: int) -> Scores: ...

class Alarm:
    def __init__(
        self,
        scores: Scores,
        dt: float,
        settle: float,
        threshold: float,
        samples: int,
        memory: int,
        speed: list[float],
        base: list[float],
        unit: list[float],
    ) -> None: ...
    @property
    def score(self) -> float: ...
    def step(self, q: Array, qd: Array, current: Array, dt: float) -> bool: ...

class Monitor:
    def __init__(
        self,
        check: FaultCheck,
        alarm: Alarm,
        observer: Estimator,
        torques: TorqueCheck,
        dt: float,
        settle: float,
        span: float,
        window: float,
        bridged: float,
    ) -> None: ...
    @property
    def settled(self) -> bool: ...
    def step(
        self, t: float, q: Array, qd: Array, current: Array
    ) -> tuple[int, bool, float, int, int, float, bool]: ...
