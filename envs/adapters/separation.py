"""Speed and separation monitoring: the arm stops before it can reach a person."""

from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from tauguard.arrays import Array
from tauguard.envs.gym.base import ArmEnv, arm_env
from tauguard.envs.gym.batch import Override
from tauguard.envs.gym.placing import carried
from tauguard.envs.gym.settings import positive
from tauguard.findings import ArgumentError

#: Largest distance that is computed [m].
FAR = 3.0


class SpeedAndSeparation(gymnasium.Wrapper[Array, Array, Array, Array], RecordConstructorArgs):
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
        env: gymnasium.Env[Array, Array],
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
        RecordConstructorArgs.__init__(
            self,
            approach_speed=approach_speed,
            reaction_time=reaction_time,
            intrusion=intrusion,
            uncertainty=uncertainty,
            hysteresis=hysteresis,
        )
        gymnasium.Wrapper.__init__(self, env)
        positive("approach_speed", approach_speed)
        for name in ("reaction_time", "intrusion", "uncertainty", "hysteresis"):
            value = locals()[name]
            if not (np.isfinite(value) and value >= 0):
                raise ArgumentError(f"{name} {value}: expected 0 or more")
        self._arm: ArmEnv = arm_env(env)
        compiled = self._arm.compiled
        if not compiled.regions:
            raise ArgumentError("no body regions to keep away from: name some with obstacles=")
        self._terms = (approach_speed, reaction_time, intrusion + uncertainty, hysteresis)
        model = compiled.scene.model
        self._geoms = [
            g
            for g in range(model.ngeom)
            if model.geom_bodyid[g] in set(compiled.scene.link_bodies.tolist())
            and (model.geom_contype[g] or model.geom_conaffinity[g])
        ]
        self._targets = [int(model.body_geomadr[r.body]) for r in compiled.regions]
        own = compiled.scene.facts.max_acceleration
        self._deceleration = np.resize(own, len(compiled.scene.joint_names))
        self._stopped = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode."""
        self._stopped = False
        observation, info = self.env.reset(seed=seed, options=options)
        return observation, info | self._judge()

    def step(self, action: Array) -> tuple[Array, Any, bool, bool, dict[str, Any]]:
        """Apply the action, or hold the arm still if it is stopped."""
        still = np.zeros(len(self._deceleration))
        self._arm.batch.plants[0].override(
            Override.VELOCITY if self._stopped else Override.FREE, still
        )
        observation, reward, terminated, truncated, info = self.env.step(action)
        return observation, reward, terminated, truncated, info | self._judge()

    def _judge(self) -> dict[str, Any]:
        nearest, needed, inside = FAR, 0.0, False
        for target in self._targets:
            for geom in self._geoms:
                distance, speed = self._pair(geom, target)
                protective = self._protective(speed)
                margin = self._terms[3] if self._stopped else 0.0
                inside |= distance < min(protective + margin, FAR)
                if distance < nearest:
                    nearest, needed = distance, protective
        self._stopped = inside
        return {"separation": nearest, "protective_distance": needed, "stopped": inside}

    def _pair(self, geom: int, target: int) -> tuple[float, float]:
        """Distance of an arm's geom from a region [m], and speed of its nearest point [m/s]."""
        model, data = self._arm.batch.model(0), self._arm.batch.datas[0]
        ends = np.zeros(6)
        distance = mujoco.mj_geomDistance(model, data, geom, target, FAR, ends)
        if distance >= FAR:
            return FAR, 0.0
        return float(distance), self._speed(int(model.geom_bodyid[geom]), ends[:3])

    def _speed(self, body: int, point: Array) -> float:
        """Speed of a point of a link [m/s]."""
        compiled, data = self._arm.compiled, self._arm.batch.datas[0]
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

    def _protective(self, speed: float) -> float:
        approach, reaction, fixed, _ = self._terms
        data, dofs = self._arm.batch.datas[0], self._arm.compiled.scene.dof_adr
        stopping = float((np.abs(data.qvel[dofs]) / self._deceleration).max())
        return approach * (reaction + stopping) + speed * (reaction + stopping / 2) + fixed
