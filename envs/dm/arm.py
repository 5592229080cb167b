"""The arm as a ``dm_control.composer`` entity, to be attached to any arena."""

from __future__ import annotations

from typing import Any

import numpy as np
from dm_control import composer, mjcf
from dm_control.composer.observation import observable

from tauguard.envs.dm.frames import without_frames
from tauguard.models import load_arm
from tauguard.models.mjcf import xml_text


class ArmEntity(composer.Entity):  # type: ignore[misc]
    """A serial arm with one torque motor a joint.

    Its observables are ``joint_positions`` [rad], ``joint_velocities`` [rad/s] and
    ``joint_torques`` (what the motors apply, N m), each of shape (n,).
    """

    def _build(self, arm: str = "cura6", name: str | None = None) -> None:
        """Build from ``arm``: ``cura6``, or an MJCF or URDF file with one serial arm.

        Raises:
            ValueError: not an arm, see :func:`tauguard.models.load_arm`.
            FileNotFoundError: no such file.
        """
        source = load_arm(arm)
        source.spec.compile()
        self._root = mjcf.from_xml_string(without_frames(xml_text(source.spec)))
        self._root.model = name or "arm"
        self._joints = [self._root.find("joint", joint) for joint in source.joints]
        self.home: np.ndarray = source.home
        for joint, limit in zip(self._joints, source.torque_limit, strict=True):
            bounded = {"ctrlrange": [-limit, limit]} if np.isfinite(limit) else {}
            self._root.actuator.add("motor", name=joint.name, joint=joint, **bounded)
        self._flange = self._root.find("site", source.flange().name)

    def _build_observables(self) -> composer.Observables:
        return ArmObservables(self)

    def initialize_episode(self, physics: mjcf.Physics, random_state: Any) -> None:
        """Put the arm into its home pose, at rest."""
        del random_state
        physics.bind(self._joints).qpos = self.home
        physics.bind(self._joints).qvel = 0.0

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        """The arm's MJCF."""
        return self._root

    @property
    def joints(self) -> list[mjcf.Element]:
        """Base to tip."""
        return self._joints

    @property
    def actuators(self) -> list[mjcf.Element]:
        """The motors, in the order of :attr:`joints`; their control is a torque [N m]."""
        return list(self._root.find_all("actuator"))

    @property
    def flange(self) -> mjcf.Element | None:
        """The tool flange's site; ``None`` where the file names none."""
        return self._flange


class ArmObservables(composer.Observables):  # type: ignore[misc]
    """What is seen of an :class:`ArmEntity`."""

    @composer.observable  # type: ignore[untyped-decorator]
    def joint_positions(self) -> observable.MJCFFeature:
        """Joint positions [rad]."""
        return observable.MJCFFeature("qpos", self._entity.joints)

    @composer.observable  # type: ignore[untyped-decorator]
    def joint_velocities(self) -> observable.MJCFFeature:
        """Joint velocities [rad/s]."""
        return observable.MJCFFeature("qvel", self._entity.joints)

    @composer.observable  # type: ignore[untyped-decorator]
    def joint_torques(self) -> observable.MJCFFeature:
        """Torque of the motors [N m]."""
        return observable.MJCFFeature("qfrc_actuator", self._entity.joints)
