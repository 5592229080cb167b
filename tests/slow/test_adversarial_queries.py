"""Queries near every degeneracy: ab2pf against exact integers that share no code with it.

The same queries are asked scaled by powers of two, with their vertices in another order, and
backwards in time; no answer may change.
"""

import multiprocessing
from functools import partial

import numpy as np
import pytest

from oracles.adversarial_queries import KINDS
from oracles.mesh_contact import judge
from tests.cloth.solve import solve_each

#: Queries of one set and kind, 2 million in all, and of one job.
COUNT, CHUNK = 83_334, 500

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def workers():
    with multiprocessing.get_context("spawn").Pool() as pool:
        yield pool


@pytest.mark.parametrize("vertex", [True, False])
@pytest.mark.parametrize("name", KINDS)
def test_adversarial_queries(name, vertex, slow_seed, counts, workers):
    place = 2 * list(KINDS).index(name) + (not vertex)
    x = KINDS[name](np.random.default_rng([slow_seed, place]), COUNT, vertex)
    answer = partial(solve_each, vertex)
    found = answer(x)
    jobs = [(x[k : k + CHUNK], vertex, found.toi[k : k + CHUNK]) for k in range(0, COUNT, CHUNK)]
    verdicts = workers.starmap(judge, jobs)
    true = np.concatenate([one.hit for one in verdicts])
    early = max(one.early_most for one in verdicts)
    wrong = {key: sum(getattr(one, key) for one in verdicts) for key in ("misses", "late")}
    wrong["false_hits"] = sum(one.false_hits for one in verdicts)
    wrong["exact_differs"] = int((answer(x, "exact").hit != true).sum())
    order = [0, 3, 1, 2] if vertex else [3, 2, 0, 1]
    changed = {
        "scaled down": np.ldexp(x, -300),
        "scaled up": np.ldexp(x, 300),
        "turned": x[:, :, order],
        "backwards": x[:, ::-1],
    }
    wrong |= {key: int((answer(y).hit != found.hit).sum()) for key, y in changed.items()}
    exactly = found.counts["exact"]
    counts(queries=COUNT, hits=int(true.sum()), decided_exactly=exactly, early=f"{early:.1e}")
    assert not any(wrong.values()), wrong
    assert early <= 1e-9
