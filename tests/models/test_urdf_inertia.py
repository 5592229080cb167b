"""Impossible inertias of a URDF become ones that a body can have, and the arm says so."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.models import load_arm
from tauguard.models.urdf import possible_inertia

ARM = """<robot name="r"><link name="base"/>
<link name="arm"><inertial><mass value="2"/><origin xyz="0.1 0 0"/>
  <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
<joint name="one" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" effort="20" velocity="1"/></joint>
<link name="tip"><inertial><mass value="1"/><inertia {}/></inertial></link>
<joint name="two" type="revolute"><parent link="arm"/><child link="tip"/><axis xyz="0 1 0"/>
  <origin xyz="0.2 0 0"/><limit lower="-1" upper="1" effort="20" velocity="1"/></joint></robot>"""
GOOD = 'ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"'


@settings(deadline=None)
@given(
    entries=st.lists(st.floats(-10, 10), min_size=6, max_size=6),
    size=st.sampled_from([1e-6, 1e-3, 1.0]),
)
def test_any_tensor_becomes_that_of_a_body(entries, size):
    a, b, c, d, e, f = np.array(entries) * size
    found = possible_inertia(np.array([[a, d, e], [d, b, f], [e, f, c]]), 1.0)
    moments = np.linalg.eigvalsh(found)
    assert moments[0] > 0
    assert moments[2] <= (moments[0] + moments[1]) * (1 + 1e-9)


def test_a_thin_rod_hardly_changes():
    rod = np.diag([1.0, 1.0, 0.0])
    np.testing.assert_allclose(possible_inertia(rod, 1.0), rod, atol=0.011)


@pytest.mark.parametrize(
    "bad",
    [
        'ixx="0.001" iyy="0.001" izz="0.1" ixy="0" ixz="0" iyz="0"',
        'ixx="2.4e-8" ixy="6.1e-8" ixz="1.2e-8" iyy="2.8e-8" iyz="7.7e-9" izz="3.8e-8"',
        'ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"',
    ],
)
def test_an_arm_with_such_a_link_loads_and_says_so(tmp_path, bad):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM.format(GOOD))
    assert "inertia" not in load_arm(str(path)).facts.sources
    path.write_text(ARM.format(bad))
    assert "impossible for tip" in load_arm(str(path)).facts.sources["inertia"]
    path.write_text(ARM.format(bad.replace('izz="', 'izz="x')))
    with pytest.raises(ValueError, match=r"link 'tip': inertia izz 'x.*': expected a number"):
        load_arm(str(path))


def test_a_mass_below_zero_is_refused_with_its_link(tmp_path):
    path = tmp_path / "arm.urdf"
    text = ARM.replace('<mass value="1"/>', '<mass value="-1"/>')
    path.write_text(text.format(GOOD.replace("0.01", "-0.01")))
    assert possible_inertia(-np.eye(3), -1.0).dtype == float
    with pytest.raises(ValueError, match=r"mass and inertia of moving bodies must be.*'tip'"):
        load_arm(str(path))
