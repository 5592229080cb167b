"""Jobs of the slow test of size ratios, in a module that its worker processes can import."""

from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import product
from multiprocessing import get_context
from os import sched_getaffinity

import numpy as np

from oracles import size_ratios

#: Rows that one process takes at a time.
CHUNK = 50
#: Bodies of full dimension: the others' exact time of impact is not known.
SOLID = ("tetrahedra", "boxes", "parallelepipeds")


def bodies(rng):
    kinds = list(product(size_ratios.KINDS, repeat=2))
    pair = size_ratios.pair(rng, kinds[rng.integers(len(kinds))])
    return size_ratios.judged(*pair, int(rng.integers(-100, 101)))


def meshes(rng):
    return size_ratios.mesh_error(rng, str(rng.choice(size_ratios.KINDS)))


def moving(rng):
    kinds = str(rng.choice(SOLID)), str(rng.choice(SOLID))
    return size_ratios.timed(rng, kinds, int(rng.integers(-60, 61)))


def chunk(judge, seed):
    """So many rows of one seed."""
    rng = np.random.default_rng(seed)
    return [judge(rng) for _ in range(CHUNK)]


def rows(judge, seed, count):
    """``count`` rows, by as many processes as there are processors for this one."""
    workers, context = len(sched_getaffinity(0)), get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        seeds = [(seed, number) for number in range(count // CHUNK)]
        return [row for rows in pool.map(partial(chunk, judge), seeds) for row in rows]
