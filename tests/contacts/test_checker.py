"""The protocol: states, contacts, the registry."""

import mujoco
import numpy as np
import pytest

from tauguard.contacts import (
    Checker,
    Contacts,
    State,
    check_states,
    checker,
    geom_kinds,
    pair_kind,
    register,
    registered,
)

SCENE = """<mujoco><option timestep="0.002"/><worldbody>
  <geom type="plane" size="1 1 .1"/>
  <body pos="0 0 1"><freejoint/><geom type="box" size=".1 .2 .3" pos=".1 0 0"/></body>
  <body mocap="true" name="hand"><geom type="sphere" size=".1"/></body>
  <flexcomp name="sheet" type="grid" dim="2" count="3 3 1" spacing=".1 .1 .1" pos="0 0 2"
    radius=".001" mass=".1"><edge equality="true"/></flexcomp>
</worldbody></mujoco>"""


def test_state_is_that_of_qpos_and_leaves_data_alone():
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    data.mocap_pos[0] = 1, 2, 3
    data.qvel[:6] = 1, 2, 3, 4, 5, 6
    mujoco.mj_step(model, data)
    stale = data.geom_xpos.copy()
    state = State.of(model, data, mujoco.MjData(model))
    np.testing.assert_array_equal(data.geom_xpos, stale)
    mujoco.mj_forward(model, data)
    for name in ("qpos", "qvel", "xpos", "xmat", "geom_xpos", "geom_xmat", "flexvert_xpos"):
        np.testing.assert_array_equal(getattr(state, name), getattr(data, name), err_msg=name)
    assert not np.array_equal(stale, state.geom_xpos)
    assert state.time == 0.002


def test_vertices_that_a_turning_body_carries_have_the_bits_of_mujoco():
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody>
      <body name="b" euler="10 20 30"><joint type="ball"/><geom size=".1"/>
        <flexcomp name="sheet" type="grid" dim="2" count="4 4 1" spacing=".1 .1 .1" pos=".3 .1 .2"
          radius=".001" mass=".1"><edge equality="true"/><pin id="0 1 2 3 9"/></flexcomp>
      </body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qvel[:3] = 3, -5, 7
    for _ in range(20):
        mujoco.mj_step(model, data)
    state = State.of(model, data)
    mujoco.mj_forward(model, data)
    np.testing.assert_array_equal(state.flexvert_xpos, data.flexvert_xpos)
    assert np.abs(data.flexvert_xpos - data.xpos[model.flex_vertbodyid]).max() > 0.1


@pytest.mark.parametrize("name", ["cloth", "rigid"])
def test_a_checker_without_a_pair_reports_nothing(name):
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><geom size='1'/></worldbody></mujoco>"
    )
    state = State.of(model, mujoco.MjData(model))
    assert len(checker(name, model).check(state, state)) == 0


def test_contacts_check_their_shapes_and_join():
    assert len(Contacts.empty()) == len(Contacts.concatenate([])) == 0
    one = Contacts([0.5], [[0, -1]], [[-1, 0]], [[-1, 3]], [[0, 0, 1]], [[0, 0, 1]], [0.0])
    both = Contacts.concatenate([one, Contacts.empty(), one])
    assert len(both) == 2
    assert both.geom.dtype == np.int32
    assert len(both.where(np.array([True, False]))) == 1
    with pytest.raises(ValueError, match="normal: shape"):
        Contacts([0.5], [[0, 1]], [[-1, -1]], [[-1, -1]], [[0, 0, 1]], [[0, 1]], [0.0])


class Nothing:
    """Sees nothing."""

    name = "nothing"
    covers = frozenset({pair_kind("sphere", "plane")})

    def __init__(self, model, word="none"):
        self.word = word

    def check(self, before, after):
        return Contacts.empty()


def test_anyone_registers_a_checker_and_options_reach_it():
    model = mujoco.MjModel.from_xml_string(SCENE)
    register("nothing", Nothing)
    assert "nothing" in registered()
    mine = checker("nothing", model, word="yes")
    assert isinstance(mine, Checker)
    assert mine.word == "yes"
    assert mine.covers == {("plane", "sphere")}
    assert geom_kinds(model) == ["plane", "box", "sphere"]


def test_a_name_is_taken_once():
    register("nothing", Nothing)
    with pytest.raises(ValueError, match="'nothing': already registered"):
        register("nothing", lambda model: Nothing(model))
    with pytest.raises(ValueError, match="'cloth': already registered"):
        register("cloth", Nothing)
    register("nothing", Nothing, replace=True)


def test_a_checker_that_returns_no_contacts_is_named():
    class Mute(Nothing):
        name = "mute"

        def check(self, before, after):
            return None

    model = mujoco.MjModel.from_xml_string(SCENE)
    state = State.of(model, mujoco.MjData(model))
    with pytest.raises(TypeError, match="'mute': check returned NoneType, expected Contacts"):
        check_states(model, [state, state], [Mute(model)])


def test_bad_names_say_what_there_is():
    register("nothing", Nothing)
    model = mujoco.MjModel.from_xml_string(SCENE)
    with pytest.raises(ValueError, match=r"'nothin': expected one of .*nothing"):
        checker("nothin", model)
    with pytest.raises(ValueError, match="name: empty"):
        register("", Nothing)
    with pytest.raises(ValueError, match="cannot be called"):
        register("x", 3)
    with pytest.raises(ValueError, match="'ball': expected one of plane"):
        pair_kind("ball", "box")
