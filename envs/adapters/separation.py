"""Speed and separation monitoring: the arm stops before it can reach a person."""

from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import VectorEnv, VectorWrapper

from tauguard.arrays import Array
from tauguard.envs.gym.base import arm_env
from tauguard.envs.gym.batch import Batch, Override
from tauguard.envs.gym.placing import carried
from tauguard.envs.gym.rules import Rule
from tauguard.envs.gym.settings import positive
from tauguard.envs.gym.vector import vector_arm_env
from tauguard.findings import ArgumentError

#: Largest distance that is computed [m].
FAR = 3.0


class SpeedAndSeparation(gymnasium.Wrapper[Any, Array, Any, Array], RecordConstructorArgs):
    """Stops the arm (stop category 2) while a body region is nearer than a protective distance S.

    ``S = v_h (T_r + T_s) + v_r T_r + v_r T_s / 2 + C + Z`` (ISO 13855, as ISO 10218-2 uses it).
    v_h is the approach speed of the region and v_r the speed of the arm's nearest point. T_r is the
    reaction time and T_s the time to stop from the present speed. The arm moves on once the
    separation exceeds S by ``hysteresis``.

    ``info`` gets ``separation`` [m] (at most :data:`FAR`), ``protective_distance`` [m] and
    ``stopped``.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Array],
        approach_speed: float = 1.6,
        reaction_time: float = 0.1,
        intrusion: float = 0.1,
        uncertainty: float = 0.05,
        hysteresis: float = 0.05,
    ) -> None:
        """Set the terms of S.

        Args:
            env: an environment of tauguard with body regions.
            approach_speed: v_h [m/s]; the standard states 1.6 for a person whose speed is not
                measured.
            reaction_time: T_r of sensor and controller [s].
            intrusion: C, how far a body part reaches before it is sensed [m].
            uncertainty: Z, uncertainty of the positions of arm and person together [m].
            hysteresis: the arm moves on at this distance above S [m].

        Raises:
            ArgumentError: a number below 0, or an environment without body regions.
        """
        terms: dict[str, Any] = {
            "approach_speed": approach_speed,
            "reaction_time": reaction_time,
            "intrusion": intrusion,
            "uncertainty": uncertainty,
            "hysteresis": hysteresis,
        }
        RecordConstructorArgs.__init__(self, **terms)
        gymnasium.Wrapper.__init__(self, env)
        arm_env(env).rules.add(Separating, **terms)


class VectorSpeedAndSeparation(VectorWrapper):
    """:class:`SpeedAndSeparation` of every copy of a vector environment."""

    def __init__(self, env: VectorEnv[Any, Any, Any], **terms: float) -> None:
        """Set the terms of S; arguments and errors as for :class:`SpeedAndSeparation`."""
        super().__init__(env)
        vector_arm_env(env).rules.add(Separating, **terms)


class Separating(Rule):
    """Holds the arm still near people; see :class:`SpeedAndSeparation`."""

    def __init__(
        self,
        batch: Batch,
        approach_speed: float = 1.6,
        reaction_time: float = 0.1,
        intrusion: float = 0.1,
        uncertainty: float = 0.05,
        hysteresis: float = 0.05,
    ) -> None:
        """Set the terms."""
        super().__init__(batch)
        positive("approach_speed", approach_speed)
        for name in ("reaction_time", "intrusion", "uncertainty", "hysteresis"):
            value = locals()[name]
            if not (np.isfinite(value) and value >= 0):
                raise ArgumentError(f"{name} {value}: expected 0 or more")
        compiled = batch.compiled
        if not compiled.regions:
            raise ArgumentError("no body regions to keep away from: name some with obstacles=")
        self._speed, self._reaction, self._hysteresis = approach_speed, reaction_time, hysteresis
        self._fixed = intrusion + uncertainty
        model, links = compiled.scene.model, set(compiled.scene.link_bodies.tolist())
        self._geoms = [
            g
            for g in range(model.ngeom)
            if model.geom_bodyid[g] in links
            and (model.geom_contype[g] or model.geom_conaffinity[g])
        ]
        self._targets = [int(model.body_geomadr[r.body]) for r in compiled.regions]
        usual = compiled.scene.facts.max_acceleration
        self._deceleration = np.resize(usual, len(compiled.scene.joint_names))
        self._still = np.zeros(len(self._deceleration))
        for name in ("separation", "protective_distance"):
            self.columns[name] = np.zeros(batch.rows)
        self.columns["stopped"] = np.zeros(batch.rows, dtype=np.bool_)

    def begin(self, i: int) -> None:
        """Let the arm move unless somebody is near."""
        self.columns["stopped"][i] = False
        self.look(i)

    def act(self, i: int) -> None:
        """Hold the arm still if it is stopped."""
        kind = Override.VELOCITY if self.columns["stopped"][i] else Override.FREE
        self.batch.plants[i].override(kind, self._still)

    def look(self, i: int) -> None:
        """Compare every distance of a geom of the arm from a region with its S."""
        nearest, needed, inside = FAR, 0.0, False
        margin = self._hysteresis if self.columns["stopped"][i] else 0.0
        for target in self._targets:
            for geom in self._geoms:
                distance, speed = self._pair(i, geom, target)
                protective = self._protective(i, speed)
                inside |= distance < min(protective + margin, FAR)
                if distance < nearest:
                    nearest, needed = distance, protective
        values = {"separation": nearest, "protective_distance": needed, "stopped": inside}
        for name, value in values.items():
            self.columns[name][i] = value

    def _pair(self, i: int, geom: int, target: int) -> tuple[float, float]:
        """Distance of an arm's geom from a region [m], and speed of its nearest point [m/s]."""
        model, data = self.batch.model(i), self.batch.datas[i]
        ends = np.zeros(6)
        distance = mujoco.mj_geomDistance(model, data, geom, target, FAR, ends)
        if distance >= FAR:
            return FAR, 0.0
        return float(distance), self._point_speed(i, int(model.geom_bodyid[geom]), ends[:3])

    def _point_speed(self, i: int, body: int, point: Array) -> float:
        """Speed of a point of a link [m/s]."""
        compiled, data = self.batch.compiled, self.batch.datas[i]
        model, total = compiled.scene.model, np.zeros(3)
        for joint, dof, link in zip(
            compiled.ids(), compiled.scene.dof_adr, compiled.scene.link_bodies, strict=True
        ):
            if not carried(model, body, int(link)):
                continue
            axis, rate = data.xaxis[joint], data.qvel[dof]
            slide = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE
            total += rate * (axis if slide else np.cross(axis, point - data.xanchor[joint]))
        return float(np.linalg.norm(total))

    def _protective(self, i: int, speed: float) -> float:
        approach, reaction = self._speed, self._reaction
        data, dofs = self.batch.datas[i], self.batch.compiled.scene.dof_adr
        stopping = float((np.abs(data.qvel[dofs]) / self._deceleration).max())
        return approach * (reaction + stopping) + speed * (reaction + stopping / 2) + self._fixed
