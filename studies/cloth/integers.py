"""Contact in exact integer arithmetic: slow, plain, and by another road than the package's own.

Positions become integers by a power of two. The roots of the coplanarity cubic are isolated by
Descartes' rule in Bernstein form and halving (Vincent; Collins & Akritas 1976); signs at a root are
found by halving on, and by a greatest common divisor where they are zero. Where all four points
share a plane throughout, contact begins where a corner passes a line through two others.

Polynomials are lists of integers, ascending, without leading zeros.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import cache
from math import comb, gcd, lcm
from typing import Any

Polynomial = list[int]
Vector = list[Polynomial]

#: Halvings of [0, 1] that end the search, unless told otherwise.
HALVINGS = 64


def first_contact(
    x_t0: Any, x_t1: Any, vertex: bool, halvings: int = HALVINGS
) -> tuple[Fraction, Fraction] | None:
    """The first time of contact between two bounds, equal where it is found exactly.

    Args:
        x_t0: Positions (4, 3) at the start of the step; rows as in ``tauguard.cloth``. Finite.
        x_t1: The same at its end.
        vertex: Vertex against face, else edge against edge.
        halvings: The bounds lie 2^-halvings apart, at most.

    Returns:
        ``None`` where the features stay apart.
    """
    x = _moving(x_t0, x_t1)
    p, q, r = (
        (_gap(x, 0, 1), _gap(x, 2, 1), _gap(x, 3, 1))
        if vertex
        else (_gap(x, 2, 0), _gap(x, 1, 0), _gap(x, 3, 2))
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


def _moving(x_t0: Any, x_t1: Any) -> list[Vector]:
    cells = [float(c).as_integer_ratio() for x in (x_t0, x_t1) for row in x for c in row]
    scale = max(d for _, d in cells)
    whole = [n * (scale // d) for n, d in cells]
    pairs = list(zip(whole[:12], whole[12:], strict=True))
    return [[_trim([a, b - a]) for a, b in pairs[3 * i : 3 * i + 3]] for i in range(4)]


def _gap(x: list[Vector], i: int, j: int) -> Vector:
    return [_sub(a, b) for a, b in zip(x[i], x[j], strict=True)]


def _events(x: list[Vector], vertex: bool) -> Iterator[Root]:
    """Times at which contact may begin where all share a plane throughout.

    The differences of the features' points fill the hull of ``corners``; the origin enters it
    through a side, or, along a line, through a corner.
    """
    yield Root(0, 0, None)
    corners = [(0, 1), (0, 2), (0, 3)] if vertex else [(2, 0), (3, 0), (3, 1), (2, 1)]
    gaps = [_gap(x, i, j) for i, j in corners]
    for before, here, after in zip(gaps[-1:] + gaps, gaps, gaps[1:] + gaps[:1], strict=False):
        behind, ahead = ([c for c in _cross(here, other) if c] for other in (before, after))
        along = [] if behind or ahead else [c for c in here if c]
        for polynomial in ahead[:1] or along[:1]:
            yield from _roots(polynomial)


def _touches(root: Root, p: Vector, q: Vector, r: Vector, vertex: bool) -> bool:
    """Contact at a time of coplanarity, by barycentric weights, else between collinear points."""
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
    """A time in [0, 1]: m / 2^k, or the only root in ((m, m + 1) / 2^k) of what ``form`` tells.

    ``form`` is the Bernstein form there of ``polynomial``, which has no double roots; both are
    ``None`` for a time that is known.
    """

    def __init__(
        self, k: int, m: int, form: list[int] | None, polynomial: Polynomial | None = None
    ) -> None:
        """Keep the interval and the polynomial."""
        self.k, self.m, self._form, self._polynomial = k, m, form, polynomial

    @property
    def low(self) -> Fraction:
        """The lower bound."""
        return Fraction(self.m, 1 << self.k)

    @property
    def high(self) -> Fraction:
        """The upper bound, that itself where the time is known."""
        return Fraction(self.m + (self._form is not None), 1 << self.k)

    def refine(self, k: int) -> None:
        """Halve until the bounds are 2^-k apart, or one."""
        while self._form is not None and self.k < k:
            self._halve()

    def sign(self, g: Polynomial) -> int:
        """The sign that ``g`` has at this time."""
        if not g:
            return 0
        tried, form = 0, _bernstein(g, self.k, self.m)
        while self._form is not None:
            if min(form) > 0 or max(form) < 0:
                return _sign(form[0])
            if tried == 6 and self._shares(g):
                return 0
            side = self._halve()
            form = _halves(form)[max(side, 0)]
            tried += 1
        # At a known time the form's first value is g's there, up to a positive factor.
        return _sign(_bernstein(g, self.k, self.m)[0])

    def _halve(self) -> int:
        """Take the half with the root: 0 or 1; the middle itself: -1."""
        assert self._form is not None
        halves = _halves(self._form)
        middle = halves[1][0]
        self.k += 1
        if middle == 0:
            self.m, self._form = 2 * self.m + 1, None
            return -1
        side = int(_sign(self._form[0]) == _sign(middle))
        self.m, self._form = 2 * self.m + side, halves[side]
        return side

    def _shares(self, g: Polynomial) -> bool:
        assert self._polynomial is not None
        form = _bernstein(_common(self._polynomial, g), self.k, self.m)
        return _sign(form[0]) * _sign(form[-1]) < 0


def _roots(p: Polynomial) -> Iterator[Root]:
    """Every root in [0, 1], once."""
    p = _primitive(p)
    if len(p) > 2:
        p = _divide(p, _common(p, [i * c for i, c in enumerate(p)][1:]))[0]
    whole = _bernstein(p, 0, 0)
    yield from (Root(0, end, None) for end in (0, 1) if whole[-end] == 0)
    todo = [(0, 0, whole)]
    while todo:
        k, m, form = todo.pop()
        signs = [c > 0 for c in form if c]
        changes = sum(a != b for a, b in itertools.pairwise(signs))
        if changes == 1 and form[0] and form[-1]:
            yield Root(k, m, form, p)
        elif changes:
            left, right = _halves(form)
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


def _halves(form: Sequence[int]) -> tuple[list[int], list[int]]:
    """De Casteljau's, both up to one positive factor."""
    degree = len(form) - 1
    left, right = [], []
    row = list(form)
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
