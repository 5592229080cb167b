"""A bad call of each native module raises tauguard's error for arguments."""

import mujoco
import numpy as np
import pytest

from tauguard.cloth import MeshCCD, _mesh
from tauguard.contacts import GuardedStepper
from tauguard.detectors import _kernel, _network, _observer
from tauguard.envs import _plant
from tauguard.findings import ArgumentError
from tauguard.rigid import MeshTree

BOX = "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"
ROWS = np.zeros((2, 3))


def mesh():
    x = np.random.default_rng(0).normal(size=(60, 3))
    MeshCCD(np.arange(60).reshape(-1, 3)).find(x, -x, limit=0)


def k_dop():
    faces, ids = np.array([[0, 1, 2]], dtype=np.int32), np.zeros(3, dtype=np.int32)
    _mesh.Mesh(faces, ids, np.ones((1, 1), dtype=bool), 7, None, 1)


def rigid():
    x = np.random.default_rng(0).normal(size=(60, 3))
    tree = MeshTree(x, np.arange(60).reshape(-1, 3))
    tree.contacts(tree, np.eye(4), limit=1)


def contacts():
    guard = GuardedStepper(model := mujoco.MjModel.from_xml_string(BOX), mujoco.MjData(model))
    guard._guard.restore(b"another")


def kernel():
    _kernel.KernelSum(ROWS, np.zeros(3), 0.0, 1.0)


def network():
    _network.network(
        ROWS, np.array([3, 1]), np.zeros(1), np.zeros(1), np.zeros(3), np.ones(3), ROWS, 1
    )


def observer():
    _observer.filter(np.ones(3), np.ones(2), ROWS, ROWS, np.zeros((1, 3)), ROWS)


def plant():
    _plant.step_all([], np.zeros((1, 2)), np.zeros(3, dtype=bool), 1)


@pytest.mark.parametrize("call", [mesh, k_dop, rigid, contacts, kernel, network, observer, plant])
def test_a_bad_call_raises_an_argument_error(call):
    with pytest.raises(ArgumentError) as error:
        call()
    (finding,) = error.value.findings
    assert (finding.severity, finding.text) == ("error", str(error.value))


def test_too_many_results_are_an_argument_error_too():
    assert issubclass(_mesh.TooManyError, ArgumentError)
