"""From an episode to a trace: compose, move, strike, record, label, measure."""

from __future__ import annotations

import hashlib
import importlib.metadata
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.detectors import RobotNumbers, inverse_dynamics
from tauguard.envs import labels
from tauguard.envs.episode import CollisionPlan, Episode, PayloadPick
from tauguard.envs.injection import (
    CLAMP_HOLD,
    LEAD,
    Aim,
    Target,
    body_points,
    clamp_centre,
    launch,
    pulse_wrench,
)
from tauguard.envs.loop import Recording, SimulationLoop
from tauguard.envs.motions import Workspace, random_motion
from tauguard.models import (
    Clamp,
    Drive,
    Scene,
    SceneSpec,
    Striker,
    compose,
    cura6,
    cura6_drive,
    pin_model,
    set_payload,
)
from tauguard.traces import Trace, Truth

Array = NDArray[np.float64]

#: Out of everybody's way: where an obstacle waits [m].
PARKED = np.array([0.0, 0.0, 50.0])
#: Targets to try for one collision, and strengths to try on each.
TARGETS, TRIES = 16, 10
#: A person is not pushed harder in a collision worth detecting: such a target is given up [N].
FORCE_LIMIT = 400.0
#: An obstacle that touches the arm sooner than this after it was put there stood in its way [s].
CLEAR = 0.01
#: A clamp's strength counts from this far in front of the arm's deepest reach [m]: its depth is
#: the strength less this, and may be negative where another part of the link reaches further.
CLAMP_OFFSET = 0.03
#: First guesses: strike speed [m/s], clamp depth from the offset [m], pulse force [N].
STRENGTH = {"strike": 0.5, "clamp": CLAMP_OFFSET, "pulse": 80.0}
#: What an obstacle or a person can do: strikes [m/s], clamps [m], pulses [N].
STRENGTH_RANGE = {"strike": (0.02, 6.0), "clamp": (0.005, 0.1), "pulse": (1.0, 1500.0)}
#: Largest factor between two tries of a strength.
STRENGTH_FACTOR = {"strike": 10.0, "clamp": 1.3, "pulse": 10.0}


@dataclass(frozen=True)
class Window:
    """One injected collision as it was carried out."""

    begin: int  #: first row
    recording: Recording
    wrenches: labels.Wrenches
    peak_tau: float  #: [N m]
    peak_force: float  #: [N]


def workspace(scene: Scene) -> Workspace:
    """Where the arm works: a box around its home pose, free of self-collision and of the floor."""
    model, data = scene.model, mujoco.MjData(scene.model)
    home = np.array(cura6.HOME)
    spread = np.array([1.6, 0.55, 0.7, 1.0, 1.0, 1.5])
    limits = model.jnt_range[[int(model.joint(name).id) for name in scene.joint_names]]
    links = [int(b) for b in scene.link_bodies[2:]]

    def allowed(q: Array) -> bool:
        data.qpos[scene.qpos_adr] = q
        mujoco.mj_kinematics(model, data)
        low = min(float(data.xpos[b][2]) for b in links)
        near = min(float(np.hypot(*data.xpos[b][:2])) for b in links[1:])
        return low > 0.15 and near > 0.22

    return Workspace(
        low=np.maximum(home - spread, limits[:, 0]),
        high=np.minimum(home + spread, limits[:, 1]),
        max_speed=np.array(cura6.MAX_SPEED),
        max_acceleration=np.array(cura6.MAX_ACCELERATION),
        allowed=allowed,
    )


def scene_for(episode: Episode) -> Scene:
    """The scene that an episode needs, and nothing else."""
    kinds = {plan.kind for plan in episode.collisions}
    carries = episode.payload_g > 0 or any(pick.payload_g > 0 for pick in episode.picks)
    scene = compose(
        SceneSpec(
            timestep=episode.timestep,
            mismatch=episode.mismatch,
            payload=carries,
            striker=Striker() if "strike" in kinds else None,
            clamp=Clamp() if "clamp" in kinds else None,
            labels=bool(kinds & {"strike", "clamp"}),
        )
    )
    drive = scene.drive
    if episode.ideal_drive:
        drive = replace(
            drive, friction=None, ripple=None, sensors=None, electrical_time_constant=None
        )
    elif episode.temperature is not None and drive.friction is not None:
        drive = replace(drive, friction=replace(drive.friction, temperature=episode.temperature))
    return replace(scene, drive=drive)


class Simulation:
    """An episode while it runs."""

    def __init__(self, episode: Episode, nominal: Drive | None = None) -> None:
        """Compose the scene, plan the motion and the feed-forward torques.

        Args:
            episode: what to simulate.
            nominal: what the controller believes about the drive (default: the arm's nominal one).
        """
        self.episode = episode
        self.scene = scene_for(episode)
        self.nominal = nominal or cura6_drive()
        streams = np.random.SeedSequence(episode.seed).spawn(3)
        self._motion_rng, self._aim_rng, self._sensor_rng = map(np.random.default_rng, streams)
        self.motion = random_motion(
            self._motion_rng,
            workspace(self.scene),
            episode.seconds,
            episode.speed,
            episode.timestep,
        )
        self.robot = RobotNumbers.from_pin(pin_model(self.scene.arm_xml))
        self._feed_forward = inverse_dynamics(
            self.robot, self.motion.q, self.motion.qd, self.motion.qdd
        )
        self.loop = SimulationLoop(self.scene, self.nominal)
        self.loop.reset(self.motion.q[0])
        self._payload = 0.0
        self._windows: list[Window] = []

    def run(self) -> Trace:
        """Simulate the whole episode."""
        parts: list[Recording] = []
        payload = np.full(len(self.motion.t), self.episode.payload_g / 1000)
        row, injected = 0, []
        jobs: list[CollisionPlan | PayloadPick] = [*self.episode.collisions, *self.episode.picks]
        jobs.sort(key=lambda item: item.time)
        self._carry(self.episode.payload_g)
        for index, job in enumerate(jobs):
            stop = len(payload) if index + 1 == len(jobs) else self._row(jobs[index + 1].time)
            start = max(row, self._row(job.time))
            if isinstance(job, CollisionPlan):
                start, window = self._collide(job, row, start, stop, parts)
                if window is not None:
                    injected.append((window.begin * self.episode.timestep, job.kind))
                    parts.append(window.recording)
                    self._windows.append(window)
                    start = window.begin + len(window.recording.q)
            else:
                parts.append(self._follow(row, start))
                self._carry(job.payload_g)
                payload[start:] = job.payload_g / 1000
            row = start
        parts.append(self._follow(row, len(payload)))
        return self._trace(_joined(parts), payload, injected)

    def _row(self, time: float) -> int:
        return round(time / self.episode.timestep)

    def _carry(self, grams: float) -> None:
        if self.scene.payload_body >= 0 and grams / 1000 != self._payload:
            set_payload(self.loop.model, self.loop.data, self.scene.payload_body, grams / 1000)
            self._payload = grams / 1000

    def _follow(
        self, start: int, stop: int, wrench: Array | None = None, body: int = -1
    ) -> Recording:
        rows = slice(start, stop)
        return self.loop.run(
            self.motion.q[rows], self.motion.qd[rows], self._feed_forward[rows], wrench, body
        )

    def _collide(
        self, plan: CollisionPlan, row: int, start: int, stop: int, parts: list[Recording]
    ) -> tuple[int, Window | None]:
        """Runs up to the collision's window (into ``parts``) and carries the collision out there.

        Returns:
            The row reached before the window, and the window; none where no target fitted.
        """
        lead = 0 if plan.kind == "pulse" else self._row(LEAD)
        tail = self._row(0.3 if plan.kind == "strike" else plan.duration + CLAMP_HOLD)
        aim = Aim(self.scene, self.motion)
        late = replace(plan, time=max(plan.time, (row + lead) * self.episode.timestep))
        at = row
        for attempt in range(TARGETS):
            late = self._relaxed(late, attempt)
            target = aim.find(late, self._aim_rng, stop - tail)
            if target is None or target.row + tail > stop or target.row - lead < at:
                continue
            begin = target.row - lead
            parts.append(self._follow(at, begin))
            at = begin
            saved = self.loop.save()
            window = self._search(late, target, begin, target.row + tail)
            if window is not None:
                return begin, window
            self.loop.restore(saved)
        parts.append(self._follow(at, max(at, start)))
        return max(at, start), None

    def _relaxed(self, plan: CollisionPlan, attempt: int) -> CollisionPlan:
        """The plan as asked at first, then without what the motion may not offer.

        A dwell may be missing, and a link may not move towards where a clamp could stand.
        """
        if attempt < TARGETS // 4:
            return plan
        if plan.kind != "clamp":
            return replace(plan, at_rest=False)
        links = len(self.scene.link_bodies)
        return replace(plan, link=int(self._aim_rng.integers(2, links + 1)))

    def _search(self, plan: CollisionPlan, target: Target, begin: int, end: int) -> Window | None:
        """Repeats the window until the achieved peak torque lies in the plan's stratum.

        The strength is scaled by what was achieved until the stratum is bracketed, then bisected
        (geometrically). ``None`` where it cannot be reached from this target.
        """
        strength = plan.strength or STRENGTH[plan.kind]
        below, above = STRENGTH_RANGE[plan.kind]
        saved = self.loop.save()
        bracket: list[float | None] = [None, None]
        for _ in range(TRIES):
            self.loop.restore(saved)
            window = self._attempt(plan, target, strength, begin, end)
            if window is None or window.peak_force > FORCE_LIMIT:
                return None
            if plan.severity is None or plan.severity[0] <= window.peak_tau < plan.severity[1]:
                return window
            bracket[int(window.peak_tau >= plan.severity[1])] = strength
            if bracket[0] is not None and bracket[1] is not None:
                wanted = float(np.sqrt(bracket[0] * bracket[1]))
            else:
                goal = float(np.sqrt(plan.severity[0] * plan.severity[1]))
                most = STRENGTH_FACTOR[plan.kind]
                wanted = strength * float(
                    np.clip(goal / max(window.peak_tau, 1e-3), 1 / most, most)
                )
            if not below <= wanted <= above:
                return None
            strength = wanted
        return None

    def _attempt(
        self, plan: CollisionPlan, target: Target, strength: float, begin: int, end: int
    ) -> Window | None:
        """The window with this strength; ``None`` where the obstacle touched too early."""
        scene, dt = self.scene, self.episode.timestep
        rows = end - begin
        wrench, body = None, -1
        if plan.kind == "pulse":
            com = body_points(scene, self.motion.q[begin:end], target.body)
            wrench = pulse_wrench(target, com, strength, plan.duration, dt, rows, 0)
            body = target.body
        elif plan.kind == "strike":
            self._launch(target, strength)
        else:
            self._place_clamp(target, strength - CLAMP_OFFSET, end)
        recording = self._follow(begin, end, wrench, body)
        self._park(plan.kind)
        wrenches = (
            self._pulse_truth(wrench, target, recording, dt)
            if wrench is not None
            else labels.Wrenches.from_contacts(recording.contact)
        )
        if plan.kind != "pulse" and (wrenches.force[: self._row(CLEAR)] != 0).any():
            return None
        tau = labels.external_torque(scene, recording.q, wrenches)
        peak_tau = float(np.abs(tau[:, :4]).max(initial=0.0))
        peak_force = float(np.linalg.norm(wrenches.force, axis=2).max(initial=0.0))
        return Window(begin, recording, wrenches, peak_tau, peak_force)

    def _launch(self, target: Target, speed: float) -> None:
        model, data = self.scene.model, self.loop.data
        body = model.body("striker")
        position, velocity = launch(target, speed, float(model.geom_size[body.geomadr[0], 0]))
        joint = model.joint(int(body.jntadr[0]))
        data.qpos[joint.qposadr[0] : joint.qposadr[0] + 7] = [*position, 1, 0, 0, 0]
        data.qvel[joint.dofadr[0] : joint.dofadr[0] + 6] = [*velocity, 0, 0, 0]

    def _place_clamp(self, target: Target, depth: float, end: int) -> None:
        model = self.scene.model
        body = model.body("clamp")
        references = self.motion.q[target.row : end]
        path = body_points(self.scene, references, target.body, target.point)
        radius = float(model.geom_size[int(body.geomadr[0]), 0])
        self.loop.data.mocap_pos[body.mocapid[0]] = clamp_centre(target, path, depth, radius)

    def _park(self, kind: str) -> None:
        model, data = self.scene.model, self.loop.data
        if kind == "strike":
            joint = model.joint(int(model.body("striker").jntadr[0]))
            data.qpos[joint.qposadr[0] : joint.qposadr[0] + 7] = [*PARKED, 1, 0, 0, 0]
            data.qvel[joint.dofadr[0] : joint.dofadr[0] + 6] = 0
        elif kind == "clamp":
            data.mocap_pos[model.body("clamp").mocapid[0]] = -PARKED

    def _pulse_truth(
        self, wrench: Array, target: Target, recording: Recording, dt: float
    ) -> labels.Wrenches:
        """The wrench that acted, told about the pushed point instead of the centre of mass."""
        rows = len(wrench)
        found = labels.Wrenches.empty(rows, len(self.scene.link_bodies))
        link = int(np.flatnonzero(np.asarray(self.scene.link_bodies) == target.body)[0])
        force = wrench[:, :3]
        point = target.point + np.outer(np.arange(rows) * dt, target.velocity)
        com = body_points(self.scene, recording.q, target.body)
        found.force[:, link] = force
        found.torque[:, link] = wrench[:, 3:] - np.cross(point - com, force)
        found.point[:, link] = point
        return found

    def _trace(
        self, recording: Recording, payload: Array, injected: list[tuple[float, str]]
    ) -> Trace:
        scene, episode, motion = self.scene, self.episode, self.motion
        wrenches = labels.Wrenches.from_contacts(recording.contact)
        if not recording.contact.shape[1]:
            wrenches = labels.Wrenches.empty(len(motion.t), len(scene.link_bodies))
        for window in self._windows:
            rows = slice(window.begin, window.begin + len(window.recording.q))
            wrenches.force[rows] = window.wrenches.force
            wrenches.torque[rows] = window.wrenches.torque
            wrenches.point[rows] = window.wrenches.point
        tau_ext = labels.external_torque(scene, recording.q, wrenches)
        truth = _truth(motion.t, scene, recording, wrenches, tau_ext, payload, injected)
        sensors = scene.drive.sensors
        q, qd, current = recording.q, recording.qd, recording.current
        if sensors is not None:
            q, qd, current = sensors.measure(self._sensor_rng, q, qd, current)
        return Trace(
            joint_names=tuple(scene.joint_names),
            t=motion.t,
            q=q,
            qd=qd,
            current=current,
            q_des=motion.q,
            qd_des=motion.qd,
            qdd_des=motion.qdd,
            truth=truth,
            meta={
                "seed": str(episode.seed),
                "config_sha256": episode.config_hash,
                "model_sha256": hashlib.sha256(scene.xml.encode()).hexdigest(),
                "tauguard": importlib.metadata.version("tauguard"),
                "mujoco": mujoco.__version__,
            },
            attachments={
                "scene.xml": scene.xml,
                "arm.xml": scene.arm_xml,
                "episode.json": episode.to_json(),
            },
        )


def _joined(parts: list[Recording]) -> Recording:
    return Recording(
        *(
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("q", "qd", "current", "contact", "poses")
        )
    )


def _truth(
    t: Array,
    scene: Scene,
    recording: Recording,
    wrenches: labels.Wrenches,
    tau_ext: Array,
    payload: Array,
    injected: list[tuple[float, str]],
) -> Truth:
    size = np.linalg.norm(wrenches.force, axis=2)
    strongest = size.argmax(axis=1)
    rows = np.arange(len(t))
    touched = size[rows, strongest] > 0
    return Truth(
        tau_ext=tau_ext,
        contact_force=np.linalg.norm(wrenches.force.sum(axis=1), axis=1),
        collisions=labels.collisions(t, wrenches, tau_ext, injected),
        payload=payload,
        contact_link=np.where(touched, strongest + 1, 0).astype(np.int64),
        contact_point=np.where(touched[:, None], wrenches.point[rows, strongest], np.nan),
        contact_vector=np.where(touched[:, None], wrenches.force[rows, strongest], 0.0),
        obstacle_names=tuple(scene.obstacle_names),
        obstacle_poses=_matrices(recording.poses),
    )


def _matrices(poses: Array) -> Array:
    """Positions and quaternions (wxyz), shape (T, k, 7), as homogeneous matrices (T, k, 4, 4)."""
    w, x, y, z = np.moveaxis(poses[..., 3:], -1, 0)
    out = np.zeros((*poses.shape[:2], 4, 4))
    out[..., 0, 0], out[..., 0, 1], out[..., 0, 2] = (
        1 - 2 * (y * y + z * z),
        2 * (x * y - w * z),
        2 * (x * z + w * y),
    )
    out[..., 1, 0], out[..., 1, 1], out[..., 1, 2] = (
        2 * (x * y + w * z),
        1 - 2 * (x * x + z * z),
        2 * (y * z - w * x),
    )
    out[..., 2, 0], out[..., 2, 1], out[..., 2, 2] = (
        2 * (x * z - w * y),
        2 * (y * z + w * x),
        1 - 2 * (x * x + y * y),
    )
    out[..., :3, 3] = poses[..., :3]
    out[..., 3, 3] = 1
    return out


def simulate(episode: Episode, nominal: Drive | None = None) -> Trace:
    """Simulate ``episode``: the same episode gives the same bytes.

    Args:
        episode: what to simulate.
        nominal: what the controller believes about the drive (default: the arm's nominal one).

    Raises:
        SimulationDiverged: the simulation left every sensible range.
    """
    return Simulation(episode, nominal).run()
