"""The truth of collisions: external torque, onset and end, from contact forces and wrenches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.detectors.events import MERGE_GAP
from tauguard.envs.episodes.poses import Poses, cross
from tauguard.traces import Collision


@dataclass(frozen=True)
class Wrenches:
    """External wrenches on the links in the world frame, about ``point``; one row per sample."""

    force: Array  #: [N], shape (T, links, 3)
    torque: Array  #: [N m], shape (T, links, 3)
    point: Array  #: [m], shape (T, links, 3)

    @classmethod
    def empty(cls, rows: int, links: int) -> Wrenches:
        """Wrenches that are all zero."""
        return cls(*(np.zeros((rows, links, 3)) for _ in range(3)))

    @classmethod
    def from_contacts(cls, contact: Array) -> Wrenches:
        """Wrenches from sensors, whose columns are: found, force by the link, torque, point."""
        wrenches = cls.empty(*contact.shape[:2])
        rows = np.flatnonzero(contact[:, :, 0].any(axis=1))
        felt = contact[rows]
        wrenches.force[rows], wrenches.torque[rows] = -felt[:, :, 1:4], -felt[:, :, 4:7]
        wrenches.point[rows] = felt[:, :, 7:10]
        return wrenches

    def rows(self) -> NDArray[np.intp]:
        """The samples with a force or a torque on some link, shape (K,)."""
        return np.flatnonzero(self.pushed().any(axis=1))

    def pushed(self) -> NDArray[np.bool_]:
        """The links with a force or a torque, shape (T, links)."""
        parts = [part[..., k] != 0 for part in (self.force, self.torque) for k in range(3)]
        return np.asarray(np.logical_or.reduce(parts))


def homogeneous(positions: Array, quaternions: Array) -> Array:
    """Matrices (..., 4, 4) of positions, shape (..., 3), and quaternions (wxyz), (..., 4)."""
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    out = np.zeros((*w.shape, 4, 4))
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            out[..., i, j] = entry
    out[..., :3, 3] = positions
    out[..., 3, 3] = 1
    return out


def external_torque(poses: Poses, q: Array, wrenches: Wrenches) -> Array:
    """``tau_ext``: the sum of J^T w over the links [N m], shape (T, n).

    Args:
        poses: forward kinematics of the scene.
        q: true joint positions [rad], shape (T, n).
        wrenches: external wrenches on the links.
    """
    tau = np.zeros_like(q)
    pushed = wrenches.pushed()
    touched = np.flatnonzero(pushed.any(axis=1))
    if not len(touched):
        return tau
    anchor, axis = poses.joints(q[touched])
    sliding = np.array(poses.sliding)
    for link, moving in enumerate(poses.moving):
        here = np.flatnonzero(pushed[touched, link])
        if not len(here):
            continue
        rows, columns = touched[here, None], np.array(moving, np.intp)
        force, torque, point = (
            each[rows, link] for each in (wrenches.force, wrenches.torque, wrenches.point)
        )
        turned = torque + cross(point - anchor[here[:, None], columns], force)
        work = np.where(sliding[columns, None], force, turned)
        tau[rows, columns] += np.einsum("tij,tij->ti", axis[here[:, None], columns], work)
    return tau


def collisions(
    t: Array, wrenches: Wrenches, tau_ext: Array, kinds: list[tuple[float, str]]
) -> tuple[Collision, ...]:
    """The collisions in order of onset; contacts with gaps below 0.5 s are one collision.

    Contacts with two links at once are one collision, too. Its link, point and force are those of
    the largest force.

    Args:
        t: sample times [s], shape (T,).
        wrenches: external wrenches on the links.
        tau_ext: external torque [N m], shape (T, n).
        kinds: (time, kind) of each injected collision; a collision gets the kind of the latest one
            that was injected before its onset.
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
