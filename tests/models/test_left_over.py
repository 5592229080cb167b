"""Left-over errors are played where the motion is that of their log."""

import numpy as np
import pytest

from tauguard.models import LeftOver, Sensors

RATE = 100.0


def motion(seconds=20.0, dt=1 / RATE):
    """Two joints, of which the second stands; every fourth second both stand."""
    t = np.arange(0, seconds, dt)
    speed = np.where(t % 4 < 3, 0.8 * np.sin(2 * np.pi * (t % 4) / 3), 0.0)
    return np.stack([speed, 0 * t], axis=1)


@pytest.fixture(scope="module")
def source():
    qd = motion()
    error = np.stack([0.5 * np.tanh(qd[:, 0] / 0.1), np.full(len(qd), 0.2)], axis=1)
    return LeftOver(RATE, np.zeros(len(qd), int), qd, error)


def test_an_error_that_depends_on_the_speed_comes_back(source):
    qd = motion(8.0, dt=1e-3)
    played = source_player(source, 1e-3).next(qd)
    moving = np.abs(qd[:, 0]) > 0.3
    np.testing.assert_allclose(played[moving, 0], 0.5 * np.sign(qd[moving, 0]), atol=0.1)
    np.testing.assert_allclose(played[:, 1], 0.2, atol=1e-9)


def source_player(source, dt, seed=0):
    return Sensors(np.zeros(2), np.zeros(2), left_over=source).player(
        dt, np.random.default_rng(seed)
    )


def test_blocks_of_any_length_give_the_same(source):
    qd = motion(3.0, dt=1e-3)
    whole = source_player(source, 1e-3).next(qd)
    player = source_player(source, 1e-3)
    parts = [player.next(part) for part in np.split(qd, [7, 100, 130, 1777])]
    np.testing.assert_allclose(np.concatenate(parts), whole, atol=1e-12)


def test_a_joint_at_rest_keeps_what_it_holds():
    # Ten stops that hold different torques, one after the other.
    qd = np.tile(np.r_[np.full(100, 0.5), np.zeros(200)], 10)[:, None]
    levels = np.repeat(np.arange(10.0), 300)[:, None]
    source = LeftOver(RATE, np.zeros(len(qd), int), qd, levels)
    player = Sensors(np.zeros(1), np.zeros(1), left_over=source).player(
        1 / RATE, np.random.default_rng(3)
    )
    still = player.next(np.r_[np.full(50, 0.5), np.zeros(3000)][:, None])[150:]
    assert np.ptp(still) < 0.05


def test_a_file_holds_the_same(source, tmp_path):
    source.write(tmp_path / "left.csv")
    again = LeftOver.read(tmp_path / "left.csv")
    assert again.rate == pytest.approx(RATE)
    np.testing.assert_allclose(again.current, source.current, rtol=1e-4)
    (tmp_path / "bad.csv").write_text("log,t,qd1,error1\n0,0,1\n")
    with pytest.raises(ValueError, match=r"bad\.csv.*expected columns log, t, qd1"):
        LeftOver.read(tmp_path / "bad.csv")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"rate": 0.0}, "rate above 0"),
        ({"current": np.full((2000, 2), np.nan)}, "not finite"),
        ({"qd": np.zeros((10, 2))}, "expected shapes"),
    ],
)
def test_bad_values_are_named(source, change, says):
    values = {name: getattr(source, name) for name in ("rate", "log", "qd", "current")}
    with pytest.raises(ValueError, match=says):
        LeftOver(**values | change)


def test_sensors_of_other_joints_are_refused(source):
    with pytest.raises(ValueError, match="of 2 joints, expected 3"):
        Sensors(np.zeros(3), np.zeros(3), left_over=source)


def test_samples_come_at_the_rate_with_jitter():
    t = np.arange(20_000) * 1e-3
    sensors = Sensors(np.zeros(1), np.zeros(1), rate=125.0, jitter=1e-3)
    steps = np.diff(t[sensors.samples(t, np.random.default_rng(0))])
    assert np.median(steps) == pytest.approx(8e-3)
    assert np.std(steps) == pytest.approx(np.sqrt(2) * 1e-3, rel=0.1)
    assert len(Sensors(np.zeros(1), np.zeros(1)).samples(t, np.random.default_rng(0))) == len(t)


def test_a_joint_that_stops_holds_what_stops_of_that_direction_hold():
    # Stops after motion in turn in either direction; what is held has the motion's sign.
    turns = [np.r_[np.full(100, 0.5 * sign), np.zeros(200)] for sign in (1, -1) * 5]
    qd = np.concatenate(turns)[:, None]
    held = np.repeat((1.0, -1.0) * 5, 300)[:, None]
    source = LeftOver(RATE, np.zeros(len(qd), int), qd, held)
    for seed in range(4):
        player = Sensors(np.zeros(1), np.zeros(1), left_over=source).player(
            1 / RATE, np.random.default_rng(seed)
        )
        for sign in (1, -1):
            played = player.next(np.r_[np.full(100, 0.5 * sign), np.zeros(150)][:, None])
            np.testing.assert_allclose(played[120:], sign, atol=0.05)
