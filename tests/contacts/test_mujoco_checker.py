"""MuJoCo's own contacts, asked as a checker."""

import mujoco
import numpy as np

from tauguard.contacts import State, checker, contacts_of
from tauguard.contacts.scenes import sleeve_arm, two_arms


def test_it_lists_what_the_next_step_starts_with():
    for scene, steps in ((two_arms(), 900), (sleeve_arm(), 60)):
        model, data = scene.start()
        scratch = mujoco.MjData(model)
        check = checker("mujoco", model)
        seen = 0
        for _ in range(steps):
            mujoco.mj_step1(model, data)
            if data.ncon:
                theirs = contacts_of(data)
                state = State.of(model, data, scratch)
                found = check.check(state, state)
                np.testing.assert_array_equal(found.geom, theirs.geom)
                np.testing.assert_array_equal(found.flex, theirs.flex)
                np.testing.assert_array_equal(found.distance, theirs.distance)
                np.testing.assert_array_equal(found.normal, theirs.normal)
                seen += 1
            if seen == 6:
                break
            if scene.control is not None:
                scene.control(model, data)
            mujoco.mj_step2(model, data)
        assert seen == 6


def test_mocap_bodies_are_where_the_state_has_them():
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody>
      <body name="hand" mocap="true"><geom type="box" size=".1 .1 .1"/></body>
      <body><freejoint/><geom size=".1"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qpos[:3] = 5, 0, 0.15
    data.mocap_pos[0] = 5, 0, 0
    data.mocap_quat[0] = np.array([np.cos(0.4), 0, 0, np.sin(0.4)])
    state = State.of(model, data)
    found = checker("mujoco", model).check(state, state)
    np.testing.assert_allclose(found.distance, [-0.05], atol=1e-9)
    np.testing.assert_array_equal(found.time, [1.0])
