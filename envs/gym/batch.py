"""One or many running copies of a scene: the native plants and the arrays that they fill."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from enum import IntEnum
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.arrays import Array
from tauguard.envs import _plant
from tauguard.envs.gym.actions import Entry, action_table, observation_table
from tauguard.envs.gym.compiled import CompiledScene
from tauguard.envs.gym.native import controls, surroundings
from tauguard.envs.gym.objects import FreeObjects
from tauguard.envs.gym.people import REACHES, WALKS, draw_script
from tauguard.envs.gym.placing import check_clear
from tauguard.envs.gym.randomization import Variant, draw, own_model, vary
from tauguard.envs.gym.sensing import Sensing, listener_factory
from tauguard.envs.gym.step_checks import StepChecks
from tauguard.envs.plant import make_plant
from tauguard.findings import ArgumentError
from tauguard.models import Person


class StepMetrics(NamedTuple):
    """The result of one action: a number per field for one copy, an array per field for several.

    Native code writes the fields as numbers; flags are 0 or 1.
    """

    time: Any  #: since the episode began [s]
    distance: Any  #: of the tool from its target [m]; with two tools the larger distance
    force: Any  #: largest force on a link [N]
    cost: Any  #: the part of ``excess`` that the arm causes [N s]
    limit_ratio: Any  #: largest force on a body region divided by its limit
    region_force: Any  #: largest force on a body region [N]
    onset: Any  #: 1: a collision began
    onset_time: Any  #: time at which the latest collision began [s]; -1: none yet
    link: Any  #: link with the largest force, 1-based; 0: none
    region: Any  #: region with the largest ratio, 1-based; 0: none
    diverged: Any  #: 1: a position is not finite or a speed beyond 1000; 2: an impossible force
    speed_ratio: Any  #: largest ratio of a joint's speed to its largest speed, after the action
    cost_sum: Any  #: sum of ``cost`` over the episode's actions so far [N s]
    excess: Any  #: impulse beyond the limits of the body regions, whoever causes it [N s]


#: Contact of the arm at a physics step: net force on the arm [N]; the link with the largest force
#: (1-based, 0: none); point [m] and force [N] of this link's contact.
CONTACT = np.dtype([("net_force", "f8"), ("link", "f8"), ("point", "f8", 3), ("force", "f8", 3)])
#: Position of a body [m], and its orientation as w, x, y, z.
POSE = np.dtype([("position", "f8", 3), ("quat_wxyz", "f8", 4)])
assert len(StepMetrics._fields) == _plant.METRICS
assert CONTACT.itemsize == 8 * _plant.CONTACT_WIDTH


class Override(IntEnum):
    """What the motors do in place of an action; native code uses the same numbers."""

    FREE = 0  #: the action is not replaced
    VELOCITY = 1  #: the servo follows joint velocities
    LIMP = 2  #: no power
    BRAKE = 3  #: no power, and brakes


#: Arrays of the peak contact on each body region; names in :class:`Batch` and in ``info``.
TOUCHES = ("region_force", "region_pressure", "region_point", "region_direction")
#: A snapshot consists of MuJoCo's integration state, the derived fields that are read before the
#: next physics step, and the rows of one copy.
STATE = mujoco.mjtState.mjSTATE_INTEGRATION
KEYS = {"scene", "physics", "derived", "objects", "plant", "rows", "detector", "drawn"}
DERIVED = ("xpos", "xquat", "xmat", "xanchor", "xaxis", "site_xpos", "sensordata")
ROWS = (
    "observation", "numbers", "tau_ext", "residual", "alarm", "target", "contacts",
    "q", "qd", "current", "tau", "contact", "region", "tau_peak", *TOUCHES, "alarm_delay",
    "alarm_last", "reaches", "walks",
)  # fmt: skip
#: A collision counts as detected only by an alarm within this time after its onset [s].
LATEST = 0.5


def _identity(model: mujoco.MjModel) -> str:
    """SHA-256 of numbers that differ between scenes, even if their arrays have equal sizes."""
    numbers = (model.body_pos, model.body_mass, model.geom_size, model.geom_pos, model.dof_armature)
    return hashlib.sha256(b"".join(values.tobytes() for values in numbers)).hexdigest()


class Batch:
    """``rows`` copies of one simulation, independent of one another.

    Attributes:
        observation: shape (rows, size); the task's own entries are its last columns.
        numbers: results of the last action, one column per field of :class:`StepMetrics` and per
            quantity that the task measures.
        metrics: ``numbers`` by name, shape (rows,).
        tau_ext: external joint torque at the last physics step [N m], shape (rows, n).
        tau_peak: largest external torque of each joint in the last action [N m], (rows, n).
        target: positions of the tools' targets [m], shape (rows, arms, 3).
        residual: residual of the detector [N m], shape (rows, n); zero without a detector.
        alarm: alarm of the detector, shape (rows,).
        alarm_delay: delay of the latest collision's alarm [s], -1 without one, shape (rows,).
        contacts: pairs that each checker reported during the last action, shape (rows, checkers).
        q, qd, current, tau: positions, velocities, motor currents [A] and external torque [N m] at
            every physics step of the last action, shape (rows, substeps, n).
        contact: contacts of the arm at every physics step, by the names of :data:`CONTACT`, shape
            (rows, substeps).
        region: poses of the body regions, by the names of :data:`POSE`, shape (rows, substeps,
            regions).
        region_force, region_pressure, region_point, region_direction: the peak contact on each
            region in the last action [N, N/cm^2, m], shapes (rows, regions), (rows, regions, 3).
        reaches, walks: motions of people, person after person, see
            :func:`tauguard.envs.gym.people.draw_script`.
        drawn: values that ``randomize`` drew for each copy, by name.
    """

    def __init__(
        self,
        compiled: CompiledScene,
        rows: int,
        measures: Sequence[str] = (),
        entries: Sequence[Entry] = (),
    ) -> None:
        """Allocate the data of every copy and bind the plants.

        Args:
            compiled: the scene.
            rows: number of copies.
            measures: names of the quantities that the task measures.
            entries: the task's own entries of the observation.
        """
        self.compiled, self.rows = compiled, rows
        self.observations: list[Entry] = [*observation_table(compiled), *entries]
        self.own_entries = len(entries)
        self.actions: list[Entry] = action_table(compiled)
        n, steps = len(compiled.scene.joint_names), compiled.settings.substeps
        self.observation = np.zeros((rows, len(self.observations)))
        names = (*StepMetrics._fields, *measures)
        self.numbers = np.zeros((rows, len(names)))
        self.metrics = self.numbers.view([(name, np.float64) for name in names])[:, 0]
        self.tau_ext, self.residual = np.zeros((rows, n)), np.zeros((rows, n))
        self.alarm = np.zeros(rows, dtype=np.bool_)
        self.target = np.zeros((rows, compiled.arms, 3))
        self.q, self.qd, self.current, self.tau = (np.zeros((rows, steps, n)) for _ in range(4))
        self.contact = np.zeros((rows, steps), CONTACT)
        regions = len(compiled.regions)
        self.region = np.zeros((rows, steps, regions), POSE)
        self.tau_peak = np.zeros((rows, n))
        self.region_force, self.region_pressure = (np.zeros((rows, regions)) for _ in range(2))
        self.region_point, self.region_direction = (np.zeros((rows, regions, 3)) for _ in range(2))
        self.alarm_delay = np.full(rows, -1.0)
        self.alarm_last = np.zeros(rows, dtype=np.bool_)
        self.drawn: list[dict[str, Array]] = [{} for _ in range(rows)]
        people = max(1, len(compiled.people))
        self.reaches = np.zeros((rows, 2 * people, REACHES, _plant.REACH_WIDTH))
        self.walks = np.zeros((rows, people * WALKS, _plant.WALK_WIDTH))
        self._variants: list[Variant | None] = [None] * rows
        self._scratch = mujoco.MjData(compiled.scene.model)
        self.datas = [mujoco.MjData(compiled.scene.model) for _ in range(rows)]
        self.objects = FreeObjects(compiled, rows)
        if self.objects.grasps:  # the pose of a grasp is stored in the model
            self._variants = [vary(compiled, own_model(compiled), {}) for _ in range(rows)]
        self.plants = [self._make_plant(i) for i in range(rows)]
        self.sensing: list[Sensing] | None = None
        self.attach(compiled.settings.detector)
        checkers = compiled.settings.checkers
        self.checks = [StepChecks(compiled, checkers) for _ in range(rows)] if checkers else []
        self.contacts = np.zeros((rows, len(checkers)), dtype=np.int64)
        self._scene = _identity(compiled.scene.model)

    def __repr__(self) -> str:
        """The arm, the sizes of the tables, and the body regions."""
        regions = [region.name for region in self.compiled.regions]
        named = ": " * bool(regions) + ", ".join(regions[:2]) + ", ..." * (len(regions) > 2)
        return (
            f"Batch({self.compiled.scene.facts.name}, {self.rows} at once, {len(self.actions)} "
            f"actions, {len(self.observations)} observations, {len(regions)} regions{named})"
        )

    def attach(self, detector: object) -> None:
        """Put a detector into every copy's loop; ``None`` removes it."""
        make = listener_factory(self.compiled, detector)
        needed = make is not None or self.compiled.settings.noise
        self.sensing = [Sensing(self.compiled, make) for _ in range(self.rows)] if needed else None
        self.residual[:], self.alarm[:] = 0.0, False

    def model(self, i: int) -> mujoco.MjModel:
        """The model of copy ``i``."""
        variant = self._variants[i]
        return self.compiled.scene.model if variant is None else variant.model

    def people(self, i: int) -> tuple[Person, ...]:
        """The people of copy ``i``."""
        variant = self._variants[i]
        return self.compiled.people if variant is None else variant.people

    def draw(self, i: int, rng: np.random.Generator, stated: Mapping[str, Any]) -> None:
        """Draw the quantities of ``randomize`` for the next episode of copy ``i``."""
        known = self.compiled.settings.randomize
        if known:
            self._apply_drawn(i, draw(known, self.compiled, rng, stated))

    def _apply_drawn(self, i: int, drawn: dict[str, Array]) -> None:
        """Apply the drawn values to copy ``i``, which gets its own model and native plant."""
        if not drawn:
            return
        model = self.model(i) if self._variants[i] else own_model(self.compiled)
        self._variants[i] = variant = vary(self.compiled, model, drawn)
        self.drawn[i] = drawn
        self.plants[i] = self._make_plant(i)
        if self.sensing is not None:
            self.sensing[i].sensors = variant.drive.sensors

    def place(self, i: int, q: Array) -> None:
        """Reset copy ``i`` and put its arm at rest at ``q`` [rad], shape (n,)."""
        data = self.datas[i]
        mujoco.mj_resetData(self.model(i), data)
        data.qpos[self.compiled.scene.qpos_adr] = q

    def put(
        self,
        i: int,
        name: str,
        position: ArrayLike,
        quat_wxyz: ArrayLike = (1.0, 0.0, 0.0, 0.0),
        velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Place a free object of copy ``i`` [m, m/s]; a grasp of it ends.

        Raises:
            ArgumentError: the scene has no free object of this name.
        """
        self.objects.put(self.datas[i], name, (position, quat_wxyz, velocity))
        mujoco.mj_kinematics(self.model(i), self.datas[i])

    def where(self, i: int, name: str) -> Array:
        """Position of a free object of copy ``i`` [m], shape (3,)."""
        return np.array(self.datas[i].xpos[self.objects.body(name)])

    def grasp(self, i: int, name: str) -> None:
        """Fix a graspable object of copy ``i`` to the first arm's tool, in its present pose.

        Raises:
            ArgumentError: the scene has no object of this name with ``graspable=True``.
        """
        self.objects.grasp(self.model(i), self.datas[i], name)

    def release(self, i: int, name: str) -> None:
        """Let go of an object; see :meth:`grasp`."""
        self.datas[i].eq_active[self.objects.weld(name)] = 0

    def grasped(self, i: int, name: str) -> bool:
        """Whether the tool of copy ``i`` holds this object."""
        return bool(self.datas[i].eq_active[self.objects.weld(name)])

    def send_people(self, i: int, rng: np.random.Generator) -> None:
        """Draw the motions of the people of copy ``i`` for the next episode."""
        for p, person in enumerate(self.people(i)):
            reaches, walks = draw_script(person, rng, self.compiled.blocked)
            self.reaches[i, 2 * p : 2 * p + 2] = reaches
            self.walks[i, p * WALKS : (p + 1) * WALKS] = walks

    def start(self, i: int) -> None:
        """Begin an episode of copy ``i`` from the state in its data.

        Raises:
            StartsInContact: the arm overlaps something.
        """
        mujoco.mj_forward(self.model(i), self.datas[i])
        self.plants[i].reset()
        check_clear(self.compiled.scene, self.model(i), self._scratch, self.datas[i])
        self.residual[i], self.alarm[i], self.contacts[i] = 0.0, False, 0
        self.alarm_delay[i], self.alarm_last[i] = -1.0, False
        self.objects.begin(i, self.datas[i])
        if self.sensing is not None:
            self.sensing[i].reset()

    def get_state(self, i: int) -> dict[str, Any]:
        """The state of copy ``i``: physics, drives, rows, detector and drawn values."""
        data, model = self.datas[i], self.model(i)
        physics = np.empty(mujoco.mj_stateSize(model, STATE))
        mujoco.mj_getState(model, data, physics, STATE)
        listener = self.sensing[i].detector if self.sensing else None
        # Sensors and poses are read before the next mj_forward, which computes these fields.
        derived = {name: getattr(data, name).copy() for name in DERIVED}
        return {
            "scene": self._scene,
            "physics": physics,
            "derived": derived,
            "objects": self.objects.get_state(i, model),
            "plant": np.array(self.plants[i].state()),
            "rows": {name: getattr(self, name)[i : i + 1].copy() for name in ROWS},
            "detector": listener.get_state() if listener else None,
            "drawn": {name: values.copy() for name, values in self.drawn[i].items()},
        }

    def set_state(self, i: int, state: dict[str, Any]) -> None:
        """Restore what :meth:`get_state` returned.

        Raises:
            ArgumentError: the state is of another scene, or not from :meth:`get_state`. The copy is
                then unchanged, unless the state's arrays are damaged.
        """
        if not isinstance(state, dict) or not state.keys() >= KEYS:
            raise ArgumentError("state: expected what get_state() gave")
        if state["scene"] != self._scene:
            raise ArgumentError("state: of another scene")
        listener = self.sensing[i].detector if self.sensing else None
        own = listener.get_state() if listener else None
        if (state["detector"] is None) != (own is None):
            raise ArgumentError("state: of an environment with another detector")
        self._apply_drawn(i, {name: values.copy() for name, values in state["drawn"].items()})
        data, model = self.datas[i], self.model(i)
        if len(state["physics"]) != mujoco.mj_stateSize(model, STATE):
            raise ArgumentError("state: of another scene")
        self.plants[i].restore(state["plant"].tolist())
        self.objects.set_state(i, model, state["objects"])
        mujoco.mj_setState(model, data, state["physics"], STATE)
        for name, values in state["derived"].items():
            getattr(data, name)[:] = values
        for name, values in state["rows"].items():
            getattr(self, name)[i : i + 1] = values
        if self.sensing is not None:
            self.sensing[i].reset()
            listener = self.sensing[i].detector  # reset() made a new one
            if listener is not None:
                listener.set_state(state["detector"])

    def step(self, i: int, action: Array, rng: np.random.Generator) -> None:
        """Apply an action to copy ``i``, shape (m,)."""
        if self.checks:
            self._checked_step(i, action)
        else:
            self.plants[i].step(action)
        self._finish(i, rng)

    def step_all(
        self, actions: Array, mask: NDArray[np.bool_], rngs: list[np.random.Generator], threads: int
    ) -> None:
        """Apply actions, shape (rows, m), to the copies in ``mask`` on a thread pool."""
        if self.checks:
            for i in np.flatnonzero(mask):
                self._checked_step(int(i), actions[i])
        else:
            _plant.step_all(self.plants, actions, mask, threads)
        if self.sensing is not None or self.objects.leaving:
            for i in np.flatnonzero(mask):
                self._finish(int(i), rngs[i])

    def _finish(self, i: int, rng: np.random.Generator) -> None:
        """After the physics of an action: the sensors, and what left the workspace."""
        if (self.sensing is None and not self.objects.leaving) or self.metrics["diverged"][i]:
            return
        if self.sensing is not None:
            self._sense(i, rng)
        if self.objects.leaving and self.objects.find_left(i, self.model(i), self.datas[i]):
            self.plants[i].refresh()

    def _sense(self, i: int, rng: np.random.Generator) -> None:
        assert self.sensing is not None
        sensing = self.sensing[i]
        if self.metrics["onset"][i]:
            self.alarm_delay[i] = -1.0
        before = bool(self.alarm_last[i])
        measured = sensing.measure(rng, self.q[i], self.qd[i], self.current[i])
        self.residual[i], self.alarm[i] = sensing.detect(*measured)
        if self.alarm[i] and self.alarm_delay[i] < 0 <= self.metrics["onset_time"][i]:
            self._time_alarm(i, before)
        self.alarm_last[i] = sensing.alarms[-1]
        if self.compiled.settings.noise:
            sensing.show(self.observation[i], *measured)

    def faults(self) -> list[str]:
        """The fault of each copy's samples in the last action; "" if there is none."""
        return [one.fault for one in self.sensing] if self.sensing else [""] * self.rows

    def _time_alarm(self, i: int, before: bool) -> None:
        """Set the delay of the alarm after the onset.

        An alarm that is already on at the onset does not count; a later rise of the alarm does.
        """
        alarms = self.sensing[i].alarms if self.sensing else np.zeros(0)
        dt, now = self.compiled.settings.timestep, self.metrics["time"][i]
        rises = alarms & ~np.append(before, alarms[:-1])
        delays = now - dt * np.arange(len(alarms), 0, -1) - self.metrics["onset_time"][i]
        found = np.flatnonzero(rises & (delays > -dt / 2))
        if found.size and delays[found[0]] <= LATEST:
            self.alarm_delay[i] = max(0.0, float(delays[found[0]]))

    def _checked_step(self, i: int, action: Array) -> None:
        """Apply an action and give every physics step to the contact checkers."""
        plant, data, checks = self.plants[i], self.datas[i], self.checks[i]
        plant.begin(action)
        checks.begin(data)
        for _ in range(self.compiled.settings.substeps):
            plant.run(1)
            if not np.isfinite(data.qpos).all():
                break
            checks.see(data)
        self.contacts[i] = checks.counts
        plant.finish()

    def _make_plant(self, i: int) -> _plant.Plant:
        compiled, data, variant = self.compiled, self.datas[i], self._variants[i]
        scene = compiled.scene
        if variant is not None:
            scene = replace(scene, model=variant.model, drive=variant.drive)
        plant = make_plant(scene, compiled.nominal, compiled.gains, data)
        rows = _plant.Rows(
            observation=self.observation[i],
            metrics=self.numbers[i],
            tau_ext=self.tau_ext[i],
            target=self.target[i],
            q=self.q[i],
            qd=self.qd[i],
            current=self.current[i],
            tau=self.tau[i],
            contact=_numbers(self.contact, i),
            region=_numbers(self.region, i),
            tau_peak=self.tau_peak[i],
            touched=_plant.Touched(
                **{name.removeprefix("region_"): getattr(self, name)[i] for name in TOUCHES}
            ),
            reaches=self.reaches[i],
            walks=self.walks[i],
        )
        native = self.observations[: len(self.observations) - self.own_entries]
        around = surroundings(compiled, native, self.people(i))
        plant.surround(around, controls(compiled), rows, substeps=compiled.settings.substeps)
        return plant


def _numbers(table: NDArray[np.void], i: int) -> Array:
    """Row ``i`` of a table with named columns, as plain numbers."""
    return table[i : i + 1].view(np.float64)
