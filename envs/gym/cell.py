"""One or many running copies of a world: the native plants and the arrays that they share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.envs import _plant
from tauguard.envs.gym.actions import Entry, action_scale, action_table, observation_table
from tauguard.envs.gym.people import REACHES, WALKS, anatomy, draw_script
from tauguard.envs.gym.randomization import Variant, draw, own_model, vary
from tauguard.envs.gym.sensing import Sensing, listening
from tauguard.envs.gym.settings import CONTROLS
from tauguard.envs.gym.step_checks import StepChecks
from tauguard.envs.gym.world import RegionInfo, World
from tauguard.envs.plant import make_plant
from tauguard.models import Person

#: Columns of :attr:`Cell.figure`, in the native order.
FIGURES = (
    "time", "distance", "force", "cost", "limit_ratio", "region_force",
    "onset", "onset_time", "link", "region", "diverged", "speed_ratio",
)  # fmt: skip
(
    TIME,
    DISTANCE,
    FORCE,
    COST,
    RATIO,
    REGION_FORCE,
    ONSET,
    ONSET_TIME,
    LINK,
    REGION,
    DIVERGED,
    SPEED,
) = range(len(FIGURES))
assert len(FIGURES) == _plant.FIGURES
#: What a snapshot holds: MuJoCo's integration state, derived fields that are read before the next
#: physics step, and rows of a copy.
STATE = mujoco.mjtState.mjSTATE_INTEGRATION
DERIVED = ("xpos", "xquat", "xmat", "xanchor", "xaxis", "site_xpos", "sensordata")
ROWS = (
    "observation", "figure", "tau_ext", "residual", "alarm", "target", "contacts",
    "q", "qd", "current", "tau", "contact", "region", "tau_peak", "peak", "alarm_delay",
    "alarm_last", "cost_sum", "reaches", "walks",
)  # fmt: skip
#: An alarm later than this after the onset does not detect it [s].
LATEST = 0.5
#: What replaces an action, by its native code: nothing, velocities, no power, no power and brakes.
FREE, VELOCITY, LIMP, BRAKE = range(4)


class Cell:
    """``rows`` copies of a world that run side by side and know nothing of one another.

    Attributes:
        observation: shape (rows, size).
        figure: shape (rows, len(FIGURES)).
        tau_ext: external joint torque at the last physics step [N m], shape (rows, n).
        target: of the tools [m], shape (rows, arms, 3).
        residual: of the detector [N m], shape (rows, n); zero without one.
        alarm: of the detector, shape (rows,).
        contacts: pairs that each checker reported during the last action, shape (rows, checkers).
        q, qd, current, tau: positions, velocities, motor currents [A] and external torque [N m] at
            every physics step of the last action, shape (rows, substeps, n).
        contact: at every physics step the net force on the arm [N], and link (1-based, 0: none),
            point [m] and force [N] of the largest force on a link, shape (rows, substeps, 8).
        region: where the body regions were, position [m] and quaternion (w, x, y, z), shape
            (rows, substeps, regions, 7).
        tau_peak: external torque of the largest size over the action, by joint [N m], (rows, n).
        peak: of each body region over the action: force [N], point [m], direction of the force on
            the person, shape (rows, regions, 7); zero without a touch.
        cost_sum: of the episode's actions so far [N], shape (rows,).
        drawn: what differs from the world in each copy's episode, by name.
        alarm_delay: of the latest collision's alarm [s], -1 where there is none, shape (rows,).
        reaches, walks: what a person does, see :func:`tauguard.envs.gym.people.draw_script`.
    """

    def __init__(self, world: World, rows: int) -> None:
        """Allocate the data of every copy and bind the plants."""
        self.world, self.rows = world, rows
        self.observations: list[Entry] = observation_table(world)
        self.actions: list[Entry] = action_table(world)
        n, steps = len(world.scene.joint_names), world.settings.substeps
        self.observation = np.zeros((rows, len(self.observations)))
        self.figure = np.zeros((rows, len(FIGURES)))
        self.tau_ext, self.residual = np.zeros((rows, n)), np.zeros((rows, n))
        self.alarm = np.zeros(rows, dtype=np.bool_)
        self.target = np.zeros((rows, world.arms, 3))
        self.q, self.qd, self.current, self.tau = (np.zeros((rows, steps, n)) for _ in range(4))
        self.contact = np.zeros((rows, steps, _plant.CONTACT_WIDTH))
        regions = len(world.regions)
        self.region = np.zeros((rows, steps, regions, 7))
        self.tau_peak = np.zeros((rows, n))
        self.peak = np.zeros((rows, regions, _plant.PEAK_WIDTH))
        self.alarm_delay = np.full(rows, -1.0)
        self.alarm_last = np.zeros(rows, dtype=np.bool_)
        self.cost_sum = np.zeros(rows)
        self.drawn: list[dict[str, Array]] = [{} for _ in range(rows)]
        self.reaches = np.zeros((rows, 2, REACHES, _plant.REACH_WIDTH))
        self.walks = np.zeros((rows, WALKS, _plant.WALK_WIDTH))
        self._variants: list[Variant | None] = [None] * rows
        self.datas = [mujoco.MjData(world.scene.model) for _ in range(rows)]
        self.plants = [self._make_plant(i) for i in range(rows)]
        self.sensing: list[Sensing] | None = None
        self.attach(world.settings.detector)
        names = world.settings.checkers
        self.checks = [StepChecks(world, names) for _ in range(rows)] if names else []
        self.contacts = np.zeros((rows, len(names)), dtype=np.int64)

    def attach(self, detector: object) -> None:
        """Put a detector into every copy's loop; ``None`` takes it out."""
        make = listening(self.world, detector)
        needed = make is not None or self.world.settings.noise
        self.sensing = [Sensing(self.world, make) for _ in range(self.rows)] if needed else None
        self.residual[:], self.alarm[:] = 0.0, False

    def model(self, i: int) -> mujoco.MjModel:
        """What copy ``i`` simulates."""
        variant = self._variants[i]
        return self.world.scene.model if variant is None else variant.model

    def person(self, i: int) -> Person | None:
        """The person of copy ``i``."""
        variant = self._variants[i]
        return self.world.person if variant is None else variant.person

    def draw(self, i: int, rng: np.random.Generator, stated: Mapping[str, Any]) -> None:
        """Draw what the setting ``randomize`` names for the next episode of copy ``i``."""
        known = self.world.settings.randomize
        if known:
            self._become(i, draw(known, self.world, rng, stated))

    def _become(self, i: int, drawn: dict[str, Array]) -> None:
        """Make copy ``i`` what was drawn."""
        if not drawn:
            return
        model = self.model(i) if self._variants[i] else own_model(self.world)
        self._variants[i] = variant = vary(self.world, model, drawn)
        self.drawn[i] = drawn
        self.plants[i] = self._make_plant(i)
        if self.sensing is not None:
            self.sensing[i].sensors = variant.drive.sensors

    def place(self, i: int, q: Array) -> None:
        """Put copy ``i`` at rest at ``q`` [rad], shape (n,), everything else where it began."""
        data = self.datas[i]
        mujoco.mj_resetData(self.model(i), data)
        data.qpos[self.world.scene.qpos_adr] = q

    def send_person(self, i: int, rng: np.random.Generator) -> None:
        """Draw what the person of copy ``i`` does in the next episode, if there is one."""
        person = self.person(i)
        if person is not None:
            self.reaches[i], self.walks[i] = draw_script(person, rng)

    def start(self, i: int) -> None:
        """Begin an episode of copy ``i`` from the state in its data."""
        mujoco.mj_forward(self.model(i), self.datas[i])
        self.plants[i].reset()
        self.residual[i], self.alarm[i], self.contacts[i] = 0.0, False, 0
        self.alarm_delay[i], self.alarm_last[i] = -1.0, False
        if self.sensing is not None:
            self.sensing[i].reset()

    def get_state(self, i: int) -> dict[str, Any]:
        """Everything that copy ``i`` depends on: physics, drives, rows, detector, checkers."""
        data, model = self.datas[i], self.model(i)
        physics = np.empty(mujoco.mj_stateSize(model, STATE))
        mujoco.mj_getState(model, data, physics, STATE)
        listener = self.sensing[i].detector if self.sensing else None
        # Derived quantities as they stand: labels and kinematics are read before the next forward.
        derived = {name: getattr(data, name).copy() for name in DERIVED}
        return {
            "physics": physics,
            "derived": derived,
            "plant": np.array(self.plants[i].state()),
            "rows": {name: getattr(self, name)[i].copy() for name in ROWS},
            "detector": listener.get_state() if listener else None,
            "drawn": {name: values.copy() for name, values in self.drawn[i].items()},
        }

    def set_state(self, i: int, state: dict[str, Any]) -> None:
        """Go back to what :meth:`get_state` gave.

        Raises:
            ValueError: a state of another scene.
        """
        self._become(i, {name: values.copy() for name, values in state["drawn"].items()})
        data, model = self.datas[i], self.model(i)
        if len(state["physics"]) != mujoco.mj_stateSize(model, STATE):
            raise ValueError("state: of another scene")
        self.plants[i].restore(state["plant"].tolist())
        mujoco.mj_setState(model, data, state["physics"], STATE)
        for name, values in state["derived"].items():
            getattr(data, name)[:] = values
        for name, values in state["rows"].items():
            getattr(self, name)[i] = values
        if self.sensing is not None:
            self.sensing[i].reset()
            listener = self.sensing[i].detector
            if listener is not None:
                listener.set_state(state["detector"])

    def step(self, i: int, action: Array, rng: np.random.Generator) -> None:
        """One action of copy ``i``, shape (m,)."""
        if self.checks:
            self._checked_step(i, action)
        else:
            self.plants[i].step(action)
        self.cost_sum[i] += self.figure[i, COST]
        if self.sensing is not None:
            self._sense(i, rng)

    def step_all(
        self, actions: Array, mask: NDArray[np.bool_], rngs: list[np.random.Generator], threads: int
    ) -> None:
        """One action of every copy that ``mask`` chooses, shape (rows, m), on a thread pool."""
        if self.checks:
            for i in np.flatnonzero(mask):
                self._checked_step(int(i), actions[i])
        else:
            _plant.step_all(self.plants, actions, mask, threads)
        self.cost_sum[mask] += self.figure[mask, COST]
        if self.sensing is not None:
            for i in np.flatnonzero(mask):
                self._sense(int(i), rngs[i])

    def _sense(self, i: int, rng: np.random.Generator) -> None:
        assert self.sensing is not None
        if self.figure[i, DIVERGED]:
            return
        sensing = self.sensing[i]
        if self.figure[i, ONSET]:
            self.alarm_delay[i] = -1.0
        before = bool(self.alarm_last[i])
        measured = sensing.measure(rng, self.q[i], self.qd[i], self.current[i])
        self.residual[i], self.alarm[i] = sensing.detect(*measured)
        if self.alarm[i] and self.alarm_delay[i] < 0 <= self.figure[i, ONSET_TIME]:
            self._time_alarm(i, before)
        self.alarm_last[i] = sensing.alarms[-1]
        if self.world.settings.noise:
            sensing.show(self.observation[i], *measured)

    def faults(self) -> list[str]:
        """What is wrong with each copy's samples of the last action, "" for nothing."""
        return [one.fault for one in self.sensing] if self.sensing else [""] * self.rows

    def _time_alarm(self, i: int, before: bool) -> None:
        """How long after the onset the alarm rose; one that was up before detects nothing."""
        alarms = self.sensing[i].alarms if self.sensing else np.zeros(0)
        dt, now = self.world.settings.timestep, self.figure[i, TIME]
        rises = alarms & ~np.append(before, alarms[:-1])
        delays = now - dt * np.arange(len(alarms), 0, -1) - self.figure[i, ONSET_TIME]
        found = np.flatnonzero(rises & (delays > -dt / 2))
        if found.size and delays[found[0]] <= LATEST:
            self.alarm_delay[i] = max(0.0, float(delays[found[0]]))

    def _checked_step(self, i: int, action: Array) -> None:
        """A step with contact checkers: each sees every physics step."""
        plant, data, checks = self.plants[i], self.datas[i], self.checks[i]
        plant.begin(action)
        checks.begin(data)
        for _ in range(self.world.settings.substeps):
            plant.run(1)
            if not np.isfinite(data.qpos).all():
                break
            checks.see(data)
        self.contacts[i] = checks.counts
        plant.finish()

    def _make_plant(self, i: int) -> _plant.Plant:
        world, data, variant = self.world, self.datas[i], self._variants[i]
        scene = world.scene
        if variant is not None:
            scene = replace(scene, model=variant.model, drive=variant.drive)
        plant = make_plant(scene, world.nominal, world.gains, data)
        rows = _plant.Rows(
            observation=self.observation[i],
            figure=self.figure[i],
            tau_ext=self.tau_ext[i],
            target=self.target[i],
            q=self.q[i],
            qd=self.qd[i],
            current=self.current[i],
            tau=self.tau[i],
            contact=self.contact[i],
            region=self.region[i],
            tau_peak=self.tau_peak[i],
            peak=self.peak[i],
            reaches=self.reaches[i],
            walks=self.walks[i],
        )
        around = _surroundings(world, self.observations, self.person(i))
        plant.surround(around, _controls(world), rows, substeps=world.settings.substeps)
        return plant


def _controls(world: World) -> _plant.Controls:
    settings = world.settings
    centre, scale = action_scale(world)
    return _plant.Controls(
        mode=CONTROLS.index(settings.control),
        period=float(world.scene.model.opt.timestep) * settings.substeps,
        scale=scale.tolist(),
        centre=centre.tolist(),
        max_speed=world.max_speed.tolist(),
        torque_limit=world.torque_limit.tolist(),
        low=world.joint_range[:, 0].tolist(),
        high=world.joint_range[:, 1].tolist(),
    )


def _surroundings(
    world: World, observations: list[Entry], person: Person | None
) -> _plant.Surroundings:
    model, scene = world.scene.model, world.scene
    each = len(scene.joint_names) // world.arms
    links = [
        _plant.Link(
            joint=int(joint),
            body=int(scene.link_bodies[i]),
            first=i // each * each,
            slide=bool(model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE),
            mass=float(world.nominal_mass[i]),
            com=world.nominal_com[i].tolist(),
        )
        for i, joint in enumerate(world.ids())
    ]
    labels = scene.spec.labels
    return _plant.Surroundings(
        links=links,
        gravity=model.opt.gravity.tolist(),
        tools=[_plant.Tool(site=site, body=body, first=first) for site, body, first in world.tools],
        regions=[_region(world, region) for region in world.regions],
        person_begin=next((k for k, r in enumerate(world.regions) if r.mocap >= 0), -1),
        person=anatomy(person),
        sensor_begin=_sensor(model, "contact_link1") if labels else -1,
        low=[entry.low for entry in observations],
        high=[entry.high for entry in observations],
    )


def _region(world: World, region: RegionInfo) -> _plant.Region:
    model, joint = world.scene.model, region.joint
    return _plant.Region(
        body=region.body,
        joint=joint,
        qpos=int(model.jnt_qposadr[joint]) if joint >= 0 else -1,
        dof=int(model.jnt_dofadr[joint]) if joint >= 0 else -1,
        mocap=region.mocap,
        held=region.held,
        sensor=_sensor(model, f"contact_{region.name}") if world.scene.spec.labels else -1,
        quasi_static=region.quasi_static,
        transient=region.transient,
        span=region.span,
        speed=region.speed,
    )


def _sensor(model: mujoco.MjModel, name: str) -> int:
    """Address of a sensor's numbers."""
    return int(model.sensor_adr[model.sensor(name).id])
