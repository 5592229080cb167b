"""How hard a collision was: strata of the achieved peak torque."""

#: Severity strata by achieved peak ``|tau_ext|`` over joints 1-4 [N m]: [low, high).
STRATA = ((4.0, 8.0), (8.0, 16.0), (16.0, 32.0), (32.0, 64.0), (64.0, 128.0))


def stratum(peak_tau: float) -> str:
    """Name of the severity stratum that ``peak_tau`` [N m] falls into."""
    if peak_tau < STRATA[0][0]:
        return f"0-{STRATA[0][0]:g}"
    for low, high in STRATA:
        if low <= peak_tau < high:
            return f"{low:g}-{high:g}"
    return f"{STRATA[-1][1]:g}-"
