"""Episodes: the same bytes from the same seed, and truth that agrees with MuJoCo's own forces."""

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.cli.simulate import described
from tauguard.datasets import write_dataset
from tauguard.envs import CollisionPlan, Episode, PayloadPick, Simulation, simulate
from tauguard.envs.episodes import labels
from tauguard.envs.episodes.injection import Aim
from tauguard.envs.episodes.poses import Poses
from tauguard.models import Mismatch, SceneSpec, compose, cura6
from tauguard.traces import STRATA, read_mcap

KINDS = ("strike", "pulse", "clamp")


def plans(links=(3, 4, 5), severity=(16.0, 32.0)):
    return tuple(
        CollisionPlan(kind, 1.5 + 2.5 * i, links[i % len(links)], severity, duration=0.3)
        for i, kind in enumerate(KINDS)
    )


@pytest.fixture(scope="module")
def episode():
    return Episode(seed=11, seconds=9.0, speed=30.0, collisions=plans(), mismatch=Mismatch(seed=3))


@pytest.fixture(scope="module")
def trace(episode):
    return simulate(episode)


def test_same_seed_same_bytes(episode, trace):
    again = simulate(Episode.from_json(episode.to_json()))
    for name in ("t", "q", "qd", "current"):
        np.testing.assert_array_equal(getattr(trace, name), getattr(again, name))
    np.testing.assert_array_equal(trace.truth.tau_ext, again.truth.tau_ext)
    assert trace.meta == again.meta
    other = simulate(replace(episode, seed=12))
    assert not np.array_equal(trace.q, other.q)


def test_every_kind_is_carried_out_in_its_stratum(trace):
    assert [c.kind for c in trace.truth.collisions] == list(KINDS)
    for c in trace.truth.collisions:
        assert 16 <= c.peak_tau < 32
        assert c.end > c.onset
        rows = (trace.t >= c.onset) & (trace.t <= c.end)
        peak = np.abs(trace.truth.tau_ext[rows, :4]).max()
        assert peak == pytest.approx(c.peak_tau)


def test_truth_is_zero_away_from_collisions(trace):
    free = np.ones(len(trace.t), dtype=bool)
    for c in trace.truth.collisions:
        free &= (trace.t < c.onset) | (trace.t > c.end)
    assert (trace.truth.tau_ext[free] == 0).all()
    assert (trace.truth.contact_force[free] == 0).all()


def test_contact_truth_equals_mujocos_constraint_torque():
    """With nothing but one obstacle touching, J^T F is qfrc_constraint at the arm's joints."""
    episode = Episode(seed=2, seconds=4.0, collisions=(CollisionPlan("strike", 1.5, 4),))
    run = Simulation(episode)
    steps = []
    original = run.striking._attempt

    def spy(plan, target, strength, begin, end):
        window = original(plan, target, strength, begin, end)
        if window is not None and not steps:
            loop = run.striking.loop
            after = loop.save()
            loop.take(run.loop)
            run.striking._launch(target, strength)
            for k in range(begin, end):
                run.striking._struck(k, k + 1)
                steps.append(loop.data.qfrc_constraint[run.scene.dof_adr].copy())
            loop.restore(after)
        return window

    run.striking._attempt = spy
    trace = run.run()
    window = run._windows[0]
    rows = slice(window.begin, window.begin + len(window.rollout.q))
    constraint = np.array(steps)
    assert np.abs(constraint).max() > 1.0
    np.testing.assert_allclose(trace.truth.tau_ext[rows], constraint, atol=1e-9)


def test_an_arm_apart_from_its_obstacles_moves_as_in_the_whole_scene(episode, trace):
    whole = Simulation(episode)
    assert whole.loop.model.nv < whole.striking.loop.model.nv
    whole.loop, whole._follow = whole.striking.loop, whole.striking._struck
    whole.striking._loop, whole.striking._follow = whole.loop, whole._follow
    found = whole.run()
    assert {c.kind for c in found.truth.collisions} == set(KINDS)
    for one, other in ((trace, found), (trace.truth, found.truth)):
        for name, values in vars(one).items():
            if isinstance(values, np.ndarray):
                assert np.array_equal(values, vars(other)[name], equal_nan=True), name


@pytest.fixture
def slabs(tmp_path):
    """An arm of flat boxes: points drawn at 0.8 of ``size[1]`` along z lie outside of them."""
    shape = 'class="collision" type="box" size="0.05 0.3 0.04"'
    text = re.sub(
        r'class="collision" type="\w+" fromto="[^"]*" size="[^"]*"', shape, cura6.arm_xml()
    )
    (tmp_path / "slabs.xml").write_text(text)
    return str(tmp_path / "slabs.xml")


@pytest.mark.parametrize("arm", ["cura6", "ur5e", "slabs"])
def test_bounds_of_a_clamps_travel_exclude_no_target(arm, monkeypatch, request):
    if arm == "slabs":
        arm = request.getfixturevalue("slabs")
    aims = [Simulation(Episode(seed, 30.0, 60.0, arm=arm)).striking._aim for seed in range(7, 10)]
    plans = [CollisionPlan("clamp", 0.5, link, duration=0.6) for link in range(2, 6)]
    cases = [(n, plan) for n in range(len(aims)) for plan in plans]
    casts = []
    cast = Aim._cast
    monkeypatch.setattr(Aim, "_cast", lambda *a: casts.append(1) or cast(*a))

    def targets():
        casts.clear()
        draws = [np.random.default_rng([4, n]) for n, _ in cases]
        found = [
            aims[n].find(plan, rng, 29000) for (n, plan), rng in zip(cases, draws, strict=True)
        ]
        rows = [None if one is None else (one.row, *one.point, *one.direction) for one in found]
        return rows, [rng.random() for rng in draws], len(casts)

    bounded = targets()
    monkeypatch.setattr(Aim, "_may_stop_soon", lambda self, plan, path, rows, rng: True)
    cast_all = targets()
    assert bounded[:2] == cast_all[:2]
    assert any(row is not None for row in bounded[0])
    assert bounded[2] < cast_all[2]


def test_pulse_truth_is_the_applied_generalised_force():
    episode = Episode(seed=5, seconds=4.0, collisions=(CollisionPlan("pulse", 1.5, 5),))
    run = Simulation(episode)
    trace = run.run()
    window = run._windows[0]
    model, data = run.scene.model, mujoco.MjData(run.scene.model)
    body = int(run.scene.link_bodies[4])
    k = int(np.argmax(np.linalg.norm(window.wrenches.force[:, 4], axis=1)))
    data.qpos[run.scene.qpos_adr] = window.rollout.q[k]
    mujoco.mj_forward(model, data)
    force, point = window.wrenches.force[k, 4], window.wrenches.point[k, 4]
    assert not window.wrenches.torque.any()
    assert np.linalg.norm(point - data.xipos[body]) < 0.2
    expected = np.zeros(model.nv)
    mujoco.mj_applyFT(model, data, force, np.zeros(3), point, body, expected)
    got = trace.truth.tau_ext[window.begin + k]
    np.testing.assert_allclose(got, expected[run.scene.dof_adr], atol=1e-12)


def test_planned_collisions_that_did_not_come_about_say_why(tmp_path, capsys):
    plans = (
        CollisionPlan("strike", 1.0, 4),
        CollisionPlan("strike", 1.1, 3),
        CollisionPlan("clamp", 3.5, 3, severity=(500.0, 600.0)),
    )
    episode = Episode(seed=1, seconds=4.0, collisions=plans)
    (path,) = write_dataset([episode], tmp_path, workers=1)
    assert len(read_mcap(path).truth.collisions) == 1
    row = described(path, episode)
    assert (row["planned"], row["collisions"]) == (3, 1)
    first, second = row["missed"]
    assert first.startswith("strike on link 4 at 1 s: no time is left before the next collision")
    assert second.startswith("clamp on link 3 at 3.5 s: no")
    out = capsys.readouterr().out
    assert "1 of 3 planned collisions" in out
    assert first in out


def test_a_payload_is_not_a_collision():
    episode = Episode(seed=6, seconds=4.0, picks=(PayloadPick(2.0, 4039.0),))
    trace = simulate(episode)
    assert trace.truth.collisions == ()
    assert (trace.truth.payload[:2000] == 0).all()
    assert (trace.truth.payload[2000:] == 4.039).all()
    without = simulate(replace(episode, picks=()))
    np.testing.assert_allclose(trace.q[:2000], without.q[:2000], atol=1e-5)
    shift = np.abs(trace.current[2500:] - without.current[2500:]).mean(axis=0)
    assert shift[1] > 0.5


def test_what_is_left_out_is_not_compiled():
    run = Simulation(Episode(seed=1, seconds=1.0))
    names = {run.scene.model.body(i).name for i in range(run.scene.model.nbody)}
    assert not names & {"striker", "clamp", "payload"}
    assert run.scene.model.nsensor == 0


def test_labels_merge_gaps_below_half_a_second():
    t = np.arange(3000) * 1e-3
    wrenches = labels.Wrenches.empty(3000, 6)
    wrenches.force[100:150, 2] = [10, 0, 0]
    wrenches.force[600:650, 2] = [20, 0, 0]
    wrenches.force[1200:1210, 4] = [5, 0, 0]
    found = labels.collisions(t, wrenches, np.zeros((3000, 6)), [(0.05, "pulse"), (1.1, "clamp")])
    assert [(c.onset, c.link, c.kind) for c in found] == [(0.1, 3, "pulse"), (1.2, 5, "clamp")]
    assert found[0].end == pytest.approx(0.649)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"speed": 0}, "above 1 and at most 100"),
        ({"speed": 0.3}, "for 30 percent say 30"),
        ({"seconds": -1}, "more than 0"),
        ({"payload_g": -5}, "0 or more grams"),
        ({"picks": (PayloadPick(99.0, 1.0),)}, "outside the episode"),
    ],
)
def test_bad_episodes_are_named(change, message):
    with pytest.raises(ValueError, match=message):
        Episode(seed=0, **change)


def test_bad_plans_and_keys_are_named():
    with pytest.raises(ValueError, match="strike, clamp, pulse"):
        CollisionPlan("shove", 1.0, 2)
    with pytest.raises(ValueError, match="counted from 1"):
        CollisionPlan("pulse", 1.0, 0)
    with pytest.raises(ValueError, match=r"unknown keys \['sped'\]"):
        Episode.from_json('{"seed": 1, "sped": 3}')
    assert STRATA[0] == (4.0, 8.0)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_external_torque_is_that_of_mujocos_jacobians(seed):
    rng = np.random.default_rng(seed)
    scene = compose(SceneSpec(arm=rng.choice(["cura6", "cura6-long"])), visuals=False)
    q = rng.uniform(-2, 2, (3, 6))
    wrenches = labels.Wrenches(*(rng.normal(size=(3, 6, 3)) for _ in range(3)))
    wrenches.force[1] = wrenches.torque[1] = 0
    wrenches.force[2, 3] = wrenches.torque[2, 3] = 0
    found = labels.external_torque(Poses(scene), q, wrenches)
    data, wanted = mujoco.MjData(scene.model), np.zeros((3, 6))
    linear, angular = np.zeros((2, 3, scene.model.nv))
    for row in range(3):
        data.qpos[scene.qpos_adr] = q[row]
        mujoco.mj_kinematics(scene.model, data)
        mujoco.mj_comPos(scene.model, data)
        for link, body in enumerate(scene.link_bodies):
            point = wrenches.point[row, link]
            mujoco.mj_jac(scene.model, data, linear, angular, point, int(body))
            wanted[row] += (
                linear.T @ wrenches.force[row, link] + angular.T @ wrenches.torque[row, link]
            )[scene.dof_adr]
    np.testing.assert_allclose(found, wanted, atol=1e-12)


def test_mujoco_keeps_its_clock_after_a_run_without_it():
    run = Simulation(Episode(seed=1, seconds=0.5))
    run.run()
    assert run.loop.data.timer[0].duration == 0
    mujoco.mj_step(run.loop.model, run.loop.data)
    assert run.loop.data.timer[0].duration > 0


def test_drives_without_losses_part_by_part_are_ideal_drives():
    episode = Episode(seed=4, seconds=0.3, speed=40.0)
    parts = ("friction", "ripple", "lag", "sensors")
    one, other = simulate(episode, without=parts), simulate(replace(episode, ideal_drive=True))
    for name in ("q", "qd", "current"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert one.meta["without"] == "friction,ripple,lag,sensors"
    assert "without" not in other.meta
    quiet = simulate(episode, without=("sensors",))
    assert 0 < np.abs(quiet.q - simulate(episode).q).max() <= 1e-6  # half a quantum
