"""Severity of a collision: strata of its peak torque."""

#: Severity strata: intervals [low, high) of the peak ``|tau_ext|`` over joints 1-4 [N m].
STRATA = ((4.0, 8.0), (8.0, 16.0), (16.0, 32.0), (32.0, 64.0), (64.0, 128.0))


def stratum(peak_tau: float) -> str:
    """Name of the severity stratum of ``peak_tau`` [N m]."""
    if peak_tau < STRATA[0][0]:
        return f"0-{STRATA[0][0]:g}"
    for low, high in STRATA:
        if low <= peak_tau < high:
            return f"{low:g}-{high:g}"
    return f"{STRATA[-1][1]:g}-"
