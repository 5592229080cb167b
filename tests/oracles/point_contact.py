"""When do a moving point and edge, or two points, first touch? Decided in rational arithmetic."""

from __future__ import annotations

from fractions import Fraction
from math import inf, isqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

Positions = NDArray[np.float64]
Line = tuple[Fraction, Fraction]
Quadratic = tuple[Any, ...]

BITS = 400  # roots are bracketed to 2^-400, far closer than those of small integers can lie


def moving(x0: Positions, x1: Positions, i: int, j: int) -> list[Line]:
    """Vertex i as seen from vertex j: coefficients (start, rate) of each coordinate."""
    at = [[Fraction(float(x[i][k])) - Fraction(float(x[j][k])) for k in range(3)] for x in (x0, x1)]
    return [(a, b - a) for a, b in zip(*at, strict=True)]


def product(a: Line, b: Line) -> Quadratic:
    """Of two linear functions."""
    return (a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[1] * b[1])


def value(p: Quadratic, t: Fraction) -> Fraction:
    """The polynomial p at t."""
    return sum((c * t**k for k, c in enumerate(p)), Fraction(0))


def roots(p: Quadratic) -> list[Fraction]:
    """Of a quadratic that is not zero, in [0, 1], ascending, to BITS bits."""
    c, b, a = p
    if a == 0:
        found = [] if b == 0 else [-c / b]
    else:
        d = b * b - 4 * a * c
        if d < 0:
            return []
        root = Fraction(isqrt((d.numerator << 2 * BITS) // d.denominator), 1 << BITS)
        found = [(-b - root) / (2 * a), (-b + root) / (2 * a)]
    return sorted(t for t in found if 0 <= t <= 1)


def zero(p: Quadratic, t: Fraction) -> bool:
    """Is p(t) zero, t being a root to BITS bits?"""
    size = max(abs(c) for c in p) or 1
    return bool(abs(value(p, t)) < size * Fraction(1, 1 << BITS // 4))


def point_point_time(x0: Positions, x1: Positions) -> float:
    """When two points first meet, positions of shape (2, 3); inf where they do not."""
    seen = moving(x0, x1, 0, 1)
    rates = [(a, r) for a, r in seen if a != 0 or r != 0]
    if not rates:
        return 0.0
    a, r = rates[0]
    if r == 0 or not 0 <= -a / r <= 1:
        return inf
    return float(-a / r) if all(p + q * (-a / r) == 0 for p, q in seen) else inf


def point_edge_time(x0: Positions, x1: Positions) -> float:
    """When a point first meets an edge, positions of shape (3, 3); inf where it does not."""
    a, b = moving(x0, x1, 1, 0), moving(x0, x1, 2, 0)
    sides = []
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        left, right = product(a[i], b[j]), product(a[j], b[i])
        sides.append(tuple(p - q for p, q in zip(left, right, strict=True)))
    dot: Quadratic = tuple(
        sum(c) for c in zip(*(product(a[k], b[k]) for k in range(3)), strict=True)
    )
    turning = [s for s in sides if any(s)]
    if not turning:  # on one line throughout
        if dot[0] <= 0:
            return 0.0
        return min((float(t) for t in roots(dot)), default=inf) if any(dot) else 0.0
    for t in roots(turning[0]):
        if all(zero(s, t) for s in turning) and (value(dot, t) <= 0 or zero(dot, t)):
            return float(t)
    return inf
