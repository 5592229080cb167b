"""Speeds and payloads of a data set: both in turn, and every pair of them."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tauguard.datasets.plans import demo_plan, pairing, struck_episodes, torque_scale
from tauguard.envs import simulate
from tauguard.traces import STRATA


@given(st.integers(1, 7), st.integers(1, 7))
def test_every_pair_comes_equally_often(speeds, payloads):
    fast, heavy = range(1, speeds + 1), [100.0 * k for k in range(payloads)]
    pairs = [pairing(i, fast, heavy) for i in range(speeds * payloads)]
    assert sorted(pairs) == sorted(product(map(float, fast), heavy))
    assert [p[0] for p in pairs[:speeds]] == [float(s) for s in fast]


TINY = """
<mujoco><worldbody>{open}{close}</worldbody><actuator>{motors}</actuator></mujoco>
"""


@pytest.fixture(scope="module")
def tiny(tmp_path_factory):
    """An arm of four joints of at most 3 N m, each link 0.12 m and 0.1 kg."""
    axes = ("0 0 1", "0 1 0", "0 1 0", "1 0 0")
    links = [
        f'<body name="l{k}" pos="0 0 {0.12 if k else 0.05}"><joint name="j{k}" axis="{axis}" '
        f'range="-100 100"/><geom type="capsule" fromto="0 0 0 0 0 .12" size=".02" mass=".1"/>'
        for k, axis in enumerate(axes)
    ]
    motors = "".join(f'<motor joint="j{k}" ctrlrange="-3 3" gear="1"/>' for k in range(len(axes)))
    path = tmp_path_factory.mktemp("tiny") / "tiny.xml"
    path.write_text(TINY.format(open="".join(links), close="</body>" * len(axes), motors=motors))
    return str(path)


def test_a_small_arm_of_four_joints_gets_collisions_and_loads_of_its_size(tiny):
    share = torque_scale(tiny)
    assert share == pytest.approx(3 / 64)
    assert torque_scale("cura6") == 1
    (episode,) = struck_episodes(0, 1, 5, (30.0,), (100.0,), robot=tiny)
    assert {plan.link for plan in episode.collisions} <= {2, 3, 4}
    assert {plan.severity for plan in episode.collisions} <= {
        (share * low, share * high) for low, high in STRATA
    }
    assert episode.payload_g == 100.0
    trace = simulate(replace(episode, speed=10.0))
    assert trace.truth is not None
    assert trace.truth.collisions
    assert np.isfinite(trace.current).all()


def test_a_demo_on_a_small_arm_lifts_small_loads(tiny):
    whole, small = demo_plan(0), demo_plan(0, tiny)
    for one, other in zip(whole.train, small.train, strict=True):
        assert other.payload_g == pytest.approx(3 / 64 * one.payload_g)
