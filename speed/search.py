"""The search for permissible speeds: binding contacts of a program, and scans over their speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.findings import Finding, Findings, note
from tauguard.models import BodyRegion
from tauguard.speed.arm_states import ArmStates, ContactArm
from tauguard.speed.contact import Contacts, Course, Integration, follow
from tauguard.speed.detection_delay import DelayModel
from tauguard.speed.impact import effective_mass, impact_energy
from tauguard.speed.program import Program, advance
from tauguard.speed.reaction import Stop
from tauguard.speed.simulated_contact import ContactBench, SimulatedContact
from tauguard.speed.tool import Cover, Spring, Tool

Rows = NDArray[np.intp]


@dataclass(frozen=True)
class SpeedOptions:
    """Settings of the search."""

    interval: float = 0.05  #: between the samples of the program that are looked at [s]
    fastest: float = 2.5  #: largest speed that is looked at [m/s]
    slowest: float = 0.02  #: a speed below this is printed as 0 [m/s]
    coarse: int = 12  #: number of speeds of the first scan
    fine: int = 5  #: number of speeds between the last permitted one and the first excess
    simulated: int = 24  #: most binding cases that are simulated in MuJoCo
    points: int = 12  #: points on each link
    integration: Integration = field(default_factory=Integration)


@dataclass(frozen=True)
class SpeedLimit:
    """The permissible speed of one segment beside one body region."""

    segment: int  #: from 1
    t: float  #: time of the binding sample in the program [s]
    region: str
    link: int  #: 1-based link of the binding point; 0: the tool
    programmed: float  #: speed of this point in the program [m/s]
    mass: float  #: reflected mass at this point in the direction of the contact [kg]
    free: float  #: permissible speed if the region can move away [m/s]
    undetected: float  #: permissible speed clamped, when nothing stops the robot [m/s]
    permissible: float  #: permissible speed with the stop, clamped or free as chosen [m/s]
    limited_by: str  #: "first peak", "lasting force", "pressure" or "no contact permitted"
    delay: float  #: from the first touch to the reaction at this speed [s]; infinite: not detected
    force: float  #: predicted peak force at the permissible speed [N]
    simulated: float = float("nan")
    """Largest of the force over its limit in MuJoCo at the permissible speed; NaN: not simulated"""

    @property
    def scale(self) -> float:
        """Factor on the program's speed, at most 1."""
        return min(1.0, self.permissible / self.programmed) if self.programmed > 0 else 1.0


@dataclass
class Candidates:
    """Binding contacts of one segment and region: one row for each."""

    segment: Array
    region: list[str]
    sample: Rows  #: row of the states
    point: Rows
    normal: Array  #: (C, 3)
    speed: Array  #: of the point in the program [m/s]


@dataclass
class Search:
    """The search for permissible speeds of one program."""

    program: Program
    arm: ContactArm
    tool: Tool
    stop: Stop
    cover: Cover | None
    regions: dict[str, BodyRegion]
    clamped: dict[str, bool]
    person_speed: float
    margin: float
    options: SpeedOptions
    delay: float
    model: DelayModel | None

    @property
    def detection(self) -> str:
        """How the delay is found, as text."""
        if self.model is not None:
            return "the detector's own alarm"
        if np.isfinite(self.delay):
            return f"delay {1e3 * self.delay:g} ms, given"
        return "none: the program goes on"

    def findings(self) -> Findings:
        """What a reader must know of the assumptions."""
        made: list[Finding] = []
        source = self.arm.armature_source
        known = any(word in source for word in ("given", "file", "calibrat"))
        advice = "" if known else "; forces grow with it, so identify it with `tauguard calibrate`"
        made.append(note("rotor-inertia", f"rotor inertia: {source}{advice}"))
        made.append(
            note(
                "limits",
                "limits: ISO/TS 15066:2016, transcribed from public excerpts; ISO 10218-2:2025 "
                "was not read",
            )
        )
        return Findings(made)

    def run(self) -> tuple[list[SpeedLimit], list[tuple[float, float]]]:
        """Limits of all segments and regions, and the times of the segments."""
        program = self.program
        stretches = program.segments()
        segments = [(float(program.t[s.start]), float(program.t[s.stop - 1])) for s in stretches]
        rows, numbers = self._samples(stretches)
        if not len(rows):
            return [], segments
        self._rows = rows
        self._states = ArmStates.of(self.arm, program.q[rows], program.qd[rows])
        ends = [stretches[number].stop for number in numbers]
        self._advance = np.array(
            [advance(program, int(r), end) for r, end in zip(rows, ends, strict=True)]
        )
        candidates = self._candidates(numbers)
        return self._limits(candidates), segments

    def _samples(self, stretches: Sequence[slice]) -> tuple[Array, Array]:
        """Rows of the program that are looked at, and the number of their segment."""
        t = self.program.t
        rows, numbers = [np.empty(0, int)], [np.empty(0, int)]
        for number, stretch in enumerate(stretches):
            times = np.arange(t[stretch.start], t[stretch.stop - 1], self.options.interval)
            each = np.unique(np.clip(np.searchsorted(t, times), stretch.start, stretch.stop - 1))
            rows.append(each)
            numbers.append(np.full(len(each), number))
        return np.concatenate(rows), np.concatenate(numbers)

    def _candidates(self, numbers: Array) -> Candidates:
        """For each segment and region the contacts that may bind.

        They are the one with the highest first peak of all points, the same of the tool alone, and
        the one in which the drives can press hardest.
        """
        states = self._states
        velocity, mobility = states.velocity, states.mobility
        speed = np.linalg.norm(velocity, axis=-1)
        segment, region, sample, point, normals = [], [], [], [], []
        for name, limits in self.regions.items():
            if not limits.transient:
                continue
            mass = np.inf if self.clamped[name] else limits.mass
            energy, normal = impact_energy(velocity, mobility, mass)
            lever = np.einsum("skij,ski->skj", states.jacobian, normal)
            strength = np.abs(lever) / self.arm.torque_limit
            press = np.minimum(
                1 / np.maximum(strength.max(axis=-1), 1e-9), limits.stiffness * speed
            )
            press = np.where(speed > self.options.slowest, press, 0.0)
            for number in np.unique(numbers):
                here = np.flatnonzero(numbers == number)
                chosen = {
                    divmod(int(np.argmax(energy[here])), energy.shape[1]),
                    (int(np.argmax(energy[here, -1])), energy.shape[1] - 1),
                    divmod(int(np.argmax(press[here])), press.shape[1]),
                }
                for row, k in sorted(chosen):
                    s = int(here[row])
                    if speed[s, k] < 1e-3:
                        continue
                    segment.append(int(number))
                    region.append(name)
                    sample.append(s)
                    point.append(k)
                    normals.append(normal[s, k])
        at = np.array(sample, int), np.array(point, int)
        return Candidates(
            np.array(segment), region, *at, np.array(normals).reshape(-1, 3), speed[at]
        )

    # -- forces at given speeds ------------------------------------------------------------------

    def _numbers(self, candidates: Candidates, name: str) -> Array:
        return np.array([getattr(self.regions[r], name) for r in candidates.region], dtype=float)

    def _contacts(
        self, candidates: Candidates, cases: Rows, speed: Array, mass: Array, delay: Array
    ) -> Contacts:
        """Contacts of some candidates at speeds of their points [m/s]."""
        states = self._states
        s, k = candidates.sample[cases], candidates.point[cases]
        lever = np.einsum("cij,ci->cj", states.jacobian[s, k], candidates.normal[cases])
        factor = speed / candidates.speed[cases]
        stiffness = self._numbers(candidates, "stiffness")[cases]
        return Contacts(
            states.inverse_mass[s], states.gravity[s], lever, states.qd[s] * factor[:, None],
            Spring(stiffness, self.cover), mass, delay, self._advance[s] / factor,
        )  # fmt: skip

    def _excess(self, candidates: Candidates, cases: Rows, course: Course) -> Array:
        """First peak, lasting force and pressure over their limits, shape (3, C)."""
        number = {
            name: self._numbers(candidates, name)[cases]
            for name in (
                "transient_force", "quasi_static_force", "transient_pressure",
                "quasi_static_pressure", "stiffness",
            )
        }  # fmt: skip
        at_tool = self.arm.link[candidates.point[cases]] == 0
        peak, lasting = (
            self.tool.pressure(force, number["stiffness"])
            for force in (course.peak, course.lasting)
        )
        pressure = np.maximum(
            peak / number["transient_pressure"], lasting / number["quasi_static_pressure"]
        )
        return self.margin * np.stack(
            [
                course.peak / number["transient_force"],
                course.lasting / number["quasi_static_force"],
                np.where(at_tool, pressure, 0.0),
            ]
        )

    def _delays(self, candidates: Candidates, cases: Rows, speed: Array, mass: Array) -> Array:
        """Time from the first touch to the reaction [s], shape (C,)."""
        if self.model is None:
            return np.full(len(cases), self.delay)
        never = np.full(len(cases), np.inf)
        contacts = self._contacts(candidates, cases, speed, mass, never)
        course = follow(self.arm, contacts, self.stop, self.options.integration, keep=True)
        assert course.force is not None
        times = self.options.integration.step * np.arange(1.0, len(course.force) + 1)
        touches = self.program.t[self._rows[candidates.sample[cases]]]
        return np.array(
            [
                self.model.delay(float(touch), contacts.lever[c], times, course.force[:, c])
                for c, touch in enumerate(touches)
            ]
        )

    def _scan(
        self, candidates: Candidates, mass: Array, detected: bool
    ) -> tuple[Array, Rows, Array, Array]:
        """Permissible speed, what limits it, delay and peak force of each candidate, (C,) each.

        With a detector in the loop a force can fall with the speed. So speeds are scanned upwards,
        and the first excess counts.
        """
        options, count = self.options, len(mass)
        low, high = np.zeros(count), np.full(count, np.inf)
        limited = np.full(count, -1)
        delay, force = np.full(count, np.inf), np.zeros(count)
        grid = np.geomspace(options.slowest, options.fastest, options.coarse)
        steps: list[Array] = [np.full(count, speed) for speed in grid]
        for level in range(options.coarse + options.fine):
            if level == options.coarse:  # between the last permitted speed and the first excess
                steps += [
                    low + share * (np.minimum(high, options.fastest) - low)
                    for share in np.linspace(0, 1, options.fine + 2)[1:-1]
                ]
            cases = np.flatnonzero(steps[level] < high)
            if not len(cases):
                continue
            speed = steps[level][cases]
            waits = (
                self._delays(candidates, cases, speed, mass[cases])
                if detected
                else np.full(len(cases), np.inf)
            )
            contacts = self._contacts(candidates, cases, speed, mass[cases], waits)
            course = follow(self.arm, contacts, self.stop, options.integration)
            excess = self._excess(candidates, cases, course)
            over = (excess > 1).any(axis=0)
            high[cases[over]] = speed[over]
            limited[cases[over]] = excess[:, over].argmax(axis=0)
            fits = cases[~over]
            low[fits], delay[fits], force[fits] = speed[~over], waits[~over], course.peak[~over]
        return low, limited, delay, force

    def _free_speed(self, candidates: Candidates) -> Array:
        """Permissible speed of the first peak if the region can move away [m/s], shape (C,)."""
        states = self._states
        at = candidates.sample, candidates.point
        mass = self._numbers(candidates, "mass")
        unit = np.empty(len(mass))
        for value in np.unique(mass):
            rows = mass == value
            unit[rows] = impact_energy(
                states.velocity[at][rows], states.mobility[at][rows], float(value)
            )[0]
        unit = unit / candidates.speed**2  # energy at 1 m/s
        spring = Spring(self._numbers(candidates, "stiffness"), self.cover)
        force = self._numbers(candidates, "transient_force") / self.margin
        speed = np.sqrt(spring.energy(force) / unit) - self.person_speed
        at_tool = self.arm.link[candidates.point] == 0
        allowed = self._numbers(candidates, "transient_pressure") / self.margin
        low, high = np.zeros_like(speed), np.maximum(speed, 0.0)
        for _ in range(30):
            middle = (low + high) / 2
            peak = spring.peak(unit * (middle + self.person_speed) ** 2)
            fits = ~at_tool | (self.tool.pressure(peak, spring.tissue) <= allowed)
            low, high = np.where(fits, middle, low), np.where(fits, high, middle)
        return np.where(at_tool, low, np.maximum(speed, 0.0))

    def _limits(self, candidates: Candidates) -> list[SpeedLimit]:
        """The least permissible speed of each segment and region."""
        states = self._states
        count = len(candidates.region)
        clamped = np.full(count, np.inf)
        chosen = np.array([self.clamped[r] for r in candidates.region])
        mass = np.where(chosen, np.inf, self._numbers(candidates, "mass"))
        free = self._free_speed(candidates)
        undetected, why, _, peaks = self._scan(candidates, clamped, detected=False)
        reacts = self.model is not None or np.isfinite(self.delay)
        with_stop, cause, delay, force = (
            self._scan(candidates, mass, detected=True)
            if reacts or not chosen.all()
            else (undetected, why, np.full(count, np.inf), peaks)
        )
        with_stop = np.where(chosen, with_stop, np.minimum(with_stop, free))
        mobility = states.mobility[candidates.sample, candidates.point]
        heavy = effective_mass(mobility, candidates.normal)
        names = ("first peak", "lasting force", "pressure", "not reached")
        limits: list[SpeedLimit] = []
        self._binding: dict[tuple[int, str], int] = {}
        for key in dict.fromkeys(zip(candidates.segment.tolist(), candidates.region, strict=True)):
            own = [
                c for c in range(count) if (int(candidates.segment[c]), candidates.region[c]) == key
            ]
            # the candidate that asks for the lowest factor on the program's speed
            c = min(own, key=lambda i: with_stop[i] / candidates.speed[i])
            self._binding[key] = c
            small = with_stop[c] < self.options.slowest
            limits.append(
                SpeedLimit(
                    segment=key[0] + 1,
                    t=float(self.program.t[self._rows[candidates.sample[c]]]),
                    region=key[1],
                    link=int(self.arm.link[candidates.point[c]]),
                    programmed=float(candidates.speed[c]),
                    mass=float(heavy[c]),
                    free=float(free[c]),
                    undetected=float(undetected[c]),
                    permissible=0.0 if small else float(with_stop[c]),
                    limited_by=names[int(cause[c])],
                    delay=float(delay[c]),
                    force=float(force[c]),
                )
            )
        self._kept = candidates
        return limits

    # -- MuJoCo ----------------------------------------------------------------------------------

    def simulated(self, limits: list[SpeedLimit]) -> list[SpeedLimit]:
        """The limits with the ratio of force to limit in MuJoCo, for the most binding cases."""
        bench = ContactBench(self.arm, self.options.integration)
        order = sorted(
            (i for i, limit in enumerate(limits) if limit.permissible > 0),
            key=lambda i: limits[i].permissible / limits[i].programmed,
        )
        done = list(limits)
        for i in order[: self.options.simulated]:
            done[i] = replace(limits[i], simulated=self._ratio(bench, limits[i]))
        return done

    def _ratio(self, bench: ContactBench, limit: SpeedLimit) -> float:
        """Largest force over its limit in MuJoCo at the permissible speed."""
        candidates = self._kept
        c = self._binding[limit.segment - 1, limit.region]
        region = self.regions[limit.region]
        s, k = int(candidates.sample[c]), int(candidates.point[c])
        mass = np.inf if self.clamped[limit.region] else region.mass
        case = SimulatedContact(
            self._states.q[s],
            self._states.qd[s] * limit.permissible / limit.programmed,
            k,
            candidates.normal[c],
            Spring(np.asarray(region.stiffness), self.cover),
            mass,
            limit.delay,
            float(self._advance[s]) * limit.programmed / limit.permissible,
        )
        force = bench.force(case, self.stop)
        settings = self.options.integration
        late = round(settings.transient_time / settings.duration * len(force))
        course = Course(np.array([force.max()]), np.array([force[late:].max()]), None)
        return float(self._excess(candidates, np.array([c]), course).max())
