"""When do a moving vertex and face, or two edges, first touch? Decided in exact integers.

Slow, and written without the package's code. Positions become integers by a power of two. The
roots of the coplanarity cubic are isolated by Descartes' rule in Bernstein form and halving
(Vincent; Collins & Akritas 1976). Signs at a root are found by further halving, and by a greatest
common divisor where they are zero. Where all four points share a plane throughout, contact begins
where a corner passes a line through two others.

Polynomials are lists of integers, ascending, without leading zeros.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import cache
from math import comb, gcd, lcm
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Polynomial = list[int]
Vector = list[Polynomial]

#: Default number of halvings of [0, 1] after which the search ends.
HALVINGS = 64


def first_contact(
    x_t0: Any, x_t1: Any, vertex: bool, halvings: int = HALVINGS
) -> tuple[Fraction, Fraction] | None:
    """Lower and upper bound on the first time of contact; equal where the time is found exactly.

    Args:
        x_t0: Positions (4, 3) at the start of the step; rows as in ``tauguard.cloth``. Finite.
        x_t1: The same at its end.
        vertex: Vertex against face, else edge against edge.
        halvings: The bounds are at most 2^-halvings apart.

    Returns:
        ``None`` where the features stay apart.
    """
    x = _moving(x_t0, x_t1)
    p, q, r = (
        (_difference(x, 0, 1), _difference(x, 2, 1), _difference(x, 3, 1))
        if vertex
        else (_difference(x, 2, 0), _difference(x, 1, 0), _difference(x, 3, 2))
    )
    volume = _dot(p, _cross(q, r))
    times = list(_roots(volume)) if volume else list(_events(x, vertex))
    best: Root | None = None
    for root in sorted(times, key=lambda root: (root.low, root.high)):
        if best is not None and root.low >= best.high:
            break
        if _touches(root, p, q, r, vertex):
            root.refine(halvings)
            best = root if best is None else min(best, root, key=lambda root: root.low)
    return None if best is None else (best.low, best.high)


class Verdict(NamedTuple):
    """Errors of given times of impact."""

    hit: NDArray[np.bool_]  #: whether each query has a contact, shape (N,)
    misses: int
    false_hits: int
    late: int  #: times after the first contact
    early_most: float  #: largest error of a time that is not late, as a fraction of the step


def judge(x: NDArray[np.float64], vertex: bool, toi: NDArray[np.float64]) -> Verdict:
    """Compare times of impact with the exact ones.

    Args:
        x: Positions (N, 2, 4, 3) at both ends of the step.
        vertex: Vertex against face, else edge against edge.
        toi: Times (N,) in [0, 1] to judge; inf where no contact was reported.
    """
    times = [first_contact(start, end, vertex) for start, end in x]
    hit = np.array([time is not None for time in times], dtype=bool)
    reported = np.isfinite(toi)
    early = [
        _earliness(x[i], vertex, float(toi[i]), time)
        for i, time in enumerate(times)
        if time is not None and reported[i]
    ]
    return Verdict(
        hit,
        misses=int((hit & ~reported).sum()),
        false_hits=int((reported & ~hit).sum()),
        late=sum(error < 0 for error in early),
        early_most=float(max(early, default=0)),
    )


def _earliness(
    x: NDArray[np.float64], vertex: bool, toi: float, bounds: tuple[Fraction, Fraction]
) -> Fraction:
    """Exact first time minus ``toi``; below 0 where ``toi`` is late."""
    reported, halvings = Fraction(toi), HALVINGS
    low, high = bounds
    while low < reported <= high and low < high:
        halvings *= 2
        closer = first_contact(x[0], x[1], vertex, halvings)
        assert closer is not None
        low, high = closer
    return low - reported if reported <= low else high - reported


def _moving(x_t0: Any, x_t1: Any) -> list[Vector]:
    cells = [float(c).as_integer_ratio() for x in (x_t0, x_t1) for row in x for c in row]
    scale = max(d for _, d in cells)
    whole = [n * (scale // d) for n, d in cells]
    pairs = list(zip(whole[:12], whole[12:], strict=True))
    return [[_trim([a, b - a]) for a, b in pairs[3 * i : 3 * i + 3]] for i in range(4)]


def _difference(x: list[Vector], i: int, j: int) -> Vector:
    return [_sub(a, b) for a, b in zip(x[i], x[j], strict=True)]


def _events(x: list[Vector], vertex: bool) -> Iterator[Root]:
    """Times at which contact may begin if all four points stay in one plane.

    The differences of the two features' points fill the hull of ``corners``. Contact begins when
    the origin enters this hull through a side or, if the hull is a line, through a corner.
    """
    yield Root(0, 0, None)
    corners = [(0, 1), (0, 2), (0, 3)] if vertex else [(2, 0), (3, 0), (3, 1), (2, 1)]
    differences = [_difference(x, i, j) for i, j in corners]
    last, following = differences[-1:] + differences, differences[1:] + differences[:1]
    for before, here, after in zip(last, differences, following, strict=False):
        behind, ahead = ([c for c in _cross(here, other) if c] for other in (before, after))
        along = [] if behind or ahead else [c for c in here if c]
        for polynomial in ahead[:1] or along[:1]:
            yield from _roots(polynomial)


def _touches(root: Root, p: Vector, q: Vector, r: Vector, vertex: bool) -> bool:
    """Whether the features touch at a time of coplanarity.

    Barycentric weights decide, or, if the plane is undefined, pairs of collinear points.
    """
    n = _cross(q, r)
    whole = _dot(n, n)
    if root.sign(whole) != 0:
        a = _dot(_cross(p, r), n)
        b = _dot(_cross(q, p) if vertex else _cross(p, q), n)
        rest = [_sub(whole, _add(a, b))] if vertex else [_sub(whole, a), _sub(whole, b)]
        return all(root.sign(weight) >= 0 for weight in (a, b, *rest))
    minus = [_sub(a, b) for a, b in zip(p, q, strict=True)]
    other = [_sub(a, b) for a, b in zip(p, r, strict=True)]
    if vertex:
        pairs = [(p, minus), (p, other), (minus, other)]
    else:
        plus = [_add(a, b) for a, b in zip(p, r, strict=True)]
        both = [_sub(a, b) for a, b in zip(plus, q, strict=True)]
        pairs = list(itertools.combinations_with_replacement([p, plus, minus, both], 2))
    return any(
        all(root.sign(c) == 0 for c in _cross(a, b)) and root.sign(_dot(a, b)) <= 0
        for a, b in pairs
    )


class Root:
    """A time in [0, 1]: exactly m / 2^k, or the only root of ``polynomial`` in ((m, m + 1) / 2^k).

    ``coefficients`` are the Bernstein coefficients of ``polynomial`` on that interval. The
    polynomial has no double roots. Both are ``None`` for a time that is known exactly.
    """

    def __init__(
        self, k: int, m: int, coefficients: list[int] | None, polynomial: Polynomial | None = None
    ) -> None:
        """Keep the interval and the polynomial."""
        self.k, self.m, self._coefficients, self._polynomial = k, m, coefficients, polynomial

    @property
    def low(self) -> Fraction:
        """The lower bound."""
        return Fraction(self.m, 1 << self.k)

    @property
    def high(self) -> Fraction:
        """The upper bound, that itself where the time is known."""
        return Fraction(self.m + (self._coefficients is not None), 1 << self.k)

    def refine(self, k: int) -> None:
        """Halve until the bounds are 2^-k apart, or one."""
        while self._coefficients is not None and self.k < k:
            self._halve()

    def sign(self, g: Polynomial) -> int:
        """The sign that ``g`` has at this time."""
        if not g:
            return 0
        tried, coefficients = 0, _bernstein(g, self.k, self.m)
        while self._coefficients is not None:
            if min(coefficients) > 0 or max(coefficients) < 0:
                return _sign(coefficients[0])
            if tried == 6 and self._shares(g):
                return 0
            side = self._halve()
            coefficients = _halves(coefficients)[max(side, 0)]
            tried += 1
        # At an exactly known time the first coefficient is g's value, up to a positive factor.
        return _sign(_bernstein(g, self.k, self.m)[0])

    def _halve(self) -> int:
        """Take the half with the root: 0 or 1; the middle itself: -1."""
        assert self._coefficients is not None
        halves = _halves(self._coefficients)
        middle = halves[1][0]
        self.k += 1
        if middle == 0:
            self.m, self._coefficients = 2 * self.m + 1, None
            return -1
        side = int(_sign(self._coefficients[0]) == _sign(middle))
        self.m, self._coefficients = 2 * self.m + side, halves[side]
        return side

    def _shares(self, g: Polynomial) -> bool:
        assert self._polynomial is not None
        coefficients = _bernstein(_common(self._polynomial, g), self.k, self.m)
        return _sign(coefficients[0]) * _sign(coefficients[-1]) < 0


def _roots(p: Polynomial) -> Iterator[Root]:
    """Every root in [0, 1], once."""
    p = _primitive(p)
    if len(p) > 2:
        p = _divide(p, _common(p, [i * c for i, c in enumerate(p)][1:]))[0]
    whole = _bernstein(p, 0, 0)
    yield from (Root(0, end, None) for end in (0, 1) if whole[-end] == 0)
    todo = [(0, 0, whole)]
    while todo:
        k, m, coefficients = todo.pop()
        signs = [c > 0 for c in coefficients if c]
        changes = sum(a != b for a, b in itertools.pairwise(signs))
        if changes == 1 and coefficients[0] and coefficients[-1]:
            yield Root(k, m, coefficients, p)
        elif changes:
            left, right = _halves(coefficients)
            if right[0] == 0:
                yield Root(k + 1, 2 * m + 1, None)
            todo += [(k + 1, 2 * m, left), (k + 1, 2 * m + 1, right)]


# Polynomials ------------------------------------------------------------------------------------


@cache
def _to_bernstein(degree: int) -> list[list[int]]:
    scale = lcm(*(comb(degree, j) for j in range(degree + 1)))
    return [
        [scale // comb(degree, j) * comb(i, j) for j in range(i + 1)] for i in range(degree + 1)
    ]


def _bernstein(p: Polynomial, k: int, m: int) -> list[int]:
    """Coefficients on [m, m + 1] / 2^k, up to a positive factor."""
    degree = len(p) - 1
    c = [a << k * (degree - j) for j, a in enumerate(p)]
    if m:
        for i in range(degree):
            for j in range(degree - 1, i - 1, -1):
                c[j] += m * c[j + 1]
    return [sum(w * a for w, a in zip(row, c, strict=False)) for row in _to_bernstein(degree)]


def _halves(coefficients: Sequence[int]) -> tuple[list[int], list[int]]:
    """De Casteljau's, both up to one positive factor."""
    degree = len(coefficients) - 1
    left, right = [], []
    row = list(coefficients)
    for i in range(degree + 1):
        left.append(row[0] << degree - i)
        right.append(row[-1] << degree - i)
        row = [a + b for a, b in itertools.pairwise(row)]
    return left, right[::-1]


def _trim(p: Polynomial) -> Polynomial:
    while p and p[-1] == 0:
        p.pop()
    return p


def _add(a: Polynomial, b: Polynomial) -> Polynomial:
    return _trim([x + y for x, y in itertools.zip_longest(a, b, fillvalue=0)])


def _sub(a: Polynomial, b: Polynomial) -> Polynomial:
    return _trim([x - y for x, y in itertools.zip_longest(a, b, fillvalue=0)])


def _mul(a: Polynomial, b: Polynomial) -> Polynomial:
    if not a or not b:
        return []
    out = [0] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            out[i + j] += x * y
    return out


def _cross(a: Vector, b: Vector) -> Vector:
    return [
        _sub(_mul(a[1], b[2]), _mul(a[2], b[1])),
        _sub(_mul(a[2], b[0]), _mul(a[0], b[2])),
        _sub(_mul(a[0], b[1]), _mul(a[1], b[0])),
    ]


def _dot(a: Vector, b: Vector) -> Polynomial:
    return _add(_add(_mul(a[0], b[0]), _mul(a[1], b[1])), _mul(a[2], b[2]))


def _primitive(p: Polynomial) -> Polynomial:
    divisor = gcd(*p)
    return [c // divisor for c in p] if p else p


def _divide(a: Polynomial, b: Polynomial) -> tuple[Polynomial, Polynomial]:
    """Quotient and remainder, both up to a positive factor."""
    a, quotient = list(a), [0] * max(0, len(a) - len(b) + 1)
    s = _sign(b[-1])
    while len(a) >= len(b):
        k, top = len(a) - len(b), s * a[-1]
        a = [c * abs(b[-1]) for c in a]
        quotient = [c * abs(b[-1]) for c in quotient]
        quotient[k] += top
        for i, c in enumerate(b):
            a[k + i] -= top * c
        _trim(a)
    return quotient, _primitive(a)


def _common(a: Polynomial, b: Polynomial) -> Polynomial:
    while b:
        a, b = b, _divide(a, b)[1]
    return _primitive(a)


def _sign(x: int) -> int:
    return (x > 0) - (x < 0)
