"""The same bits wherever they can be the same: versions, threads, wheels."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

FILE = Path(__file__).with_name("computed.py")
SPEC = importlib.util.spec_from_file_location("golden_computed", FILE)
golden = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(golden)
GOLDEN = json.loads(golden.FILE.read_text()).get(mujoco.__version__)
#: Of values on another kind of processor, whose sine may round otherwise.
ROUNDING = 1e-6


@pytest.fixture(scope="module")
def here():
    return golden.computed(1)


@pytest.mark.parametrize("part", golden.PARTS)
def test_golden_values(part, here):
    if GOLDEN is None:
        pytest.skip(
            f"no golden values of MuJoCo {mujoco.__version__}. Compare the physics first (`tauguard"
            " bench simulation`), then keep them: `python tests/golden/computed.py --write`"
        )
    wanted = GOLDEN[part]
    if golden.machine() == GOLDEN["machine"]:
        assert here[part]["bits"] == wanted["bits"], (
            f"{part} computes other bits than before. If that is meant: `python "
            "tests/golden/computed.py --write`, and say in CHANGELOG.md that results change"
        )
    np.testing.assert_allclose(here[part]["values"], wanted["values"], rtol=ROUNDING, atol=ROUNDING)


@pytest.mark.parametrize("part", [part for part in golden.PARTS if part != "arm"])  # it has none
def test_threads_change_no_bit(part, here):
    assert golden.hashed(list(golden.PARTS[part](2))) == here[part]["bits"]


def test_another_process_computes_the_same_bits(here):
    run = subprocess.run([sys.executable, FILE], capture_output=True, text=True, check=True)
    other = json.loads(run.stdout)
    assert {name: other[name]["bits"] for name in here} == {n: here[n]["bits"] for n in here}
