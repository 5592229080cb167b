"""A small arm: currents from Pinocchio's inverse dynamics, with friction and rotor inertia."""

from dataclasses import replace

import numpy as np
import pinocchio as pin

from tauguard.detectors import RobotNumbers
from tauguard.models import pin_model
from tauguard.traces import Trace

XML = """<mujoco><compiler angle="radian"/><worldbody>
<body><joint name="a" axis="0 0 1"/><geom type="capsule" size=".06" fromto="0 0 0 0 0 .3" mass="5"/>
<body pos="0 0 .3"><joint name="b" axis="0 1 0"/>
<geom type="capsule" size=".05" fromto="0 0 0 .4 0 0" mass="4"/>
<body pos=".4 0 0"><joint name="c" axis="0 1 0"/>
<geom type="capsule" size=".04" fromto="0 0 0 .3 0 .05" mass="2"/></body></body></body>
</worldbody></mujoco>"""
GAIN = np.array([8.0, 10.0, 6.0])
ROTOR = np.array([1.2, 0.8, 0.3])
COULOMB, VISCOUS = np.array([6.0, 5.0, 2.0]), np.array([8.0, 6.0, 3.0])


def nominal():
    return RobotNumbers.from_pin(pin_model(XML))


def true_model(load=0.0, centre=(0.3, 0.0, 0.05)):
    """Masses 15 % off what the file says, rotor inertia, and a load."""
    model = pin_model(XML)
    for joint in range(1, model.njoints):
        body = model.inertias[joint]
        model.inertias[joint] = pin.Inertia(1.15 * body.mass, body.lever, 1.15 * body.inertia)
    model.armature = ROTOR
    if load:
        point = pin.Inertia(load, np.zeros(3), 1e-4 * np.eye(3))
        model.appendBodyToJoint(3, point, pin.SE3(np.eye(3), np.array(centre)))
    return model


def record(seed, seconds=25.0, load=0.0, dt=0.01, noise=0.01, dwell=(8.0, 10.0), ramp=0.5):
    """One log: sums of sines with a dwell in the middle; current noise in A, stops of `ramp` s."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, seconds, dt)
    # A warped clock that stops in the dwell.
    rate = np.where((t > dwell[0]) & (t < dwell[1]), 0.0, 1.0)
    half = round(ramp / 2 / dt)
    window = np.ones(2 * half + 1) / (2 * half + 1)
    rate = np.convolve(np.pad(rate, half, mode="edge"), window, mode="valid")
    s = np.cumsum(rate) * dt
    sd, sdd = rate, np.gradient(rate, dt)
    q, qd, qdd = (np.zeros((len(t), 3)) for _ in range(3))
    for w in (0.7, 1.3, 2.1):
        a, phase = rng.uniform(0.15, 0.4, 3), rng.uniform(0, 2 * np.pi, 3)
        arg = w * s[:, None] + phase
        q += a * np.sin(arg)
        qd += a * w * np.cos(arg) * sd[:, None]
        qdd += a * w * np.cos(arg) * sdd[:, None] - a * w**2 * np.sin(arg) * sd[:, None] ** 2
    model = true_model(load)
    data = model.createData()
    tau = np.array([pin.rnea(model, data, *row) for row in zip(q, qd, qdd, strict=True)])
    tau += COULOMB * np.tanh(qd / 0.02) + VISCOUS * qd
    current = tau / GAIN + rng.normal(scale=noise, size=tau.shape)
    return Trace(("a", "b", "c"), t, q, qd, current)


def held_joint(seed):
    """A log in which the last joint stands still: its torque is what gravity and the others ask."""
    trace = record(seed)
    q, qd = trace.q.copy(), trace.qd.copy()
    q[:, 2], qd[:, 2] = 0.3, 0.0
    qdd = np.gradient(qd, trace.t, axis=0)
    model = true_model()
    data = model.createData()
    tau = np.array([pin.rnea(model, data, *row) for row in zip(q, qd, qdd, strict=True)])
    tau += COULOMB * np.tanh(qd / 0.02) + VISCOUS * qd
    noise = np.random.default_rng(seed).normal(scale=0.01, size=tau.shape)
    return replace(trace, q=q, qd=qd, current=tau / GAIN + noise)
