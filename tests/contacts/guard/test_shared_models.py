"""A guard only reads its model, so guards may share one."""

import threading

import mujoco
import numpy as np
import pytest

from tauguard.contacts import GuardedStepper
from tauguard.contacts.scenes import ball_cloth

PLATE = """<mujoco><option timestep="5e-3" {options}/><worldbody>
  <geom type="box" size="1 1 .001" {geom}/>
  <body pos="0 0 .5"><freejoint/><geom size=".02" mass=".1" {geom}/></body>
  </worldbody>{extra}</mujoco>"""
CLOTH = ball_cloth(50.0, stiff=False)
SCENES = {
    "geoms": lambda: mujoco.MjModel.from_xml_string(PLATE.format(options="", geom="", extra="")),
    "priority": lambda: mujoco.MjModel.from_xml_string(
        PLATE.format(options='cone="elliptic"', geom='priority="3" condim="4"', extra="")
    ),
    "explicit": lambda: mujoco.MjModel.from_xml_string(
        PLATE.format(
            options='integrator="discrete"',
            geom='name="{}" contype="0"',
            extra='<contact><pair geom1="a" geom2="b"/></contact>',
        )
        .replace("{}", "a", 1)
        .replace("{}", "b", 1)
    ),
    "override": lambda: mujoco.MjModel.from_xml_string(
        PLATE.format(options='o_margin=".001"', geom="", extra="").replace(
            "<worldbody>", '<option><flag override="enable"/></option><worldbody>'
        )
    ),
    "cloth": lambda: CLOTH.start(5e-3)[0],
}


def content(model):
    buffer = np.empty(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


def data_of(model, speed):
    data = mujoco.MjData(model)
    if model.nflex:
        data.qpos[:] = CLOTH.qpos
    data.qvel[-4] = -speed
    return data


@pytest.mark.parametrize("name", SCENES)
def test_the_model_keeps_every_byte_in_sub_steps_too(name):
    model = SCENES[name]()
    before, seen, cuts = content(model), [], 0
    data = data_of(model, 60.0)
    with GuardedStepper(model, data) as guard:
        for _ in range(14):
            cuts += len(guard.step(lambda: seen.append(content(model) == before)).cuts)
            assert content(model) == before
    assert cuts
    assert all(seen)
    assert seen


def run(model, speeds, threads):
    """Final states of one guard for each speed, on a shared model."""
    datas = [data_of(model, speed) for speed in speeds]
    guards = [GuardedStepper(model, data) for data in datas]
    if threads:
        workers = [
            threading.Thread(target=lambda g=g: [g.step() for _ in range(40)]) for g in guards
        ]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
    else:
        for _ in range(40):
            for guard in guards:
                guard.step()
    return [np.concatenate([[d.time], d.qpos, d.qvel]) for d in datas]


@pytest.mark.parametrize("threads", [False, True])
@pytest.mark.parametrize("name", ["geoms", "explicit", "cloth"])
def test_guards_that_share_a_model_have_the_bits_of_guards_with_their_own(name, threads):
    speeds = [60.0, 3.0, 90.0, 35.0]
    alone = [run(SCENES[name](), [speed], False)[0] for speed in speeds]
    for _ in range(1 if name == "cloth" else 10):
        together = run(SCENES[name](), speeds, threads)
        for one, other in zip(alone, together, strict=True):
            np.testing.assert_array_equal(one, other)


def test_a_plain_rollout_beside_a_guard_sees_the_users_model():
    """``mujoco.rollout`` in threads, on the model of a guard that is rolling back all the time."""
    from mujoco import rollout

    model = SCENES["geoms"]()
    start = np.empty((64, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    data = data_of(model, 3.0)
    mujoco.mj_getState(model, data, start[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    start[:] = start[0]
    alone = rollout.rollout(model, [mujoco.MjData(model)], start, nstep=60)[0]
    guarded, stop = data_of(model, 60.0), threading.Event()
    guard, cuts = GuardedStepper(model, guarded), []

    def go():
        while not stop.is_set():
            guarded.qpos[2], guarded.qvel[2] = 0.5, -60
            cuts.extend(cut for _ in range(4) for cut in guard.step().cuts)

    worker = threading.Thread(target=go)
    worker.start()
    datas = [mujoco.MjData(model) for _ in range(2)]
    beside = [rollout.rollout(model, datas, start, nstep=60)[0] for _ in range(5)]
    stop.set()
    worker.join()
    assert cuts
    for states in beside:
        np.testing.assert_array_equal(states, alone)


def test_a_callback_gets_a_model_in_sub_steps_and_the_users_one_is_not_written():
    model = SCENES["geoms"]()
    before, data, seen = content(model), data_of(model, 60.0), set()

    def control(own, own_data):
        assert own_data.qpos.shape == (7,)
        seen.add((own is model, float(own.geom_margin[0]) > 0, float(own.opt.timestep) < 5e-3))
        own_data.qfrc_applied[0] = 0.1

    mujoco.set_mjcb_control(control)
    try:
        guard, cuts = GuardedStepper(model, data), 0
        for _ in range(10):
            model.body_mass[1] = 0.2  # an edit reaches the callback's model too
            report = guard.step()
            cuts += len(report.cuts)
            assert not report.exhausted
    finally:
        mujoco.set_mjcb_control(None)
    model.body_mass[1] = 0.1
    assert cuts
    assert (True, False, False) in seen
    assert (False, True, True) in seen
    assert content(model) == before
    assert data.qpos[2] > 0
    assert not guard.step().exhausted
