"""Ten simulated hours without a reset, and 100,000 resets: no growth, no drift, no fault."""

import sys

import numpy as np
import pytest

from slow import endurance

#: Simulated hours and resets, and the parts into which each run is divided.
HOURS, RESETS, PARTS = 10.0, 100_000, 20
#: Largest growth of memory after the first tenth [MiB]: 110 bytes a reset, 6 bytes an action.
GROWTH = 10.0
#: Largest change of the rms residual from the first tenth to the last part.
DRIFT = 0.05

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc"),
]


@pytest.fixture(scope="module")
def alarm(slow_seed):
    return endurance.detector(slow_seed)


def test_resets(alarm, slow_seed, counts):
    env = endurance.environment(alarm, slow_seed)
    parts = [endurance.reset(env, RESETS // PARTS) for _ in range(PARTS)]
    growth = parts[-1]["memory_mib"] - parts[PARTS // 10 - 1]["memory_mib"]
    counts(resets=RESETS, growth_mib=round(growth, 2), **parts[-1])
    assert growth < GROWTH


def test_hours_without_a_reset(alarm, slow_seed, counts):
    env = endurance.environment(alarm, slow_seed)
    each = round(HOURS * 3600 * endurance.RATE) // PARTS
    parts = [endurance.moved(env, k * each / endurance.RATE, each) for k in range(PARTS)]
    first, last = parts[PARTS // 10 - 1], parts[-1]
    growth = last["memory_mib"] - first["memory_mib"]
    drift = last["rms_residual"] / first["rms_residual"]
    alarms = sum(part["alarms"] for part in parts)
    counts(
        hours=HOURS, growth_mib=round(growth, 2), drift=round(drift, 4), all_alarms=alarms, **last
    )
    assert growth < GROWTH
    assert np.isclose(drift, 1, atol=DRIFT)
    assert not sum(part["faults"] for part in parts)
