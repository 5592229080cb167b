"""Simulate an episode: scene, motion, injected collisions, truth and measured signals."""

from __future__ import annotations

import hashlib
import importlib.metadata
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.detectors import RobotNumbers, inverse_dynamics
from tauguard.envs.controllers import friction_torque
from tauguard.envs.episodes import labels
from tauguard.envs.episodes.episode import CollisionPlan, Episode, PayloadPick
from tauguard.envs.episodes.loop import AlongMotion, Rollout, SimulationLoop
from tauguard.envs.episodes.motions import Workspace, random_motion
from tauguard.envs.episodes.poses import Poses
from tauguard.envs.episodes.striking import Striking, Window
from tauguard.findings import ArgumentError
from tauguard.models import (
    Clamp,
    Drive,
    Scene,
    SceneSpec,
    Striker,
    compose,
    cura6,
    pin_model,
    set_payload,
    without_losses,
)
from tauguard.models.scene import masks_match
from tauguard.traces import CheckedContacts, Trace, Truth

if TYPE_CHECKING:
    from tauguard.contacts import Checker


#: Range of drawn poses around the CURA6-like arm's home [rad].
OWN_SPREAD = (1.6, 0.55, 0.7, 1.0, 1.0, 1.5)
#: Least height of links above the floor, and least distance of links from the base's axis [m].
CLEARANCE = (0.15, 0.22)


def workspace(scene: Scene) -> Workspace:
    """The workspace: a box around home in which the arm touches neither itself nor the floor."""
    model, data, facts = scene.model, mujoco.MjData(scene.model), scene.facts
    own = facts.name in cura6.NAMES
    spread = np.array(OWN_SPREAD) if own else facts.spread
    ids = [int(model.joint(name).id) for name in scene.joint_names]
    limited = model.jnt_limited[ids].astype(bool)[:, None]
    limits = np.where(limited, model.jnt_range[ids], [-np.inf, np.inf])
    links = [int(b) for b in scene.link_bodies[2:]]
    arm = np.flatnonzero(np.isin(model.geom_bodyid, scene.link_bodies))

    def clearance(q: Array) -> tuple[float, float]:
        data.qpos[scene.qpos_adr] = q
        mujoco.mj_kinematics(model, data)
        low = min((float(data.xpos[b][2]) for b in links), default=np.inf)
        near = min((float(np.hypot(*data.xpos[b][:2])) for b in links[1:]), default=np.inf)
        return low, near

    # For an arm whose home pose has little clearance, half of this clearance is enough.
    at_home = (np.inf, np.inf) if own else clearance(facts.home)
    least = [min(*pair) for pair in zip(CLEARANCE, np.multiply(at_home, 0.5), strict=True)]

    def allowed(q: Array) -> bool:
        low, near = clearance(q)
        if not (low > least[0] and near > least[1]):
            return False
        if not scene.spec.objects:
            return True
        mujoco.mj_fwdPosition(model, data)
        return not (data.contact.dist[np.isin(data.contact.geom, arm).any(axis=1)] <= 0).any()

    return Workspace(
        low=np.maximum(facts.home - spread, limits[:, 0]),
        high=np.minimum(facts.home + spread, limits[:, 1]),
        max_speed=facts.max_speed,
        max_acceleration=facts.max_acceleration,
        allowed=allowed,
    )


def scene_for(episode: Episode, visuals: bool = True) -> Scene:
    """The scene that an episode needs; ``visuals`` as for ``compose``."""
    kinds = {plan.kind for plan in episode.collisions}
    carries = episode.payload_g > 0 or any(pick.payload_g > 0 for pick in episode.picks)
    scene = compose(
        SceneSpec(
            timestep=episode.timestep,
            arm=episode.arm,
            mismatch=episode.mismatch,
            payload=carries,
            striker=Striker() if "strike" in kinds else None,
            clamp=Clamp() if "clamp" in kinds else None,
            labels=bool(kinds & {"strike", "clamp"} or episode.objects),
            objects=episode.objects,
        ),
        visuals,
    )
    if not can_touch(scene.model):
        scene.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    drive = scene.drive
    if episode.ideal_drive:
        return without_losses(scene)
    if episode.temperature is not None and drive.friction is not None:
        drive = replace(drive, friction=replace(drive.friction, temperature=episode.temperature))
    return replace(scene, drive=drive)


def can_touch(model: mujoco.MjModel) -> bool:
    """Whether contacts are enabled for any two geoms of the scene."""
    return bool(model.npair or model.nflex or masks_match(model))


class Simulation:
    """The simulation of one episode."""

    def __init__(
        self,
        episode: Episode,
        nominal: Drive | None = None,
        checkers: Sequence[str | Checker] = (),
        without: Sequence[str] = (),
    ) -> None:
        """Compose the scene, plan the motion and the feed-forward torques.

        Args:
            episode: what to simulate.
            nominal: drive that the controller assumes (default: the arm's nominal one).
            checkers: contact checkers whose reports go into the trace.
            without: parts of the drives to leave out, see :data:`tauguard.models.drive.PARTS`.
        """
        self._checkers = [_known(c) for c in checkers]
        self.episode, self._without = episode, tuple(without)
        self.scene = scene_for(episode, visuals=bool(checkers))
        self.scene = replace(self.scene, drive=self.scene.drive.without(*without))
        self.nominal = (nominal or self.scene.facts.nominal).without(*without)
        streams = np.random.SeedSequence(episode.seed).spawn(3)
        motion_rng, aim_rng, self._sensor_rng = map(np.random.default_rng, streams)
        self.motion = random_motion(
            motion_rng,
            workspace(self.scene),
            episode.seconds,
            episode.speed,
            episode.timestep,
        )
        self.robot = RobotNumbers.from_pin(pin_model(self.scene.arm_model))
        needed = inverse_dynamics(self.robot, self.motion.q, self.motion.qd, self.motion.qdd)
        # The friction that the servo compensates.
        known = friction_torque(self.nominal.friction, self.motion.qd)
        self._feed_forward = needed + self.scene.facts.compensation * known
        struck = SimulationLoop(self.scene, self.nominal)
        struck.reset(self.motion.q[0])
        self._rollout = struck.room_for(len(self.motion.t))
        whole = AlongMotion(struck, self.motion, self._feed_forward, self._rollout)
        self._follow = self._apart(whole)
        self.loop = self._follow.loop
        self.striking = Striking(self.scene, self._follow, whole, aim_rng)
        self._payload = 0.0
        self._windows: list[Window] = []
        #: Planned collisions that did not occur, and why; filled by :meth:`run`.
        self.missed: list[str] = []

    def _apart(self, whole: AlongMotion) -> AlongMotion:
        """The motion in a scene without striker and clamp: a step takes 3/5 of the time.

        It gives the same bits while neither can touch the arm.
        """
        if self.episode.objects or not self.scene.obstacle_names:
            return whole
        bare = scene_for(replace(self.episode, collisions=()), visuals=False)
        if bare.model.nv > len(bare.joint_names):  # joints of a passive gripper are not handed over
            return whole
        loop = SimulationLoop(replace(bare, drive=self.scene.drive), self.nominal)
        loop.reset(self.motion.q[0])
        states = self._rollout
        states = replace(states, contact=states.contact[:, :0], poses=states.poses[:, :0])
        return replace(whole, loop=loop, recorded=states)

    def run(self) -> Trace:
        """Simulate the whole episode."""
        payload = np.full(len(self.motion.t), self.episode.payload_g / 1000)
        row, injected = 0, []
        jobs: list[CollisionPlan | PayloadPick] = [*self.episode.collisions, *self.episode.picks]
        jobs.sort(key=lambda item: item.time)
        self._carry(self.episode.payload_g)
        for index, job in enumerate(jobs):
            stop = len(payload) if index + 1 == len(jobs) else self._row(jobs[index + 1].time)
            start = max(row, self._row(job.time))
            if isinstance(job, CollisionPlan):
                start, window = self.striking.carry_out(job, row, start, stop)
                if isinstance(window, str):
                    self.missed.append(f"{job.kind} on link {job.link} at {job.time:g} s: {window}")
                else:
                    injected.append((window.begin * self.episode.timestep, job.kind))
                    self._windows.append(window)
                    start = window.begin + len(window.rollout.q)
            else:
                self._follow(row, start)
                self._carry(job.payload_g)
                payload[start:] = job.payload_g / 1000
            row = start
        self._follow(row, len(payload))
        return self._trace(self._rollout, payload, injected)

    def _row(self, time: float) -> int:
        return round(time / self.episode.timestep)

    def _carry(self, grams: float) -> None:
        if self.scene.payload_body >= 0 and grams / 1000 != self._payload:
            for loop in {self.loop, self.striking.loop}:
                set_payload(loop.model, loop.data, loop.scene.payload_body, grams / 1000)
            self._payload = grams / 1000

    def _contacts(self, rollout: Rollout) -> tuple[CheckedContacts, ...]:
        if not self._checkers:
            return ()
        from tauguard.envs.episodes.checking import checked

        return checked(self.scene, self.motion.t, rollout, self._checkers)

    def _trace(self, rollout: Rollout, payload: Array, injected: list[tuple[float, str]]) -> Trace:
        scene, episode, motion = self.scene, self.episode, self.motion
        wrenches = labels.Wrenches.from_contacts(rollout.contact)
        if not rollout.contact.shape[1]:  # no contact sensors: only pulses push the links
            links = len(scene.link_bodies) if self._windows else 0
            wrenches = labels.Wrenches.empty(len(motion.t), links)
        for window in self._windows:
            rows = slice(window.begin, window.begin + len(window.rollout.q))
            wrenches.force[rows] = window.wrenches.force
            wrenches.torque[rows] = window.wrenches.torque
            wrenches.point[rows] = window.wrenches.point
        tau_ext = labels.external_torque(Poses(scene), rollout.q, wrenches)
        truth = _truth(motion.t, scene, rollout, wrenches, tau_ext, payload, injected)
        if (merged := len(injected) - len(truth.collisions)) > 0:
            self.missed.append(f"{merged} within 0.5 s of another collision: they count as one")
        sensors, rng = scene.drive.sensors, self._sensor_rng
        q, qd, current = rollout.q, rollout.qd, rollout.current
        if sensors is not None:
            player = sensors.player(episode.timestep, rng)
            q, qd, current = sensors.measure(rng, q, qd, current, player)
        trace = Trace(
            joint_names=tuple(scene.joint_names),
            t=motion.t,
            q=q,
            qd=qd,
            current=current,
            q_des=motion.q,
            qd_des=motion.qd,
            qdd_des=motion.qdd,
            truth=truth,
            contacts=self._contacts(rollout),
            meta={
                "seed": str(episode.seed),
                "config_sha256": episode.config_hash,
                "model_sha256": hashlib.sha256(scene.xml.encode()).hexdigest(),
                "tauguard": importlib.metadata.version("tauguard"),
                "mujoco": mujoco.__version__,
                **({} if episode.arm == "cura6" else {"arm": episode.arm}),
                **({"without": ",".join(self._without)} if self._without else {}),
                **({"missed": "\n".join(self.missed)} if self.missed else {}),
            },
            attachments={
                "scene.xml": scene.xml,
                **scene.nominal_texts,
                "episode.json": episode.to_json(),
            },
        )
        if sensors is None or sensors.rate == 0:
            return trace
        return sampled(trace, sensors.samples(trace.t, rng))


def _truth(
    t: Array,
    scene: Scene,
    rollout: Rollout,
    wrenches: labels.Wrenches,
    tau_ext: Array,
    payload: Array,
    injected: list[tuple[float, str]],
) -> Truth:
    force, where, link = np.zeros(len(t)), np.full((len(t), 3), np.nan), np.zeros(len(t), np.int64)
    vector, rows = np.zeros((len(t), 3)), wrenches.rows()
    if len(rows):
        pushed = wrenches.force[rows]
        size = np.linalg.norm(pushed, axis=2)
        strongest = size.argmax(axis=1)
        touched = size.max(axis=1) > 0
        force[rows] = np.linalg.norm(pushed.sum(axis=1), axis=1)
        link[rows[touched]] = strongest[touched] + 1
        where[rows[touched]] = wrenches.point[rows[touched], strongest[touched]]
        vector[rows[touched]] = pushed[touched, strongest[touched]]
    return Truth(
        tau_ext=tau_ext,
        contact_force=force,
        collisions=labels.collisions(t, wrenches, tau_ext, injected),
        payload=payload,
        contact_link=link,
        contact_point=where,
        contact_vector=vector,
        obstacle_names=tuple(scene.obstacle_names),
        obstacle_poses=labels.homogeneous(rollout.poses[..., :3], rollout.poses[..., 3:]),
    )


def sampled(trace: Trace, rows: NDArray[np.intp]) -> Trace:
    """The trace at some of its rows; the times of collisions do not change."""
    n = len(trace.t)
    truth = trace.truth
    if truth is not None:
        truth = replace(truth, **_rows_of(truth, rows, n))
    return replace(trace, truth=truth, **_rows_of(trace, rows, n))


def _rows_of(values: Trace | Truth, rows: NDArray[np.intp], count: int) -> dict[str, Any]:
    """The chosen rows of the arrays that have ``count`` rows."""
    return {
        name: value[rows]
        for name, value in vars(values).items()
        if isinstance(value, np.ndarray) and len(value) == count
    }


def simulate(
    episode: Episode,
    nominal: Drive | None = None,
    checkers: Sequence[str | Checker] = (),
    without: Sequence[str] = (),
) -> Trace:
    """Simulate ``episode``; equal arguments give equal bytes.

    Args:
        episode: what to simulate.
        nominal: drive that the controller assumes (default: the arm's nominal one).
        checkers: contact checkers, or their names; their reports go into ``Trace.contacts`` and
            change nothing else.
        without: parts of the drives to leave out, see :data:`tauguard.models.drive.PARTS`.

    Raises:
        SimulationDiverged: a joint position is not finite, or a velocity is beyond 1000 rad/s.
        ArgumentError: an unknown checker or part.
    """
    return Simulation(episode, nominal, checkers, without).run()


def _known(name: str | Checker) -> str | Checker:
    """``name``; raises ``ArgumentError`` if no checker has this name."""
    from tauguard.contacts import registered  # takes long to import

    if isinstance(name, str) and name not in registered():
        raise ArgumentError(f"checker {name!r}: expected one of {', '.join(registered())}")
    return name
