"""A small arm with geometry of every kind, a collision and what a detector might say of it."""

import numpy as np

from tauguard.traces import Alarm, Collision, Detection, Trace, Truth

ARM = """
<mujoco>
  <asset>
    <mesh name="wedge" vertex="0 0 0  .1 0 0  0 .1 0  0 0 .1"/>
    <material name="blue" rgba=".2 .4 .8 1"/>
  </asset>
  <worldbody>
    <geom type="plane" size="1 1 .1"/>
    <body name="base">
      <geom name="foot" type="cylinder" size=".09 .05" pos="0 0 .05" rgba=".8 .8 .8 1"/>
      <body name="link1" pos="0 0 .2">
        <joint name="j1" axis="0 0 1"/>
        <geom type="cylinder" size=".07 .1" material="blue"/>
        <geom type="box" size=".5 .5 .5" group="3"/>
        <body name="link2" pos="0 0 .1">
          <joint name="j2" axis="0 1 0"/>
          <geom type="capsule" size=".05" fromto="0 0 0  .4 0 0" rgba=".9 .9 .9 1"/>
          <body name="link3" pos=".4 0 0">
            <joint name="j3" axis="0 1 0"/>
            <geom type="box" size=".15 .04 .04" pos=".15 0 0" rgba=".3 .3 .3 1"/>
            <geom type="mesh" mesh="wedge" pos=".3 0 0"/>
            <geom type="ellipsoid" size=".03 .04 .06" pos=".3 .05 0"/>
          </body>
        </body>
      </body>
    </body>
    <body name="ball" mocap="true" pos="1 0 1"><geom type="sphere" size=".06"/></body>
  </worldbody>
</mujoco>
"""


def make(seconds=4.0, rate=1000.0, hits=2, joints=("j1", "j2", "j3")):
    t = np.arange(int(seconds * rate)) / rate
    n = len(joints)
    q = np.sin(t[:, None] + np.arange(n)) * 0.6
    qd = np.cos(t[:, None] + np.arange(n)) * 0.6
    force = np.zeros(len(t))
    collisions, alarms = [], []
    for k in range(hits):
        onset = (k + 0.5) * seconds / hits
        rows = (t >= onset) & (t < onset + 0.1)
        force[rows] = 120 * np.sin(np.pi * (t[rows] - onset) / 0.1) + 1
        point, vector = np.array([0.5, 0.0, 0.4]), np.array([0.0, 100.0, 60.0])
        collisions.append(Collision("strike", onset, onset + 0.1, 3, point, vector, 20.0))
        if k:  # the first is missed
            alarms.append(Alarm(onset + 0.012, onset + 0.15))
    there = force > 0
    poses = np.tile(np.eye(4), (len(t), 1, 1, 1))
    poses[:, 0, :3, 3] = np.stack([0.5 + 0 * t, -0.3 + 0.1 * t, 0.4 + 0 * t], 1)
    tau = force[:, None] * np.linspace(0.2, 0.05, n)
    truth = Truth(
        tau_ext=tau,
        contact_force=force,
        collisions=tuple(collisions),
        payload=np.zeros(len(t)),
        contact_link=np.where(there, 3, 0),
        contact_point=np.where(there[:, None], [0.5, 0.0, 0.4], np.nan),
        contact_vector=force[:, None] * np.array([0.0, 0.85, 0.53]),
        obstacle_names=("ball",),
        obstacle_poses=poses,
    )
    trace = Trace(joints, t, q, qd, qd + tau / 10, truth=truth, attachments={"scene.xml": ARM})
    up = np.zeros(len(t), bool)
    for alarm in alarms:
        up |= (t >= alarm.start) & (t < alarm.end)
    rng = np.random.default_rng(0)
    residual = tau + 0.3 * rng.standard_normal(tau.shape)
    score = residual.sum(axis=1)
    return trace, Detection("svr", t, residual, score, 5.0, up, tuple(alarms))
