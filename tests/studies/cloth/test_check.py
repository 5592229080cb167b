"""The referees of the cloth study: none certifies wrongly, and each wrong answer is counted."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from studies.cloth import certificate as cloth_certificate
from studies.cloth import check as study
from studies.cloth.adversarial import KINDS
from studies.cloth.certificate import Ball, certify
from studies.cloth.integers import first_contact

batch = (8, 2, 4, 3)
lattice = hnp.arrays(np.float64, batch, elements=st.integers(-2, 2).map(float))
nearly = st.tuples(
    lattice,
    hnp.arrays(np.float64, batch, elements=st.integers(-2, 2).map(float)),
    st.integers(-60, -40),
).map(lambda made: made[0] / 3 + made[1] * 2.0 ** made[2])
apart = hnp.arrays(
    np.float64,
    batch,
    elements=st.tuples(st.integers(-3, 3), st.integers(-400, 300)).map(
        lambda m: m[0] * 2.0 ** m[1]
    ),
)


def assert_certain(x, vertex):
    """What is certified is so; returns the share that is certified."""
    found = certify(x, vertex)
    for i, (start, end) in enumerate(x):
        time = first_contact(start, end, vertex)
        assert not (found.clear[i] and time is not None)
        assert not (found.hit[i] and (time is None or time[0] > found.by[i]))
    return np.mean(found.clear | found.hit)


@pytest.mark.parametrize("vertex", [True, False])
@pytest.mark.parametrize("positions", [lattice, nearly, apart])
def test_nothing_is_certified_wrongly(vertex, positions):
    @settings(deadline=None, max_examples=15)
    @given(positions)
    def check(x):
        assert_certain(x, vertex)

    check()


@pytest.mark.parametrize("vertex", [True, False])
@pytest.mark.parametrize("name", KINDS)
def test_made_to_break_it_and_most_of_the_others_certified(name, vertex):
    x = KINDS[name](np.random.default_rng(3), 100, vertex)
    share = assert_certain(x, vertex)
    if name in {"random", "thin", "offset 1e6", "offset 1e10"}:
        assert share > 0.9


@pytest.mark.parametrize("offset", [0.0, 1e10])
def test_a_gap_or_an_overlap_of_a_few_roundings_is_not_certified_away(offset):
    """The vertex ends this many spacings of the numbers past the face, or short of it."""
    face = np.array([[-1.0, -1, 0], [2, -1, 0], [-1, 2, 0]])
    here = np.array([[0.25, 0.25, 1], *face]) + offset
    for steps in range(-8, 9):
        there = here.copy()
        there[0, 2] = offset - steps * np.spacing(offset + 1.0)
        x = np.stack([here, there])[None]
        found = certify(x, True)
        assert not found.clear[0] if steps >= 0 else not found.hit[0]


def test_a_plane_that_separates_but_for_rounding_is_not_trusted(monkeypatch):
    """A point that is in the plane but for a few roundings, on either side."""
    rng = np.random.default_rng(0)
    normal = rng.normal(size=(2000, 3))
    d = rng.normal(size=(2000, 2, 3, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    depth = np.ones((2000, 2, 3))
    depth[:, :, 0] = 2.0**-53 * rng.choice([-1, 0, 1, 100], size=(2000, 1))
    d -= (np.einsum("nepk,nk->nep", d, normal) - depth)[..., None] * normal[:, None, None]
    monkeypatch.setattr(cloth_certificate, "_normal", lambda points: normal)
    apart = cloth_certificate._separated(d, np.full(2000, 0.25), 0.25)
    assert 0 < apart.sum() < 2000
    for i in np.flatnonzero(apart):
        for t in (Fraction(1, 4), Fraction(1, 2)):
            for start, end in zip(d[i, 0], d[i, 1], strict=True):
                now = [
                    (1 - t) * Fraction(a) + t * Fraction(b) for a, b in zip(start, end, strict=True)
                ]
                assert sum(Fraction(n) * c for n, c in zip(normal[i], now, strict=True)) > 0


numbers = st.floats(-1e3, 1e3).filter(lambda v: v == 0 or abs(v) > 1e-200)
radii = st.floats(0, 1)


@given(numbers, radii, st.floats(-1, 1), numbers, radii, st.floats(-1, 1))
def test_balls_enclose(a, a_radius, a_share, b, b_radius, b_share):
    balls = Ball(np.array(a), np.array(a_radius)), Ball(np.array(b), np.array(b_radius))
    x = Fraction(a) + Fraction(a_radius) * Fraction(a_share)
    y = Fraction(b) + Fraction(b_radius) * Fraction(b_share)
    for result, exact in (
        (balls[0] + balls[1], x + y),
        (balls[0] - balls[1], x - y),
        (balls[0] * balls[1], x * y),
    ):
        assert abs(exact - Fraction(float(result.middle))) <= Fraction(float(result.radius))
        assert int(result.sign()) in {0, (exact > 0) - (exact < 0)}


def test_the_first_time_is_the_closed_form():
    face = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    start, end = np.array([[0.25, 0.25, 1], *face]), np.array([[0.25, 0.25, 0], *face])
    assert first_contact(start, end, True) == (1, 1)
    end[0, 2] = -3
    assert first_contact(start, end, True) == (Fraction(1, 4), Fraction(1, 4))
    # At x = t the face has the height t^2, the vertex 1 - 2 t: sqrt(2) - 1.
    start[0], end[0], end[2] = (0, 0.25, 1), (1, 0.25, -1), (1, 0, 1)
    low, high = first_contact(start, end, True)
    assert (low + 1) ** 2 < 2 < (high + 1) ** 2
    assert high - low == Fraction(1, 2**64)
    edges = np.array([[0.0, 0, 1], [1, 0, 1], [0.25, -1, 0], [0.25, 1, 0]])
    moved = edges.copy()
    moved[2:, 2] = 3.0
    low, high = first_contact(edges, moved, False)
    assert low < Fraction(1, 3) < high
    moved[2:, 0] = 2.0  # 0.25 + 1.75 t is still within the other edge at t = 1/3
    assert first_contact(edges, moved, False) == (low, high)
    moved[2:, 0] = 3.0  # 0.25 + 2.75 t is not
    assert first_contact(edges, moved, False) is None


def test_every_wrong_answer_is_counted():
    rng = np.random.default_rng(0)
    x = rng.normal(size=(900, 2, 4, 3))
    times = [first_contact(*each, False) for each in x]
    toi = np.array([np.inf if time is None else float(time[0]) - 1e-12 for time in times])
    row = study.judged(study.Job(x, False, toi), map)
    hits = np.flatnonzero(np.isfinite(toi))
    assert row["hits"] == len(hits) > 100
    assert row["n"] == 900 == row["clear_certified"] + row["hit_certified"] + row["integers_only"]
    assert row["clear_tight"] in {None, row["clear_certified"]}
    assert [row[key] for key in ("contradictions", "misses", "false_hits", "late")] == [0, 0, 0, 0]
    assert 0.9e-12 < row["early_most"] < 1.1e-12
    assert row["labels_differ"] is None
    labels = np.isfinite(toi)
    labels[:7] = ~labels[:7]
    assert study.judged(study.Job(x, False, toi, labels), map)["labels_differ"] == 7
    toi[hits[:3]] = np.inf
    toi[hits[3:8]] += 2e-12
    toi[np.flatnonzero(np.isinf(toi))[-2:]] = 0.5
    row = study.judged(study.Job(x, False, toi), map)
    assert [row[key] for key in ("misses", "false_hits", "late")] == [3, 2, 5]


def test_a_time_between_the_bounds_is_told_exactly():
    """A root that is no double: its neighbours are early and late, though both are close."""
    start = np.array([[0.25, 0.25, 1], [0, 0, 0], [1, 0, 0], [0, 1, 0]])
    end = start.copy()
    end[0, 2] = -2.0
    third = 1 / 3  # rounded down
    x, toi = np.stack([[start, end]] * 2), np.array([third, np.nextafter(third, 1)])
    assert study.judged(study.Job(x, True, toi), map)["late"] == 1


def test_referees_that_differ_are_counted(monkeypatch):
    x = np.random.default_rng(0).normal(size=(200, 2, 4, 3))
    toi = np.full(200, np.inf)
    sound = study.judged(study.Job(x, True, toi), map)
    assert sound["contradictions"] == 0
    assert sound["misses"] == sound["hits"] > 0
    everything = certify(x, True)._replace(clear=np.ones(200, dtype=bool))
    monkeypatch.setattr(study, "certify", lambda x, vertex: everything)
    monkeypatch.setattr(study, "_tight_inclusion", lambda: None)
    row = study.judged(study.Job(x, True, toi), map)
    assert row["contradictions"] == sound["hits"]
    assert row["clear_tight"] is None


@pytest.mark.data
def test_the_public_queries_have_the_published_labels_and_exact_times(data_dir: Path):
    rows = study.on_labels(data_dir / "ccd", map)
    assert sum(row["n"] for row in rows) == 4_779
    for key in ("contradictions", "labels_differ", "misses", "false_hits", "late"):
        assert sum(row[key] for row in rows) == 0, key
    assert max(row["early_most"] for row in rows) <= 1e-9
