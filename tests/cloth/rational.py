"""Contact in exact integer arithmetic, by another road than the code under test.

Positions become integers by a power of two. Roots are isolated by Descartes' rule and bisection
(Vincent, Collins & Akritas), signs at a root are found by a greatest common divisor where they are
zero and by refining the root where they are not. Polynomials are lists of integers, ascending.
"""

import itertools
from fractions import Fraction
from math import comb, gcd


def trim(p):
    while p and p[-1] == 0:
        p.pop()
    return p


def add(a, b, sign=1):
    n = max(len(a), len(b))
    pick = [(a[i] if i < len(a) else 0) + sign * (b[i] if i < len(b) else 0) for i in range(n)]
    return trim(pick)


def mul(a, b):
    out = [0] * max(0, len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            out[i + j] += x * y
    return trim(out)


def primitive(p):
    return [c // gcd(*p) for c in p] if p else p


def divide(a, b):
    """Quotient and remainder, both up to a positive factor."""
    a, q = list(a), [0] * max(0, len(a) - len(b) + 1)
    s = 1 if b[-1] > 0 else -1
    while len(a) >= len(b):
        k, top = len(a) - len(b), s * a[-1]
        a = [c * abs(b[-1]) for c in a]
        q = [c * abs(b[-1]) for c in q]
        q[k] += top
        for i, c in enumerate(b):
            a[k + i] -= top * c
        trim(a)
    return q, primitive(a)


def common(a, b):
    while b:
        a, b = b, divide(a, b)[1]
    return primitive(a)


def bernstein(p, lo, width, degree):
    """Coefficients on [lo, lo + width], up to a positive factor."""
    moved = [
        sum(p[j] * comb(j, i) * lo ** (j - i) for j in range(i, len(p))) * width**i
        for i in range(len(p))
    ]
    return [
        sum(moved[j] * Fraction(comb(i, j), comb(degree, j)) for j in range(min(i, len(p) - 1) + 1))
        for i in range(degree + 1)
    ]


def at(p, x):
    return sum(c * x**i for i, c in enumerate(p))


def sign(x):
    return (x > 0) - (x < 0)


def roots(p):
    """Times in [0, 1] in order: (exact, exact, None), or an interval and the polynomial with it."""
    p = divide(p, common(p, [i * c for i, c in enumerate(p)][1:]))[0] if len(p) > 1 else p
    found, todo = [], [(Fraction(0), Fraction(1))]
    for end in (0, 1):
        if at(p, end) == 0:
            found.append((Fraction(end), Fraction(end), None))
    while todo:
        lo, hi = todo.pop()
        signs = [sign(b) for b in bernstein(p, lo, hi - lo, len(p) - 1) if b]
        changes = sum(a != b for a, b in itertools.pairwise(signs))
        ends = sign(at(p, lo)) * sign(at(p, hi))
        if changes == 1 and ends < 0:
            found.append((lo, hi, p))
        elif changes:
            middle = (lo + hi) / 2
            if at(p, middle) == 0:
                found.append((middle, middle, None))
            todo += [(lo, middle), (middle, hi)]
    found.sort(key=lambda root: root[0])
    return [refined(root, Fraction(1, 2**64)) for root in found]


def refined(root, width):
    lo, hi, p = root
    while p and hi - lo > width:
        middle = (lo + hi) / 2
        s = sign(at(p, middle))
        if s == 0:
            return middle, middle, None
        lo, hi = (middle, hi) if s == sign(at(p, lo)) else (lo, middle)
    return lo, hi, p


def sign_at(root, g):
    lo, hi, p = root
    if p is None or not g:
        return sign(at(g, lo))
    shared = common(p, g)
    if len(shared) > 1 and sign(at(shared, lo)) * sign(at(shared, hi)) < 0:
        return 0
    while True:
        signs = {sign(b) for b in bernstein(g, lo, hi - lo, 4)}
        if len(signs) == 1 and 0 not in signs:
            return signs.pop()
        lo, hi, p = refined((lo, hi, p), (hi - lo) / 4)
        if p is None:
            return sign(at(g, lo))


def cross(a, b):
    return [
        add(mul(a[(k + 1) % 3], b[(k + 2) % 3]), mul(a[(k + 2) % 3], b[(k + 1) % 3]), -1)
        for k in range(3)
    ]


def dot(a, b):
    return add(add(mul(a[0], b[0]), mul(a[1], b[1])), mul(a[2], b[2]))


def touches(root, q, r, p, vertex):
    """Contact at a time of coplanarity, by barycentric weights, else between collinear points."""
    n = cross(q, r)
    nn = dot(n, n)
    if sign_at(root, nn) != 0:
        v = dot(cross(p, r), n)
        w = dot(cross(q, p), n) if vertex else dot(cross(p, q), n)
        upper = [add(nn, add(v, w), -1)] if vertex else [add(nn, v, -1), add(nn, w, -1)]
        return all(sign_at(root, s) >= 0 for s in [v, w, *upper])
    minus = [add(a, b, -1) for a, b in zip(p, q, strict=True)]
    other = [add(a, b, -1) for a, b in zip(p, r, strict=True)]
    if vertex:
        pairs = [(p, minus), (p, other), (minus, other)]
    else:
        plus = [add(a, b) for a, b in zip(p, r, strict=True)]
        both = [add(a, b, -1) for a, b in zip(plus, q, strict=True)]
        pairs = list(itertools.combinations_with_replacement([p, plus, minus, both], 2))
    return any(
        all(sign_at(root, c) == 0 for c in cross(a, b)) and sign_at(root, dot(a, b)) <= 0
        for a, b in pairs
    )


def first_contact(x_t0, x_t1, vertex):
    """The first time of contact as an interval of rationals, or ``None``. (4, 3) each."""
    cells = [float(c).as_integer_ratio() for x in (x_t0, x_t1) for row in x for c in row]
    scale = max(d for _, d in cells)
    start, end = (
        [[n * (scale // d) for n, d in cells[12 * e + 3 * i :][:3]] for i in range(4)]
        for e in (0, 1)
    )
    moving = [
        [trim([a, b - a]) for a, b in zip(s, e, strict=True)]
        for s, e in zip(start, end, strict=True)
    ]

    def gap(i, j):
        return [add(a, b, -1) for a, b in zip(moving[i], moving[j], strict=True)]

    p, q, r = (gap(0, 1), gap(2, 1), gap(3, 1)) if vertex else (gap(2, 0), gap(1, 0), gap(3, 2))
    cubic = dot(p, cross(q, r))
    if cubic:
        times = roots(primitive(cubic))
    else:
        times = [(Fraction(0), Fraction(0), None)]
        corners = (
            [gap(0, 1), gap(0, 2), gap(0, 3)]
            if vertex
            else [gap(2, 0), gap(3, 0), gap(2, 1), gap(3, 1)]
        )
        for i, a in enumerate(corners):
            for b in [*corners[i + 1 :], [[1], [], []], [[], [1], []]]:
                for c in cross(a, b):
                    if c:
                        times += roots(primitive(c))
        times.sort(key=lambda root: root[0])
    for root in times:
        if touches(root, q, r, p, vertex):
            return root[:2]
    return None
