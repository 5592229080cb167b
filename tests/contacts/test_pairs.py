"""The pairs are those that MuJoCo itself tests."""

import mujoco
import numpy as np
import pytest

from tauguard.contacts import flex_pairs, geom_flex_pairs, geom_pairs

#: Every geom overlaps every other one, so MuJoCo lists every pair that its rules allow.
HEAP = """<mujoco><option{option}><flag {flags}/></option>
<asset><mesh name="t" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>
<worldbody>
  <geom name="floor" type="plane" size="1 1 1" pos="0 0 0.2"/>
  <geom name="wall" size="1"/>
  <body name="a"><joint type="hinge"/><geom name="a1" size="1"/><geom name="a2" type="box"
      size="1 1 1" contype="2" conaffinity="1"/>
    <body name="b"><geom name="b1" size="1"/>
      <body name="c"><joint type="hinge" axis="0 1 0"/><geom name="c1" size="1" margin="0.1"/>
        <body name="d"><joint type="hinge"/><geom name="d1" type="capsule" size="1 1"/></body>
      </body></body></body>
  <body name="hand" mocap="true"><geom name="h1" size="1"/>
    <body name="thumb"><joint type="slide"/><geom name="h2" size="1" gap="0.2"/></body></body>
  <body name="free"><freejoint/><geom name="f1" type="mesh" mesh="t"/><geom name="f2" size="1"
      contype="4" conaffinity="4"/></body>
</worldbody>
<contact><exclude body1="free" body2="c"/><exclude body1="a" body2="hand"/>
  <pair geom1="f1" geom2="c1" margin="0.3" gap="0.1"/><pair geom1="c1" geom2="b1"/>
  <pair geom1="wall" geom2="h1"/></contact></mujoco>"""


@pytest.mark.parametrize("flags", ["", 'filterparent="disable"', 'contact="disable"'])
@pytest.mark.parametrize("option", ["", ' o_margin="0.4"'])
def test_geom_pairs_are_mujocos(flags, option):
    if option:
        flags += ' override="enable"'
    model = mujoco.MjModel.from_xml_string(HEAP.format(flags=flags, option=option))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    expected = {tuple(pair) for pair in data.contact.geom.tolist()}
    pairs = geom_pairs(model)
    assert set(zip(pairs.first.tolist(), pairs.second.tolist(), strict=True)) == expected
    assert len(pairs) == len(expected)
    margin = {
        tuple(g): m
        for g, m in zip(data.contact.geom.tolist(), data.contact.includemargin, strict=True)
    }
    for first, second, value in zip(pairs.first, pairs.second, pairs.margin, strict=True):
        assert value == pytest.approx(margin[first, second])


def test_reach_is_never_negative_and_has_names():
    text = HEAP.format(flags="", option="").replace('margin="0.1"', 'margin="-0.1" gap="0.1"')
    pairs = geom_pairs(mujoco.MjModel.from_xml_string(text))
    assert pairs.margin.min() < 0
    assert pairs.reach("margin").min() == 0
    np.testing.assert_array_equal(pairs.reach("surface"), 0)
    assert pairs.reach("gap").max() == pytest.approx(0.4)
    with pytest.raises(ValueError, match="'far': expected one of surface, margin, gap"):
        pairs.reach("far")


CLOTHS = """<mujoco><worldbody>
  <geom name="floor" type="plane" size="1 1 1"/>
  <body><freejoint/><geom name="ball" size=".1" contype="2" conaffinity="2" margin=".01"/></body>
  <flexcomp name="one" type="grid" dim="2" count="3 3 1" spacing=".1 .1 .1" radius=".01" mass="1">
    <contact selfcollide="{own}" margin=".02" gap=".03"/><edge equality="true"/></flexcomp>
  <flexcomp name="two" type="grid" dim="2" count="3 3 1" spacing=".1 .1 .1" radius=".01" mass="1">
    <contact contype="3" conaffinity="3" selfcollide="none"/><edge equality="true"/></flexcomp>
</worldbody></mujoco>"""


@pytest.mark.parametrize("own", ["none", "auto"])
def test_flex_pairs_follow_the_masks(own):
    model = mujoco.MjModel.from_xml_string(CLOTHS.format(own=own))
    pairs = geom_flex_pairs(model)
    found = set(zip(pairs.first.tolist(), pairs.second.tolist(), strict=True))
    assert found == {(0, 0), (0, 1), (1, 1)}
    assert pairs.margin.tolist() == pytest.approx([0.02, 0.0, 0.01])
    own_pairs = flex_pairs(model)
    expected = {(0, 1): 0.02} if own == "none" else {(0, 0): 0.0, (0, 1): 0.02}
    got = zip(own_pairs.first.tolist(), own_pairs.second.tolist(), strict=True)
    assert dict(zip(got, own_pairs.margin.tolist(), strict=True)) == pytest.approx(expected)
