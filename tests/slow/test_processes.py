"""Guards and bodies in pools of any kind, in forked children and in threads: the same bits."""

import copy
import os
import threading
from multiprocessing import get_context

import numpy as np
import pytest

from slow.process_jobs import bodies, distances, rolled
from tauguard.contacts import GuardedStepper
from tauguard.contacts.scenes import ball_cloth
from tauguard.rigid import distance

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("kind", ["fork", "spawn", "forkserver"])
def test_a_pool_of_any_kind_gives_the_same_bits(kind):
    guard = GuardedStepper(*ball_cloth(50.0).start(5e-3))
    guard.step()
    expected = rolled(copy.deepcopy(guard)), distances(1)
    with get_context(kind).Pool(3) as pool:
        assert set(pool.map(rolled, [guard] * 6)) == {expected[0]}
        assert set(pool.map(distances, [1] * 6)) == {expected[1]}


def test_children_forked_while_a_thread_steps_make_guards_of_their_own():
    guard, stop = GuardedStepper(*ball_cloth(50.0).start(5e-3)), threading.Event()

    def go():
        while not stop.is_set():
            guard.step()

    thread = threading.Thread(target=go)
    thread.start()
    for _ in range(20):
        child = os.fork()
        if child == 0:
            try:
                rolled(GuardedStepper(*ball_cloth(50.0).start(5e-3)))
            except BaseException:
                os._exit(1)
            os._exit(0)
        assert os.waitpid(child, 0)[1] == 0
    stop.set()
    thread.join()


def test_threads_may_ask_about_the_same_bodies():
    a, b = bodies(0), bodies(1)
    expected, same = distance(a, b).distance, []

    def ask():
        same.append(np.array_equal(distance(a, b).distance, expected))

    threads = [threading.Thread(target=ask) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert same == [True] * 8
