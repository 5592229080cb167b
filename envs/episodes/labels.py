"""The truth, from contact forces and applied wrenches; without limits and friction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.envs.episodes.poses import Poses, cross
from tauguard.traces import Collision

#: Contacts closer in time than this are one collision [s].
MERGE_GAP = 0.5


@dataclass(frozen=True)
class Wrenches:
    """External wrenches on the links, a row per sample (world frame, about ``point``)."""

    force: Array  #: [N], shape (T, links, 3)
    torque: Array  #: [N m], shape (T, links, 3)
    point: Array  #: [m], shape (T, links, 3)

    @classmethod
    def empty(cls, rows: int, links: int) -> Wrenches:
        """No wrench at all."""
        return cls(*(np.zeros((rows, links, 3)) for _ in range(3)))

    @classmethod
    def from_contacts(cls, contact: Array) -> Wrenches:
        """From the scene's contact sensors: found, force by the link, torque, position."""
        return cls(-contact[:, :, 1:4], -contact[:, :, 4:7], contact[:, :, 7:10].copy())

    def rows(self) -> NDArray[np.intp]:
        """The samples at which something pushes or turns a link, shape (K,)."""
        pushed = (self.force != 0).any(axis=(1, 2))
        pushed |= (self.torque != 0).any(axis=(1, 2))
        return np.flatnonzero(pushed)


def external_torque(poses: Poses, q: Array, wrenches: Wrenches) -> Array:
    """``tau_ext``: the sum of J^T w over the links [N m], shape (T, n).

    Args:
        poses: of the scene.
        q: true joint positions [rad], shape (T, n).
        wrenches: what pushes the links; rows without any cost nothing.
    """
    tau = np.zeros_like(q)
    touched = wrenches.rows()
    if not len(touched):
        return tau
    pushed = (wrenches.force != 0).any(axis=2) | (wrenches.torque != 0).any(axis=2)
    anchor, axis = poses.joints(q[touched])
    for link, moving in enumerate(poses.moving):
        here = np.flatnonzero(pushed[touched, link])
        rows = touched[here]
        force, torque = wrenches.force[rows, link], wrenches.torque[rows, link]
        point = wrenches.point[rows, link]
        for joint in moving:
            along, arm = axis[here, joint], point - anchor[here, joint]
            turned = torque + cross(arm, force)
            work = force if poses.sliding[joint] else turned
            tau[rows, joint] += np.einsum("ij,ij->i", along, work)
    return tau


def collisions(
    t: Array, wrenches: Wrenches, tau_ext: Array, kinds: list[tuple[float, str]]
) -> tuple[Collision, ...]:
    """Runs of contact, gaps below 0.5 s closed, in order of onset.

    An obstacle that touches two links at once is one collision; its link, point and force are those
    of the largest force.

    Args:
        t: sample times [s], shape (T,).
        wrenches: what pushed the links.
        tau_ext: shape (T, n) [N m].
        kinds: (time, kind) of what was injected; a collision takes the kind of the latest one that
            began before it.
    """
    rows = wrenches.rows()
    if not len(rows):
        return ()
    strength = np.zeros(wrenches.force.shape[:2])
    strength[rows] = np.linalg.norm(wrenches.force[rows], axis=2)
    touched = np.flatnonzero((strength > 0).any(axis=1))
    if not touched.size:
        return ()
    found: list[Collision] = []
    for run in np.split(touched, np.flatnonzero(np.diff(t[touched]) >= MERGE_GAP) + 1):
        row, link = np.unravel_index(int(strength[run].argmax()), strength[run].shape)
        peak = run[row]
        before = [kind for time, kind in kinds if time <= t[run[0]]]
        found.append(
            Collision(
                kind=before[-1] if before else "strike",
                onset=float(t[run[0]]),
                end=float(t[run[-1]]),
                link=int(link) + 1,
                point=wrenches.point[peak, link].copy(),
                force=wrenches.force[peak, link].copy(),
                peak_tau=float(np.abs(tau_ext[run, :4]).max()),
            )
        )
    return tuple(found)
