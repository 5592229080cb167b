"""Free objects: where they are put, grasps by the tool, and what leaves the workspace."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array
from tauguard.envs.gym.compiled import CompiledScene
from tauguard.findings import ArgumentError
from tauguard.models.scene_objects import GRASP

#: Half edge of the workspace about the arm's base [reach], and how far it goes below the base [m].
WORKSPACE, BELOW = 1.5, 0.3


class FreeObjects:
    """The free objects of all copies of a compiled scene.

    Attributes:
        left: the object that left the workspace in the last action, counted from 1; 0: none. Shape
            (rows,).
        leaving: whether the setting ``leaving`` asks for this.
        grasps: for each graspable object the id of its weld.
    """

    def __init__(self, compiled: CompiledScene, rows: int) -> None:
        """Find the objects in the model."""
        model, settings = compiled.scene.model, compiled.settings
        self.names = [obj.name for obj in settings.objects if obj.motion == "free"]
        self._bodies = [int(model.body(name).id) for name in self.names]
        joints = model.body_jntadr[self._bodies]
        self._qpos, self._dofs = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        graspable = [obj.name for obj in settings.objects if obj.graspable]
        self.grasps = {name: int(model.equality(name + GRASP).id) for name in graspable}
        #: Poses at the start of the episode, shape (rows, objects, 7).
        self._starts = np.zeros((rows, len(self.names), 7))
        self.left = np.zeros(rows, dtype=np.int64)
        self.leaving = settings.leaving is not None and bool(self.names)
        self._again = settings.leaving == "reset"
        base, reach = np.array(compiled.layout.base), WORKSPACE * compiled.layout.reach
        low, high = base - [reach, reach, BELOW], base + reach
        box: Any = (low, high) if settings.workspace is None else settings.workspace
        self._low, self._high = box

    def body(self, name: str) -> int:
        """MuJoCo's id of an object's body.

        Raises:
            ArgumentError: no free object of this name.
        """
        if name not in self.names:
            known = ", ".join(self.names) or "there are none"
            raise ArgumentError(f"object {name!r}: expected a free object: {known}")
        return self._bodies[self.names.index(name)]

    def weld(self, name: str) -> int:
        """MuJoCo's id of the constraint that holds an object.

        Raises:
            ArgumentError: the object is not graspable.
        """
        if name not in self.grasps:
            known = ", ".join(self.grasps) or "there are none, set graspable=True"
            raise ArgumentError(f"object {name!r}: expected a graspable object: {known}")
        return self.grasps[name]

    def begin(self, i: int, data: mujoco.MjData) -> None:
        """Store where an episode's objects start."""
        self.left[i] = 0
        for k, at in enumerate(self._qpos):
            self._starts[i, k] = data.qpos[at : at + 7]

    def put(
        self, data: mujoco.MjData, name: str, pose: tuple[ArrayLike, ArrayLike, ArrayLike]
    ) -> None:
        """Set position, orientation and velocity of an object."""
        self.body(name)
        k = self.names.index(name)
        at, dof = self._qpos[k], self._dofs[k]
        position, quat_wxyz, velocity = (np.asarray(part, dtype=np.float64) for part in pose)
        data.qpos[at : at + 3], data.qpos[at + 3 : at + 7] = position, quat_wxyz
        data.qvel[dof : dof + 3], data.qvel[dof + 3 : dof + 6] = velocity, 0.0
        if name in self.grasps:
            data.eq_active[self.grasps[name]] = 0

    def grasp(self, model: mujoco.MjModel, data: mujoco.MjData, name: str) -> None:
        """Switch the weld on at the present relative pose, so that nothing jumps."""
        weld = self.weld(name)
        tool, part = model.eq_obj1id[weld], model.eq_obj2id[weld]
        turned = data.xmat[tool].reshape(3, 3)
        back, relative = np.zeros(4), np.zeros(4)
        mujoco.mju_negQuat(back, data.xquat[tool])
        mujoco.mju_mulQuat(relative, back, data.xquat[part])
        # MuJoCo: anchor in the second body; position and orientation of the second in the first.
        model.eq_data[weld, :3] = 0.0
        model.eq_data[weld, 3:6] = turned.T @ (data.xpos[part] - data.xpos[tool])
        model.eq_data[weld, 6:10] = relative
        data.eq_active[weld] = 1

    def find_left(self, i: int, model: mujoco.MjModel, data: mujoco.MjData) -> bool:
        """Find an object outside the workspace; with ``leaving="reset"`` it begins again.

        Returns:
            Whether an object was moved.
        """
        places = data.xpos[self._bodies]
        outside = ((places < self._low) | (places > self._high)).any(axis=1)
        self.left[i] = 1 + int(np.argmax(outside)) if outside.any() else 0
        if not (self._again and outside.any()):
            return False
        for k in np.flatnonzero(outside):
            start: Array = self._starts[i, k]
            self.put(data, self.names[k], (start[:3], start[3:], np.zeros(3)))
        mujoco.mj_kinematics(model, data)
        return True

    def reason(self, i: int) -> str:
        """Why an episode of copy ``i`` ends with ``leaving="end"``, else ""."""
        if self._again or not self.left[i]:
            return ""
        return f"{self.names[self.left[i] - 1]} left the workspace"

    def get_state(self, i: int, model: mujoco.MjModel) -> dict[str, Any]:
        """Where the objects of copy ``i`` started, and how they are held."""
        return {"starts": self._starts[i].copy(), "held": model.eq_data.copy()}

    def set_state(self, i: int, model: mujoco.MjModel, state: dict[str, Any]) -> None:
        """Restore what :meth:`get_state` returned."""
        self._starts[i] = state["starts"]
        if self.grasps:
            model.eq_data[:] = state["held"]
