"""Format numbers for sentences: two digits and no exponent."""


def two_digits(value: float) -> str:
    """Two significant digits, four decimals at most: ``120``, ``4.9``, ``0.03``."""
    import numpy as np

    return np.format_float_positional(
        round(value, 4), precision=2, unique=False, fractional=False, trim="-"
    )
