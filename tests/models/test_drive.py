"""Drives: what is refused, and what the sensors do to a signal."""

from dataclasses import replace

import numpy as np
import pytest

from tauguard.models import Drive, Ripple, Sensors, cura6_drive

SIX = np.ones(6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gear": np.ones(2)}, r"Drive.gear: shape \(2,\), expected \(6,\): one per joint"),
        ({"gain": np.zeros(6)}, "expected N m/A other than 0"),
        ({"gain": np.full(6, np.nan)}, "expected N m/A other than 0"),
        ({"current_limit": -SIX}, "Drive.current_limit .*: expected above 0"),
        ({"electrical_time_constant": 0.0}, "expected seconds above 0, or None"),
        ({"sensors": Sensors(np.ones(2), np.ones(2))}, "Drive.sensors: of 2 joints, expected 6"),
        (
            {"ripple": Ripple(np.ones(1), np.ones((7, 1)), np.ones((7, 1)))},
            "Drive.ripple: of 7 joints, expected 6",
        ),
    ],
)
def test_bad_drives_are_named(change, message):
    with pytest.raises(ValueError, match=message):
        replace(cura6_drive(), **change)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"static": 0 * SIX}, "static: expected above 0"),
        ({"bristle_stiffness": 0 * SIX}, "Friction.bristle_stiffness .* expected above 0"),
        ({"viscous": -SIX}, "Friction.viscous .* expected 0 or more"),
        ({"load": np.full(6, np.nan)}, "Friction.load .* expected 0 or more"),
        ({"temperature": 200.0}, "friction would be negative for viscous_per_kelvin"),
    ],
)
def test_bad_friction_is_named(change, message):
    friction = cura6_drive().friction
    assert friction is not None
    with pytest.raises(ValueError, match=message):
        replace(friction, **change)


def test_bad_ripple_and_sensors_are_named():
    with pytest.raises(ValueError, match=r"Ripple.amplitude: shape \(6, 1\), expected \(6, 2\)"):
        Ripple(np.ones(2), np.ones((6, 1)), np.ones((6, 2)))
    with pytest.raises(ValueError, match=r"Sensors.current_noise .* expected 0 or more"):
        Sensors(-SIX, SIX)
    sensors = Sensors(SIX, SIX)
    with pytest.raises(ValueError, match=r"expected \(T, 6\) each"):
        sensors.measure(np.random.default_rng(0), *np.zeros((3, 10, 5)))


def test_noise_has_its_size_and_quanta_are_the_grid():
    """Standard deviation of noise and rounding together: sqrt(s^2 + quantum^2 / 12)."""
    sensors = Sensors(
        np.linspace(0.01, 0.06, 6), np.full(6, 0.02), 1e-4, velocity_noise=1e-3, velocity_quantum=0
    )
    rng = np.random.default_rng(5)
    true = np.broadcast_to(0.37, (20_000, 6))
    q, qd, current = sensors.measure(rng, true, true, true)
    spread = np.sqrt(sensors.current_noise**2 + 0.02**2 / 12)
    np.testing.assert_allclose(current.std(axis=0)[1:], spread[1:], rtol=0.05)
    np.testing.assert_allclose(qd.std(axis=0), 1e-3, rtol=0.05)
    np.testing.assert_allclose(current / 0.02, np.round(current / 0.02), atol=1e-9)
    np.testing.assert_allclose(q, 0.37, atol=1e-12)


def test_perfect_sensors_change_nothing():
    sensors = Sensors(0 * SIX, 0 * SIX, 0.0, 0.0)
    signals = np.random.default_rng(2).normal(size=(3, 50, 6))
    for measured, true in zip(
        sensors.measure(np.random.default_rng(0), *signals), signals, strict=True
    ):
        np.testing.assert_array_equal(measured, true)


def test_an_ideal_drive_has_the_limits_it_is_given():
    drive = Drive.ideal(np.array([5.0, np.inf]))
    np.testing.assert_allclose(drive.torque_limit, [5, np.inf])
    assert (drive.friction, drive.ripple, drive.sensors) == (None, None, None)


def test_parts_are_left_out_by_name():
    drive = cura6_drive()
    poorer = drive.without("stribeck", "load", "ripple", "sensors", "lag")
    assert (poorer.friction.static == drive.friction.coulomb).all()
    assert not poorer.friction.load.any()
    assert (poorer.friction.viscous == drive.friction.viscous).all()
    assert poorer.ripple is poorer.sensors is poorer.electrical_time_constant is None
    assert drive.without("friction").friction is None
    warm = replace(drive, friction=replace(drive.friction, temperature=60.0))
    assert warm.without("warmth").friction.temperature == warm.friction.reference_temperature
    with pytest.raises(ValueError, match="'gears': expected one of friction"):
        drive.without("gears")
