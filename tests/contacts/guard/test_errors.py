"""An error within a guarded step leaves the state of before and ends no process."""

import copy
import threading

import mujoco
import numpy as np
import pytest

from tauguard.contacts import GuardedStepper
from tauguard.contacts.scenes import ball_cloth

STATE = mujoco.mjtState.mjSTATE_INTEGRATION


def bits(model, data):
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    return state.tobytes()


def boxes(memory):
    bodies = "".join(
        f"""<body pos="0 0 {0.15 * k + 0.05}"><freejoint/>
        <geom type="box" size=".1 .1 .1"/></body>"""
        for k in range(20)
    )
    return mujoco.MjModel.from_xml_string(f"""<mujoco><size memory="{memory}"/><worldbody>
      <geom type="plane" size="1 1 .1"/>{bodies}</worldbody></mujoco>""")


def test_too_little_memory_is_mujocos_own_error():
    model = boxes("20K")
    plain = mujoco.MjData(model)
    with pytest.raises(mujoco.FatalError, match="stack overflow") as expected:
        mujoco.mj_step(model, plain)
    data = mujoco.MjData(model)
    guard, before = GuardedStepper(model, data), bits(model, data)
    for _ in range(3):
        with pytest.raises(mujoco.FatalError, match="stack overflow") as found:
            guard.step()
        assert str(found.value) == str(expected.value)
        assert bits(model, data) == before
        assert data.pstack == 0
    with pytest.raises(mujoco.FatalError):  # the binding's own handler is in its place again
        mujoco.mj_step(model, data)


def test_an_error_in_the_middle_of_a_step_that_is_rolled_back():
    model, data = ball_cloth(50.0).start(5e-3)
    guard = GuardedStepper(model, data)
    while not guard.step().cuts:
        pass
    before, options = bits(model, data), (model.opt.timestep, model.flex_margin.copy())

    def fail():
        raise KeyError("told")

    data.qvel[-4] = -50
    before = bits(model, data)
    with pytest.raises(KeyError, match="told"):
        guard.step(fail)
    assert bits(model, data) == before
    assert model.opt.timestep == options[0]
    np.testing.assert_array_equal(model.flex_margin, options[1])
    for _ in range(10):
        assert not guard.step().exhausted


def test_an_exception_in_a_callback_of_mujocos_comes_out():
    model, data = ball_cloth(50.0).start(5e-3)
    guard, before = GuardedStepper(model, data), bits(model, data)

    def control(model, data):
        raise ZeroDivisionError("in control")

    mujoco.set_mjcb_control(control)
    try:
        with pytest.raises(ZeroDivisionError, match="in control"):
            guard.step()
    finally:
        mujoco.set_mjcb_control(None)
    assert bits(model, data) == before
    for _ in range(10):
        assert not guard.step().exhausted


def test_a_warning_of_mujocos_still_arrives(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log there
    messages, before = [], mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(messages.append)  # another library may have set its own
    try:
        model = boxes("40K")
        GuardedStepper(model, mujoco.MjData(model)).step()
    finally:
        mujoco.set_mju_user_warning(before)
    assert any("arena memory" in message for message in messages), messages


def test_a_step_within_a_step_is_refused():
    model, data = ball_cloth(50.0).start(5e-3)
    guard, messages = GuardedStepper(model, data), []

    def each():
        for call in (guard.step, guard.reset, guard.close, lambda: copy.deepcopy(guard)):
            with pytest.raises(RuntimeError, match="this guard is in a step") as found:
                call()
            messages.append(found.value)
        assert isinstance(guard.sunk, tuple)

    while not messages:
        guard.step(each)
    assert len(messages) % 4 == 0


def test_threads_on_one_guard_are_refused_not_mixed():
    model, data = ball_cloth(50.0).start(5e-3)
    guard, made, refused = GuardedStepper(model, data), [], []

    def go():
        for _ in range(10):
            try:
                guard.step()
                made.append(1)
            except RuntimeError as error:
                refused.append(str(error))

    threads = [threading.Thread(target=go) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(made) + len(refused) == 40
    assert all("use one guard and one MjData per thread" in text for text in refused)
    assert data.time == pytest.approx(len(made) * 5e-3)
