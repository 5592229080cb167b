"""Diagnosis of an alarm: link, point, force and kind of the event."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.arrays import Array, in_a_line
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.diagnosis.classification import Signs, signs
from tauguard.detectors.diagnosis.contact_force import (
    Trust,
    contact_belief,
    isolate,
    last_joint,
    link_poses,
    moments,
    point_jacobians,
)
from tauguard.detectors.diagnosis.post_alarm import PostAlarmWindow, PostAlarmWindows
from tauguard.detectors.diagnosis.severity import Severity, severity
from tauguard.detectors.diagnosis.tool_contact import tool_severity
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.estimation.noise_model import NoiseModel
from tauguard.findings import ArgumentError
from tauguard.models.link_surface import LinkSurface, link_surface
from tauguard.traces.trace import Alarm, Detection, Trace

#: Least probability of the most likely link for it to be called identifiable.
SURE = 0.8
#: Link and point are found from samples between ``EARLY`` before the alarm and ``ISOLATE`` after it
#: [s], or ``ISOLATE_LAGS`` lags of the observer after it if that is longer.
ISOLATE, EARLY, ISOLATE_LAGS = 0.1, 0.01, 3.0


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The diagnosis of one alarm."""

    alarm: Alarm
    link: int  #: the most likely link, 1-based: link i moves with joint i
    links: Array  #: probability of each link, shape (n,)
    last_joint: int  #: last joint with a significant residual, a common rule for the link
    time: float  #: time of the peak force within the observed window [s]
    force: Array  #: force on the arm at that time, world frame [N], shape (3,)
    point: Array  #: contact point at that time, world frame [m], shape (3,)
    kind: str  #: the most likely of :data:`~tauguard.detectors.diagnosis.classification.KINDS`
    kinds: dict[str, float]  #: probability of each kind
    signs: Signs  #: the measures that decided the kind
    severity: Severity  #: impulse and peak force, each with an interval
    since: float  #: start of the observed window [s]; with ``at_tool`` shortly before the contact
    until: float  #: end of the observed window [s]
    joints: tuple[str, ...]  #: names of the joints

    __repr__ = in_a_line

    @property
    def collision(self) -> bool:
        """Whether something touched the arm, so that the event is no payload change."""
        return self.kind != "payload"

    @property
    def summary(self) -> str:
        """The diagnosis in a few words, with 90 % intervals."""
        if not self.collision:
            return f"payload changed by {self.signs.mass:+.2f} kg, no collision"
        size = self.severity.text(self.kind, self.joints)
        if not self.link_identifiable:
            return f"{self.kind}, link not identifiable, {size}"
        likely = self.links[self.link - 1]
        moved = self.joints[self.link - 1]
        return f"{self.kind}, link {self.link} (of joint {moved}, probability {likely:.2f}), {size}"

    def to_dict(self) -> dict[str, Any]:
        """The diagnosis as JSON values, with units in the names."""
        return {
            "summary": self.summary,
            "kind": self.kind,
            "kinds": self.kinds,
            "link": self.link,
            "link_identifiable": self.link_identifiable,
            "links": self.links.tolist(),
            "force_n": self.force.tolist(),
            "point_m": self.point.tolist(),
            "impulse_ns": self.severity.impulse.to_dict(),
            "peak_force_n": self.severity.peak.to_dict(),
            **self.severity.torque.to_dict(),
            "payload_kg": None if self.collision else self.signs.mass,
        }

    @property
    def link_identifiable(self) -> bool:
        """Whether one link is much more likely than all others, and consistent with the torques.

        A force on a link causes no torque at joints beyond the link. So a most likely link before
        the joint with the largest torque is not consistent: the model of one contact is wrong.
        """
        leading = int(np.abs(self.severity.torque.peak).argmax()) + 1
        return bool(self.links[self.link - 1] >= SURE) and leading <= self.link


def diagnose(
    alarm: CollisionAlarm,
    trace: Trace,
    detection: Detection | None = None,
    robot: str | Path | LinkSurface | None = None,
) -> list[Diagnosis]:
    """Diagnose every alarm of a detector on a trace.

    Args:
        alarm: a fitted detector with its threshold.
        trace: of the detector's arm.
        detection: the alarms of the trace (default: computed).
        robot: MJCF or URDF of the arm with its collision shapes, or its sampled surface (default:
            that of the detector, else the ``arm.xml`` that is attached to simulated traces).

    Returns:
        A diagnosis for each alarm, in order.

    Raises:
        ArgumentError: no collision shapes, or another arm.
    """
    found = detection or alarm.detect(trace)
    if robot is None and alarm.robot is not None:
        robot = alarm.robot.surface
    if robot is None:
        if "arm.xml" not in trace.attachments:
            raise ArgumentError("the trace has no arm.xml: give a robot file with collision shapes")
        robot = trace.attachments["arm.xml"]
    surface = robot if isinstance(robot, LinkSurface) else link_surface(robot)
    return Diagnoser.of(alarm.detector.arm, surface).diagnose(trace, found.alarms)


@dataclass(frozen=True, eq=False)
class Diagnoser:
    """Diagnoses alarms of one arm."""

    arm: ArmModel
    surface: LinkSurface
    noise_model: NoiseModel | None = None  #: None: ``arm.noise`` at every speed
    trust: Trust = field(default_factory=Trust)
    at_tool: bool = False  #: all contacts are at the tool, see :func:`tool_severity`
    load_known: bool = False  #: the load is known and does not change

    @classmethod
    def of(
        cls,
        arm: ArmModel,
        surface: LinkSurface,
        at_tool: bool = False,
        load_known: bool = False,
    ) -> Diagnoser:
        """A diagnoser with the noise model that the arm's detector has learned, if there is one.

        Some detectors scale down the residual of joints with an uncertain payload. Their noise
        model is then smaller than the noise of the residual, so ``arm.noise`` is a lower bound.

        Args:
            arm: the arm model.
            surface: sampled surface of the arm.
            at_tool: all contacts are at the tool, which makes the force more certain.
            load_known: the load is known and does not change, so no alarm is a payload change.
        """
        known = arm.noise_model
        least = None if known is None or arm.noise is None else known.at_least(arm.noise)
        if at_tool:
            surface = surface.only([arm.robot.joints])
        return cls(arm, surface, least, at_tool=at_tool, load_known=load_known)

    def diagnose(self, trace: Trace, alarms: Iterable[Alarm]) -> list[Diagnosis]:
        """A diagnosis for each alarm, in order.

        The window ends :data:`AFTER` the alarm. With ``at_tool``, the force comes from a
        window from the beginning of the contact, which may precede the alarm, to the alarm's end.
        """
        looked = PostAlarmWindows(self.arm, self.noise_model, trace)
        found, since = [], -np.inf
        for alarm in alarms:
            whole = looked.whole(alarm, since) if self.at_tool else None
            found.append(self.explain(alarm, looked.at(alarm.start), whole))
            since = alarm.end
        return found

    def explain(
        self, alarm: Alarm, after: PostAlarmWindow, whole: PostAlarmWindow | None = None
    ) -> Diagnosis:
        """The diagnosis from the residual around an alarm.

        Args:
            alarm: the alarm to diagnose.
            after: samples shortly after the alarm starts.
            whole: samples of the whole contact, for the force (default: ``after``).
        """
        whole = after if whole is None else whole
        robot, level = self.arm.robot, after.level
        last = max(ISOLATE, ISOLATE_LAGS * after.lag)
        first = np.flatnonzero((after.t >= -EARLY) & (after.t <= last))
        rows = first[moments(level[first])]
        residual, noise = after.residual[rows], self._noise(after)[rows]
        belief = isolate(robot, self.surface, after.q[rows], residual, noise)
        links = belief.links(robot.joints)
        link, peak = int(links.argmax()), int(level.argmax())
        at_peak = contact_belief(
            robot, self.surface, after.q[peak], after.residual[peak], self._noise(after)[peak]
        )
        force, point = replace(at_peak, probability=belief.probability).on(link)
        if self.at_tool:
            sized, force = tool_severity(self.arm, whole, self.surface)
            point = link_poses(robot, after.q[peak]).origin[-1]
        else:
            sized = severity(robot, self.surface, whole, belief, len(rows), self.trust)
        kinds = signs(after, force, self._velocity(link, point, after, peak))
        fractions = kinds.probabilities(self.load_known)
        return Diagnosis(
            alarm,
            link + 1,
            links,
            last_joint(residual[-1], after.deviation[rows[-1]]),
            alarm.start + float(after.t[peak]),
            force,
            point,
            max(fractions, key=lambda kind: fractions[kind]),
            fractions,
            kinds,
            sized,
            alarm.start + float(whole.t[0]),
            alarm.start + float(whole.t[-1]),
            robot.joint_names,
        )

    def _noise(self, after: PostAlarmWindow) -> Array:
        return self.trust.noise(after.residual, after.deviation)

    def _velocity(self, link: int, point: Array, after: PostAlarmWindow, peak: int) -> Array:
        """Velocity of the touched point with the joint speeds before the alarm [m/s]."""
        poses = link_poses(self.arm.robot, after.q[peak])
        jacobian = point_jacobians(self.arm.robot, poses, np.array([link]), point[None])[0]
        velocity: Array = jacobian @ after.qd[0]
        return velocity
