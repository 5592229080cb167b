"""What a caller, a second thread, a fork or a signal does changes no answer and hangs nothing."""

import copy
import os
import pickle
import resource
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from tauguard.cloth import Groups, MeshCCD, edge_edge
from tauguard.cloth.scenes import SCENES
from tauguard.geometry import orient3d

TWO = np.array([[0, 1, 2], [3, 4, 5]], dtype=np.int32)
X_T0 = np.array([[0.3, 0.3, 1], [2, 0.3, 1], [0.3, 2, 1], [0, 0, 0], [1, 0, 0], [0, 1, 0]])
X_T1 = X_T0 - np.repeat([[0, 0, 2.0], [0, 0, 0]], 3, axis=0)


def pairs(frame):
    return frame.vf.tolist(), frame.ee.tolist()


@pytest.fixture
def ctrl_c():
    """SIGINT as in a terminal (a job in the background ignores it), sent once after 0.1 s."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    killer = threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT))
    yield killer.start
    killer.join()
    signal.signal(signal.SIGINT, before)


def run_python(code, seconds=60):
    """Output of a process of its own, which may hang or die where this one may not."""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=seconds
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout.strip()


def test_faces_changed_in_place_change_no_answer():
    faces = TWO.copy()
    ccd = MeshCCD(faces)
    faces[:] = [[0, 1, 2**31 - 2], [3, 4, 2**30]]
    assert pairs(ccd.find(X_T0, X_T1)) == pairs(MeshCCD(TWO).find(X_T0, X_T1))
    assert np.array_equal(ccd.faces, TWO)


@pytest.mark.parametrize("name", ["faces", "edges", "groups", "method", "threads", "volume"])
def test_no_attribute_of_a_mesh_can_be_assigned(name):
    ccd = MeshCCD(TWO, groups=Groups([0] * 6, [[True]]))
    with pytest.raises(AttributeError, match=name):
        setattr(ccd, name, np.array([[0, 1, 10**6]], dtype=np.int32))


@pytest.mark.parametrize("of", ["faces", "edges", "ids", "meets"])
def test_no_array_of_a_mesh_can_be_changed(of):
    groups = Groups(np.zeros(6, dtype=np.int32), np.ones((1, 1), dtype=bool))
    ccd = MeshCCD(TWO, groups=groups)
    ccd.find(X_T0, X_T1)
    for held in (
        groups,
        copy.copy(groups),
        copy.deepcopy(groups),
        pickle.loads(pickle.dumps(groups)),
    ):
        array = getattr(ccd if of in ("faces", "edges") else held, of)
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 99
        with pytest.raises(ValueError, match="WRITEABLE"):
            array.flags.writeable = True


def test_group_ids_changed_in_place_change_no_answer():
    ids, meets = np.zeros(6, dtype=np.int32), np.ones((1, 1), dtype=bool)
    ccd = MeshCCD(TWO, groups=Groups(ids, meets))
    ids[:], meets[:] = 2**30, False
    assert pairs(ccd.find(X_T0, X_T1)) == pairs(MeshCCD(TWO).find(X_T0, X_T1))


def test_find_in_one_thread_and_update_topology_in_another():
    scene = SCENES["pleats"](600, 0)
    (x_t0, x_t1), *_ = scene.steps(1)
    halves = [scene.faces, scene.faces[: len(scene.faces) // 2]]
    truth = [pairs(MeshCCD(faces).find(x_t0, x_t1)) for faces in halves]
    ccd = MeshCCD(scene.faces, threads=2)
    stop, wrong = threading.Event(), []

    def change():
        for i in range(120):
            ccd.update_topology(halves[i % 2])
        stop.set()

    def ask():
        while not stop.is_set():
            if pairs(ccd.find(x_t0, x_t1)) not in truth:
                wrong.append("find")
            if len(ccd.edges) not in [len(MeshCCD(f).edges) for f in halves]:
                wrong.append("edges")

    workers = [threading.Thread(target=f) for f in (change, ask, ask)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(120)
    assert not wrong
    assert not any(worker.is_alive() for worker in workers)


def test_positions_written_by_another_thread_during_a_call():
    # Whatever it sees of them, find answers or refuses them by name, and goes on afterwards.
    scene = SCENES["pleats"](600, 0)
    (x_t0, x_t1), *_ = scene.steps(1)
    truth = pairs(MeshCCD(scene.faces).find(x_t0, x_t1))
    shared, stop = x_t1.copy(), threading.Event()

    def scribble():
        while not stop.is_set():
            shared[::7] = np.nan
            shared[:] = x_t1

    writer = threading.Thread(target=scribble)
    writer.start()
    ccd = MeshCCD(scene.faces)
    refusals = []
    for _ in range(60):
        try:
            ccd.find(x_t0, shared)
        except ValueError as error:
            refusals.append(str(error))
    stop.set()
    writer.join()
    assert all("finite" in refusal for refusal in refusals)
    assert pairs(ccd.find(x_t0, x_t1)) == truth


FORK = """
import os, sys, threading, time
import numpy as np
from tauguard.cloth import MeshCCD
from tauguard.cloth.scenes import SCENES
from tauguard.geometry import orient3d
scene = SCENES["pleats"](2000, 0)
(x_t0, x_t1), *_ = scene.steps(1)
ccd = MeshCCD(scene.faces, threads=2)
before = ccd.find(x_t0, x_t1)
orient3d(np.random.default_rng(0).normal(size=(20000, 4, 3)), threads=2)
child = os.fork()
if child == 0:
    BODY
for _ in range(300):
    done, status = os.waitpid(child, os.WNOHANG)
    if done:
        print(os.waitstatus_to_exitcode(status))
        break
    time.sleep(0.1)
else:
    os.kill(child, 9)
    print("hang")
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.parametrize(
    "body",
    [
        "sys.exit(0)",
        "after = ccd.find(x_t0, x_t1); sys.exit(not np.array_equal(before.ee, after.ee))",
        "orient3d(np.zeros((20000, 4, 3)), threads=2); sys.exit(0)",
    ],
    ids=["bare exit", "find", "orient3d"],
)
def test_a_forked_child_answers_and_exits(body):
    assert run_python(FORK.replace("BODY", body)) == "0"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_child_forked_during_a_call_is_told_so():
    code = """
import os, sys, threading, time
import numpy as np
from tauguard.cloth import MeshCCD
n = 6000
faces = np.arange(3 * (n // 3)).reshape(-1, 3)
x = np.zeros((n, 3))
ccd = MeshCCD(faces, method="exact")
threading.Thread(target=lambda: ccd.find(x, x), daemon=True).start()
time.sleep(0.5)
child = os.fork()
if child == 0:
    try:
        ccd.find(x, x)
    except RuntimeError as error:
        os._exit(0 if "forked" in str(error) else 2)
    os._exit(3)
for _ in range(100):
    done, status = os.waitpid(child, os.WNOHANG)
    if done:
        break
    time.sleep(0.1)
print(os.waitstatus_to_exitcode(status) if done else "hang", flush=True)
os._exit(0)
"""
    assert run_python(code) == "0"


@pytest.mark.parametrize("method", ["ab2pf", "exact"])
def test_ctrl_c_ends_a_find_of_identical_vertices(method, ctrl_c):
    n = 2400  # a fast machine needs well over the 0.1 s
    faces, x = np.arange(n).reshape(-1, 3), np.zeros((n, 3))
    ccd = MeshCCD(faces, method=method, threads=2)
    ctrl_c()
    start = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        ccd.find(x, x)
    assert time.perf_counter() - start < 5
    # The same object goes on.
    spread = x + np.arange(n)[:, None]
    assert len(ccd.find(spread, spread).ee) == 0


def test_ctrl_c_ends_single_queries(ctrl_c):
    x = np.zeros((400_000, 4, 3))
    x[:, 1, 0] = 1e-300
    x[:, 2:, 1] = [1.0, 1e300]
    ctrl_c()
    start = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        edge_edge(x, x, method="exact")
    assert time.perf_counter() - start < 20


def test_a_signal_handler_that_asks_the_same_mesh_is_refused():
    n = 2700  # long enough to be interrupted
    faces, x = np.arange(n).reshape(-1, 3), np.zeros((n, 3))
    ccd, other = MeshCCD(faces), MeshCCD(TWO, threads=2)
    truth, seen = pairs(other.find(X_T0, X_T1)), []

    def handler(*_):
        assert pairs(other.find(X_T0, X_T1)) == truth  # another mesh answers
        try:
            ccd.find(x, x)
        except RuntimeError as error:
            seen.append(str(error))
        raise InterruptedError

    before = signal.signal(signal.SIGALRM, handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        with pytest.raises(InterruptedError):
            ccd.find(x, x)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert seen == ["this object is already in a call of the same thread"]


def test_a_result_beyond_the_limit_is_refused_and_a_larger_limit_allows_it():
    n = 60
    faces, x = np.arange(n).reshape(-1, 3), np.zeros((n, 3))
    ccd = MeshCCD(faces)
    whole = ccd.find(x, x)
    assert len(whole.ee) == 60 * 57 // 2
    for limit in (0, 1, len(whole.ee) - 1):
        with pytest.raises(ValueError, match=rf"limit: more than {limit} .*limit= allows"):
            ccd.find(x, x, limit=limit)
        with pytest.raises(ValueError, match="limit: more than"):
            ccd.candidates(x, x, limit=limit)
    assert pairs(ccd.find(x, x, limit=len(whole.ee))) == pairs(whole)


def test_pairs_of_tree_nodes_are_bounded_too():
    faces, x = np.arange(60_000).reshape(-1, 3), np.zeros((60_000, 3))
    with pytest.raises(ValueError, match="limit: more than 8000 pairs of tree nodes"):
        MeshCCD(faces).find(x, x, limit=1000)


@pytest.mark.parametrize("bad", [-1, 1.5, "9", None, True, 2**41])
def test_a_limit_that_is_no_count_is_refused(bad):
    with pytest.raises(ValueError, match="limit: "):
        MeshCCD(TWO).find(X_T0, X_T1, limit=bad)


@pytest.mark.parametrize("largest", [10**8, 2**31 - 2])
def test_memory_goes_by_the_vertices_in_use_not_by_the_largest_number(largest):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    ccd = MeshCCD([[0, 1, largest], [1, largest, 7]])
    ccd.update_topology([[0, 1, largest], [3, 5, largest - 1]])
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert grown < 50_000  # KiB
    wanted = [[0, 1], [0, largest], [1, largest], [3, 5], [3, largest - 1], [5, largest - 1]]
    assert ccd.edges.tolist() == wanted
    with pytest.raises(ValueError, match=f"{largest}"):
        ccd.find(X_T0, X_T1)


def test_threads_are_a_count():
    for bad in ("2", 2.0, -1, True, 10**9, None):
        with pytest.raises(ValueError, match="threads: "):
            MeshCCD(TWO, threads=bad)
        with pytest.raises(ValueError, match="threads: "):
            orient3d(np.zeros((1, 4, 3)), threads=bad)
