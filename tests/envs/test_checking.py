"""Checkers as an option of an episode: their contacts in the trace, the file and the replay."""

import dataclasses

import mujoco
import numpy as np
import pytest

from tauguard.contacts import Contacts, State, check_states, checker
from tauguard.contacts.scenes import arm_boxes
from tauguard.envs import CollisionPlan, Episode, simulate
from tauguard.replay import write_rrd
from tauguard.replay.story import cut, page
from tauguard.traces import CheckedContacts, read_mcap, write_mcap

EPISODE = Episode(
    seed=4,
    seconds=3,
    collisions=(
        CollisionPlan("strike", time=1.2, link=3),
        CollisionPlan("clamp", time=2.2, link=4),
    ),
)


@pytest.fixture(scope="module")
def trace():
    return simulate(EPISODE, checkers=["rigid"])


def test_the_checker_sees_every_blow_and_nothing_else(trace):
    (seen,) = trace.contacts
    assert seen.checker == "rigid"
    assert set(seen.partners) <= {*(f"link{i}" for i in range(1, 7)), "striker", "clamp"}
    assert len(trace.truth.collisions) >= 1
    for collision in trace.truth.collisions:
        during = seen.between(collision.onset - 2 * trace.dt, collision.end + 2 * trace.dt)
        assert abs(during.t[0] - collision.onset) <= 2 * trace.dt
        names = {seen.partners[i] for i in during.pair.ravel()}
        assert names == {f"link{collision.link}", collision.kind.replace("strike", "striker")}
    touching = trace.truth.contact_force > 0
    near = np.interp(seen.t, trace.t, np.convolve(touching, np.ones(5), "same"))
    assert (near > 0).mean() > 0.95


def test_the_rest_of_the_trace_does_not_change(trace):
    plain = simulate(EPISODE)
    assert plain.contacts == ()
    for name in ("t", "q", "qd", "current"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(trace, name))
    np.testing.assert_array_equal(plain.truth.tau_ext, trace.truth.tau_ext)


def test_an_unknown_checker_is_named_before_anything_runs():
    with pytest.raises(ValueError, match=r"checker 'rigit': expected one of .*rigid"):
        simulate(Episode(seed=1, seconds=3600), checkers=["rigit"])


def test_the_file_gives_back_every_bit_and_notices_what_is_missing(trace, tmp_path):
    write_mcap(tmp_path / "a.mcap", trace)
    (back,) = read_mcap(tmp_path / "a.mcap").contacts
    (seen,) = trace.contacts
    for field in dataclasses.fields(CheckedContacts):
        a, b = getattr(seen, field.name), getattr(back, field.name)
        if isinstance(a, np.ndarray):
            assert a.tobytes() == b.tobytes()
            assert a.dtype == b.dtype
        else:
            assert a == b


def test_other_readers_decode_the_contacts(trace, tmp_path):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    write_mcap(tmp_path / "a.mcap", trace)
    (seen,) = trace.contacts
    with open(tmp_path / "a.mcap", "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        found = [m[3] for m in reader.iter_decoded_messages(topics=["/contacts/rigid"])]
    assert len(found) == len(seen)
    first, k = found[0], 0
    assert first.partners[first.first] == seen.partners[seen.pair[k, 0]]
    assert first.partners[first.second] == seen.partners[seen.pair[k, 1]]
    assert (first.time, first.distance) == (seen.t[k], seen.distance[k])
    assert (first.point.x, first.normal.z) == (seen.point[k, 0], seen.normal[k, 2])


def test_a_trace_without_checkers_is_the_file_it_was(trace, tmp_path):
    write_mcap(tmp_path / "a.mcap", dataclasses.replace(trace, contacts=()))
    assert b"/contacts" not in (tmp_path / "a.mcap").read_bytes()
    assert read_mcap(tmp_path / "a.mcap").contacts == ()


def test_the_replay_shows_them(trace, tmp_path):
    from rerun.chunk import RrdReader

    write_rrd(tmp_path / "a.rrd", trace)
    dots = 0
    for chunk in RrdReader(str(tmp_path / "a.rrd")).stream():
        batch = chunk.to_record_batch()
        if str(chunk.entity_path).endswith("checked/rigid/point"):
            for name in batch.schema.names:
                if name.endswith("positions"):
                    dots += sum(len(row or ()) for row in batch.column(name).to_pylist())
    assert dots == len(trace.contacts[0])
    assert "a contact that a checker reported (rigid)" in page(trace, None)
    later, _ = cut(trace, None, 2.0)
    assert (later.contacts[0].t >= 2.0).all()


class Late:
    """Reports one contact in the middle of every step, between whatever comes first."""

    name, covers = "late", frozenset()

    def check(self, before, after):
        return Contacts([0.5], [[2, 1]], [[-1, -1]], [[-1, -1]], [[0, 0, 0]], [[0, 0, 1]], [0.0])


def test_no_step_is_judged_across_a_gap():
    scene = arm_boxes()
    model, data = scene.start(1e-3)
    states = []
    for _ in range(4):
        states.append(State.of(model, data))
        mujoco.mj_step(model, data)
    late, rigid = check_states(
        model, [*states[:2], None, *states[2:]], [Late(), checker("rigid", model)]
    )
    np.testing.assert_allclose(late.t, [0.5e-3, 2.5e-3])
    assert len(rigid) == 0
    assert rigid.partners == ()


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("t", np.array([1.0, 0.5]), "t: decreasing at row 1"),
        ("pair", np.array([[0, 1], [0, 2]]), r"pair: row 1 is \[0, 2\], but there are 2"),
        ("point", np.zeros((2, 2)), "point: shape"),
        ("distance", np.zeros(3), "distance: shape"),
    ],
)
def test_bad_contacts_are_named(field, value, message):
    good = {
        "checker": "x",
        "partners": ("a", "b"),
        "t": np.array([0.0, 1.0]),
        "pair": np.array([[0, 1], [1, 0]]),
        "point": np.zeros((2, 3)),
        "normal": np.zeros((2, 3)),
        "distance": np.zeros(2),
    }
    assert len(CheckedContacts(**good)) == 2
    with pytest.raises(ValueError, match=message):
        CheckedContacts(**(good | {field: value}))
