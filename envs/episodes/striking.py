"""Inject a planned collision: choose a target, search for the strength, simulate around it."""

from dataclasses import dataclass, replace

import numpy as np

from tauguard.arrays import Array
from tauguard.envs.episodes import labels
from tauguard.envs.episodes.episode import CollisionPlan
from tauguard.envs.episodes.injection import (
    CLAMP_HOLD,
    LEAD,
    STRIDE,
    Aim,
    Target,
    clamp_centre,
    launch,
    pulse_wrench,
)
from tauguard.envs.episodes.loop import AlongMotion, Rollout
from tauguard.envs.episodes.poses import Poses
from tauguard.models import Scene

#: Where an obstacle waits while it is not used, far from the arm [m].
PARKED = np.array([0.0, 0.0, 50.0])
#: Number of targets tried for one collision, and of strengths tried on each.
TARGETS, TRIES = 16, 10
#: Largest force of a collision [N]; a target that needs more is given up.
FORCE_LIMIT = 400.0
#: An obstacle that touches the arm sooner than this [s] overlapped it at the start.
CLEAR = 0.01
#: A clamp's strength is its depth plus this [m], so that strengths are positive. The depth is
#: negative if another part of the link extends beyond the planned point.
CLAMP_OFFSET = 0.03
#: Initial strength: strike speed [m/s], clamp depth plus offset [m], pulse force [N].
STRENGTH = {"strike": 0.5, "clamp": CLAMP_OFFSET, "pulse": 80.0}
#: Smallest and largest strength that an obstacle or a person can cause, in the same units.
STRENGTH_RANGE = {"strike": (0.02, 6.0), "clamp": (0.005, 0.1), "pulse": (1.0, 1500.0)}
#: Largest ratio of two successive strengths in the search.
STRENGTH_FACTOR = {"strike": 10.0, "clamp": 1.3, "pulse": 10.0}


@dataclass(frozen=True)
class Window:
    """The simulated part of an episode around an injected collision."""

    begin: int  #: first row
    rollout: Rollout
    wrenches: labels.Wrenches
    peak_tau: float  #: largest external torque of joints 1-4 [N m]
    peak_force: float  #: largest force on a link [N]


class Striking:
    """Injects the planned collisions of one simulation."""

    def __init__(
        self,
        scene: Scene,
        follow: AlongMotion,
        struck: AlongMotion,
        rng: np.random.Generator,
    ) -> None:
        """Prepare for one motion; ``rng`` draws points and directions.

        ``follow`` simulates the arm until an obstacle of ``scene`` comes near, ``struck`` the
        whole scene; they may be the same.

        This object does not refer to the simulation that uses it: the reference cycle would keep
        megabytes of native memory until Python collects cycles.
        """
        motion = follow.motion
        self._scene, self._motion, self._loop, self._follow = scene, motion, follow.loop, follow
        #: The loop with the obstacles.
        self.loop, self._struck, self._rng = struck.loop, struck, rng
        self._parked = struck.recorded.poses[:1].copy()
        self._aim, self._poses = Aim(scene, motion), Poses(scene)
        self._dt = float(scene.model.opt.timestep)

    def _row(self, time: float) -> int:
        return round(time / self._dt)

    def carry_out(
        self, plan: CollisionPlan, row: int, start: int, stop: int
    ) -> tuple[int, Window | str]:
        """Run from ``row`` up to the collision's window and carry out the collision there.

        Returns:
            The row that the simulation has reached; the window after it, or why no target fitted.
        """
        lead = 0 if plan.kind == "pulse" else self._row(LEAD)
        tail = self._row(0.3 if plan.kind == "strike" else plan.duration + CLAMP_HOLD)
        late = replace(plan, time=max(plan.time, (row + lead) * self._dt))
        at, tried = row, 0
        for attempt in range(TARGETS):
            late = self._relaxed(late, attempt)
            target = self._aim.find(late, self._rng, stop - tail)
            if target is None or target.row + tail > stop or target.row - lead < at:
                continue
            tried += 1
            begin = target.row - lead
            self._follow(at, begin)
            at = begin
            saved = self._loop.save()
            window = self._search(late, target, begin, target.row + tail)
            if window is not None:
                return begin, window
            self._loop.restore(saved)
            failed = self._struck.recorded.rows(begin, target.row + tail)
            failed.contact[:], failed.poses[:] = 0.0, self._parked
        self._follow(at, max(at, start))
        return max(at, start), self._why(
            plan, tried, (stop - tail - self._row(late.time)) * self._dt
        )

    def _why(self, plan: CollisionPlan, tried: int, room: float) -> str:
        """Why a plan failed after ``tried`` targets within ``room`` seconds."""
        if room < STRIDE:
            return "no time is left before the next collision or the end of the episode"
        if not tried:
            return f"no point of the link allows this collision within {room:.1f} s"
        torque, force = plan.severity or (0.0, np.inf), plan.force or (0.0, FORCE_LIMIT)
        return (
            f"none of {tried} targets gave {torque[0]:g} to {torque[1]:g} N m at a force of "
            f"{force[0]:g} to {force[1]:g} N"
        )

    def _relaxed(self, plan: CollisionPlan, attempt: int) -> CollisionPlan:
        """The plan; after a quarter of the attempts an easier one.

        The easier plan needs no rest of the arm, because the motion may have no pause. A clamp gets
        a random link, because the planned link may not move towards a clamp.
        """
        if attempt < TARGETS // 4:
            return plan
        if plan.kind != "clamp":
            return replace(plan, at_rest=False)
        links = len(self._scene.link_bodies)
        return replace(plan, link=int(self._rng.integers(2, links + 1)))

    def _search(self, plan: CollisionPlan, target: Target, begin: int, end: int) -> Window | None:
        """Repeat the window with other strengths until the peak torque is in ``plan.severity``.

        The strength is scaled by the ratio of wanted to achieved torque until one strength gives
        too little and one too much torque, then bisected geometrically. ``None`` if this target
        does not give the torque, or only with a force out of range.
        """
        strength = plan.strength or STRENGTH[plan.kind]
        below, above = STRENGTH_RANGE[plan.kind]
        saved = self._loop.save()
        bracket: list[float | None] = [None, None]
        for _ in range(TRIES):
            self._loop.restore(saved)
            window = self._attempt(plan, target, strength, begin, end)
            if window is None or window.peak_force > FORCE_LIMIT:
                return None
            if plan.severity is None or plan.severity[0] <= window.peak_tau < plan.severity[1]:
                low, high = plan.force or (0.0, FORCE_LIMIT)
                if not low <= window.peak_force <= high:
                    return None
                if plan.kind != "pulse":
                    self._loop.take(self.loop)
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
        """Simulate with this strength; ``None`` if the obstacle overlaps at its start."""
        dt = self._dt
        wrench, body = None, -1
        if plan.kind != "pulse":
            self.loop.take(self._loop)
        if plan.kind == "pulse":
            moved = target.point + np.outer(np.arange(end - begin) * dt, target.velocity)
            lever = moved - self._poses.points(self._motion.q[begin:end], target.body)
            wrench = pulse_wrench(target, lever, strength, plan.duration, dt)
            body = target.body
        elif plan.kind == "strike":
            self._launch(target, strength)
        else:
            self._place_clamp(target, strength - CLAMP_OFFSET, end)
        along = self._follow if plan.kind == "pulse" else self._struck
        clear = min(begin + self._row(CLEAR), end) if wrench is None else begin
        overlaps = bool(along(begin, clear).contact[:, :, 1:4].any())
        if not overlaps:
            along(clear, end, wrench, body)
        self._park(plan.kind)
        if overlaps:
            return None
        rollout = along.recorded.rows(begin, end)
        wrenches = (
            self._pulse_truth(wrench[:, :3], lever, target, rollout)
            if wrench is not None
            else labels.Wrenches.from_contacts(rollout.contact)
        )
        rows = wrenches.rows()
        felt = labels.Wrenches(*(part[rows] for part in vars(wrenches).values()))
        tau = labels.external_torque(self._poses, rollout.q[rows], felt)
        peak_tau = float(np.abs(tau[:, :4]).max(initial=0.0))
        peak_force = float(np.linalg.norm(felt.force, axis=2).max(initial=0.0))
        return Window(begin, rollout, wrenches, peak_tau, peak_force)

    def _launch(self, target: Target, speed: float) -> None:
        model, data = self._scene.model, self.loop.data
        body = model.body("striker")
        position, velocity = launch(target, speed, float(model.geom_size[body.geomadr[0], 0]))
        joint = model.joint(int(body.jntadr[0]))
        data.qpos[joint.qposadr[0] : joint.qposadr[0] + 7] = [*position, 1, 0, 0, 0]
        data.qvel[joint.dofadr[0] : joint.dofadr[0] + 6] = [*velocity, 0, 0, 0]

    def _place_clamp(self, target: Target, depth: float, end: int) -> None:
        model = self._scene.model
        body = model.body("clamp")
        references = self._motion.q[target.row : end]
        path = self._poses.points(references, target.body, target.point)
        radius = float(model.geom_size[int(body.geomadr[0]), 0])
        self.loop.data.mocap_pos[body.mocapid[0]] = clamp_centre(target, path, depth, radius)

    def _park(self, kind: str) -> None:
        model, data = self._scene.model, self.loop.data
        if kind == "strike":
            joint = model.joint(int(model.body("striker").jntadr[0]))
            data.qpos[joint.qposadr[0] : joint.qposadr[0] + 7] = [*PARKED, 1, 0, 0, 0]
            data.qvel[joint.dofadr[0] : joint.dofadr[0] + 6] = 0
        elif kind == "clamp":
            data.mocap_pos[model.body("clamp").mocapid[0]] = -PARKED

    def _pulse_truth(
        self, force: Array, lever: Array, target: Target, rollout: Rollout
    ) -> labels.Wrenches:
        """The pulse's force, where it acts on the simulated link."""
        found = labels.Wrenches.empty(len(force), len(self._scene.link_bodies))
        link = int(np.flatnonzero(np.asarray(self._scene.link_bodies) == target.body)[0])
        found.force[:, link] = force
        found.point[:, link] = self._poses.points(rollout.q, target.body) + lever
        return found
