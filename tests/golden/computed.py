"""What tauguard computes here, as hashes: `python tests/golden/computed.py` prints them as JSON.

It needs an installed tauguard and nothing else, so that every wheel can be asked. ``--write`` keeps
them as the golden values of this MuJoCo version.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
from pathlib import Path

import numpy as np

FILE = Path(__file__).with_name("values.json")
#: How many numbers of each part are kept beside its hash.
KEPT = 20


def exact(rng, *shape):
    """Multiples of 1/1024: the same on every machine."""
    return rng.integers(-1024, 1024, shape) / 1024


def cloth(threads):
    from tauguard.cloth import MeshCCD

    rng = np.random.default_rng(1)
    ccd = MeshCCD(rng.permutation(120).reshape(-1, 3), threads=threads)
    x_t0 = exact(rng, 120, 3)
    for _ in range(3):
        x_t1 = x_t0 + exact(rng, 120, 3) / 4
        frame = ccd.find(x_t0, x_t1)
        yield from (frame.vf, frame.vf_impacts.toi, frame.ee, frame.ee_impacts.toi)
        x_t0 = x_t1


def rigid(threads):
    from tauguard.rigid import (
        Boxes,
        MeshTree,
        Motion,
        Tetrahedra,
        distance,
        overlap,
        time_of_impact,
    )

    rng = np.random.default_rng(2)
    a, b = (Tetrahedra(exact(rng, 400, 4, 3)) for _ in "ab")
    yield overlap(a, b, threads=threads).hit
    gaps = distance(a, b, threads=threads)
    yield from (gaps.distance, gaps.normal)
    turns = np.tile(np.eye(4), (50, 1, 1))
    turns[:, :3, 3] = 2 * exact(rng, 50, 3)
    boxes = Boxes(np.zeros((50, 3)), np.full((50, 3), 0.25), np.tile(np.eye(3), (50, 1, 1)))
    rest = Motion(np.eye(4), np.zeros(3), np.zeros(3))
    moving = Motion(turns, 3 * exact(rng, 50, 3), 2 * exact(rng, 50, 3))
    yield time_of_impact(boxes, boxes, moving, rest, threads=threads).time_of_impact
    tree = MeshTree(exact(rng, 60, 3), rng.permutation(60).reshape(-1, 3))
    contacts = tree.contacts(tree, np.eye(4), threads=threads)
    yield from (contacts.faces, contacts.point, contacts.penetration)


def geometry(threads):
    from tauguard.geometry import orient3d

    yield orient3d(exact(np.random.default_rng(3), 5000, 4, 3), threads=threads)


def arm(threads):
    from tauguard.envs import CollisionPlan, Episode, Simulation
    from tauguard.models import Mismatch

    plan = CollisionPlan("pulse", 0.6, 4, strength=60.0)
    trace = Simulation(
        Episode(1, seconds=1.0, speed=60.0, payload_g=1000.0, collisions=(plan,),
                mismatch=Mismatch(seed=1))
    ).run()  # fmt: skip
    yield from (trace.truth.tau_ext, trace.q, trace.qd, trace.current)


def motion():
    """Samples of the arm that no integration has touched, and its model."""
    from tauguard.detectors import ArmModel, RobotNumbers
    from tauguard.models import cura6, cura6_drive, pin_model

    rng = np.random.default_rng(4)
    t = np.arange(2000) / 1024
    q = np.cumsum(exact(rng, 2000, 6), axis=0) / 1024
    arm = ArmModel(RobotNumbers.from_pin(pin_model(cura6.arm_xml())), np.array(cura6_drive().gain))
    return arm, t, q, exact(rng, 2000, 6), 4 * exact(rng, 2000, 6)


def observer(threads):
    from tauguard.detectors import observe

    arm, t, q, qd, current = motion()
    yield observe(arm.robot, t, q, qd, arm.drive_gain * current, 50.0, threads=threads)


def detector(threads):
    from tauguard.detectors.features.front_end import FrontEnd, Scaling
    from tauguard.detectors.scores.baselines import FittedThresholds
    from tauguard.detectors.scores.kernel import KernelMachine
    from tauguard.traces import Trace

    arm, t, q, qd, current = motion()
    trace = Trace(arm.robot.joint_names, t, q, qd, current)
    front = FrontEnd(200.0, True, 0.1, (0, 1, 2, 3), arm, trace.dt)
    scaling = Scaling(front.joints)
    yield FittedThresholds(front, scaling, np.ones(4), "golden").scores(trace)
    rng = np.random.default_rng(5)
    machine = KernelMachine(exact(rng, 100, 4), exact(rng, 100), 0.25, 3.0)
    out = np.empty(len(t))
    machine.native.rows(np.ascontiguousarray(front.scaled(trace, scaling)), out, threads)
    yield out


PARTS = {f.__name__: f for f in (geometry, cloth, rigid, arm, observer, detector)}


def hashed(arrays):
    """SHA-256 over the arrays' types, shapes and bits."""
    digest = hashlib.sha256()
    for array in map(np.ascontiguousarray, arrays):
        digest.update(f"{array.dtype.str}{array.shape}".encode() + array.tobytes())
    return digest.hexdigest()


def values(arrays):
    """A few numbers of the last floating array."""
    last = [a for a in arrays if a.dtype.kind == "f"][-1]
    flat = last.ravel()
    return [float(x) for x in flat[:: max(1, len(flat) // KEPT)][:KEPT]]


def machine():
    """Hash of what a processor and its libraries decide: mathematical functions, sums, products.

    Two machines that agree here have to agree in everything; others may differ in last bits.
    """
    x = np.random.default_rng(6).normal(size=4096)
    square = x.reshape(64, 64)
    names = ("sin", "cos", "tan", "exp", "tanh", "atan", "cbrt")
    own = [[getattr(math, name)(v) for v in x] for name in names]
    one = [np.sin(x), np.tanh(x), np.exp(x), x.sum(), square @ square, np.linalg.inv(square)]
    return hashed([np.array(y) for y in (*own, *one)])


def computed(threads=1):
    """Hash and a few values of every part."""
    found = {}
    for name, part in PARTS.items():
        arrays = list(part(threads))
        floats = [a for a in arrays if np.asarray(a).dtype.kind == "f"]
        found[name] = {"bits": hashed(arrays), "values": values(arrays) if floats else []}
    return found


def main():
    import mujoco

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true")
    now = {"machine": machine(), **computed()}
    if parser.parse_args().write:
        golden = json.loads(FILE.read_text()) if FILE.exists() else {}
        FILE.write_text(json.dumps(golden | {mujoco.__version__: now}, indent=1) + "\n")
    print(json.dumps(now))


if __name__ == "__main__":
    main()
