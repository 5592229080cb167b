// Bernstein polynomials on [0, 1] with integer coefficients of fixed width: their roots, and the
// sign of one polynomial at a root of another. They decide most queries, whose coefficients are
// short and whose roots are simple. For the others exact_polynomial.hpp has integers of any length.
//
// A polynomial of degree n is sum_i c_i (1 - t)^(n - i) t^i, in the Bernstein basis without
// binomial factors. In this form a product is a convolution, the number of sign variations of the
// c_i bounds the number of roots in (0, 1) (Descartes), and the substitution t -> t / 2 gives
// integers again (Vincent). Times are multiples of 2^-52.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "query.hpp"
#include "tauguard/geometry/fixed_int.hpp"

namespace tauguard::cloth {

using geometry::FixedInt;

constexpr int time_bits = 52;
constexpr std::int64_t end_of_time = std::int64_t{1} << time_bits;

// Coefficients have 128 bits per degree. Bounds, if the differences of vertices (degree 1) have
// coefficients below 2^117:
//   2^236  a side of the hull of the differences (exact.cpp, degree 2)
//   2^238  the sum of the sides
//   2^356  the coplanarity cubic
//   2^834  remainders of polynomial division
template <int degree>
struct Bernstein {
  std::array<FixedInt<2 * degree>, degree + 1> c;

  bool zero() const {
    for (const auto& x : c)
      if (x.sign() != 0) return false;
    return true;
  }
  int variations() const {
    int count = 0, last = 0;
    for (const auto& x : c) {
      const int s = x.sign();
      if (s == 0) continue;
      count += last != 0 && s != last;
      last = s;
    }
    return count;
  }
  friend Bernstein operator+(const Bernstein& a, const Bernstein& b) {
    Bernstein r;
    for (int i = 0; i <= degree; ++i) r.c[i] = a.c[i] + b.c[i];
    return r;
  }
  friend Bernstein operator-(const Bernstein& a, const Bernstein& b) {
    Bernstein r;
    for (int i = 0; i <= degree; ++i) r.c[i] = a.c[i] - b.c[i];
    return r;
  }
};
template <int a, int b>
Bernstein<a + b> operator*(const Bernstein<a>& x, const Bernstein<b>& y) {
  Bernstein<a + b> r;
  for (int i = 0; i <= a; ++i)
    for (int j = 0; j <= b; ++j) r.c[i + j] = r.c[i + j] + x.c[i] * y.c[j];
  return r;
}

// The sign at time t 2^-52. The value needs 52 bits per degree more than the coefficients.
template <int degree>
int sign_at(const Bernstein<degree>& f, std::int64_t t) {
  using Wide = FixedInt<3 * degree>;
  const std::uint64_t s = end_of_time - t;
  Wide sum(f.c[0]);
  for (int i = 1; i <= degree; ++i) {
    Wide term(f.c[i]);
    for (int j = 0; j < i; ++j) term = term.times(t);
    sum = sum.times(s) + term;
  }
  return sum.sign();
}

// The polynomial on the first and on the second half of [0, 1], both multiplied by 2^degree.
inline void halve(const Bernstein<2>& f, Bernstein<2>& left, Bernstein<2>& right) {
  const auto sum = f.c[0] + f.c[1] + f.c[2];
  left.c = {f.c[0].times(4), f.c[0].times(4) + f.c[1].times(2), sum};
  right.c = {sum, f.c[2].times(4) + f.c[1].times(2), f.c[2].times(4)};
}
inline void halve(const Bernstein<3>& f, Bernstein<3>& left, Bernstein<3>& right) {
  const auto sum = f.c[0] + f.c[1] + f.c[2] + f.c[3];
  left.c = {f.c[0].times(8), f.c[0].times(12) + f.c[1].times(4),
            f.c[0].times(6) + f.c[1].times(4) + f.c[2].times(2), sum};
  right.c = {sum, f.c[3].times(6) + f.c[2].times(4) + f.c[1].times(2),
             f.c[3].times(12) + f.c[2].times(4), f.c[3].times(8)};
}

constexpr int unknown_sign = 2;

// A root. It is exactly `lo` if `of` is null. Otherwise it is a simple root of `of`, and the only
// one in the open interval (lo, hi).
template <int degree>
struct BernsteinRoot {
  std::int64_t lo, hi;  // in units of 2^-52
  const Bernstein<degree>* of = nullptr;
};

template <int degree>
struct BernsteinRoots {
  std::array<BernsteinRoot<degree>, degree> all;  // ascending
  int count = 0;
  bool complete = true;  // false: there may be more roots
  void add(BernsteinRoot<degree> r) { all[count++] = r; }
};

// The only root of `part` in (0, 1), in double precision. before: the sign before the root.
inline double estimate(const Bernstein<3>& part, int before) {
  double b[4] = {part.c[0].to_double(), part.c[1].to_double() / 3, part.c[2].to_double() / 3,
                 part.c[3].to_double()};
  if (b[0] == 0) b[0] = before * 0x1p-300;
  if (b[3] == 0) b[3] = -before * 0x1p-300;
  return root(b);
}
inline double estimate(const Bernstein<2>& part, int before) {
  Bernstein<3> raised;
  const auto& c = part.c;
  raised.c = {FixedInt<6>(c[0]), FixedInt<6>(c[0] + c[1]), FixedInt<6>(c[1] + c[2]),
              FixedInt<6>(c[2])};
  return estimate(raised, before);
}

// Adds the roots of f in (start, start + length). `part` is f on this interval. It is halved at
// most five times, for which the integers are wide enough.
template <int degree>
void add_roots_inside(const Bernstein<degree>& f, const Bernstein<degree>& part, std::int64_t start,
                      std::int64_t length, BernsteinRoots<degree>& roots) {
  const int variations = part.variations();
  if (variations == 0) return;
  if (variations > 1) {
    if (length <= end_of_time >> 5) {
      roots.complete = false;
      return;
    }
    Bernstein<degree> left, right;
    halve(part, left, right);
    const std::int64_t half = length / 2;
    add_roots_inside(f, left, start, half, roots);
    if (right.c[0].sign() == 0) roots.add({start + half, start + half});
    add_roots_inside(f, right, start + half, half, roots);
    return;
  }
  int before = 0;
  for (const auto& c : part.c)
    if (before == 0) before = c.sign();
  const auto guess =
      start + static_cast<std::int64_t>(estimate(part, before) * static_cast<double>(length));
  for (const std::int64_t off : {std::int64_t{2}, std::int64_t{1} << 7, std::int64_t{1} << 14}) {
    const std::int64_t lo = std::max(guess - off, start),
                       hi = std::min(guess + off, start + length);
    const int at_lo = lo == start ? before : sign_at(f, lo),
              at_hi = hi == start + length ? -before : sign_at(f, hi);
    if (at_lo == 0 || at_hi == 0)
      return roots.add(at_lo == 0 ? BernsteinRoot<degree>{lo, lo} : BernsteinRoot<degree>{hi, hi});
    if (at_lo == before && at_hi == -before) return roots.add({lo, hi, &f});
  }
  roots.complete = false;
}

// The roots of f in [0, 1]. f must not be zero and must outlive the result.
template <int degree>
BernsteinRoots<degree> roots_of(const Bernstein<degree>& f) {
  BernsteinRoots<degree> roots;
  if (f.c[0].sign() == 0) roots.add({0, 0});
  add_roots_inside(f, f, 0, end_of_time, roots);
  if (f.c[degree].sign() == 0) roots.add({end_of_time, end_of_time});
  return roots;
}

template <int degree>
Bernstein<degree> reversed(const Bernstein<degree>& f) {
  Bernstein<degree> r = f;
  std::reverse(r.c.begin(), r.c.end());
  return r;
}

// The remainder r in m f = q l + r (1 - t)^(n - 1), with m > 0 and with l and r of degree 1. Where
// q is zero, f has the sign of r. The last coefficient of q must not be zero.
inline std::array<FixedInt<14>, 2> remainder(const Bernstein<3>& f, const Bernstein<2>& q) {
  const auto& [q0, q1, q2] = q.c;
  const auto& [f0, f1, f2, f3] = f.c;
  const FixedInt<10> l0 = q2 * f2 - q1 * f3;  // m = q2^2, l1 = q2 f3
  return {q2 * (q2 * f0) - q0 * l0, q2 * (q2 * f1 - q0 * f3) - q1 * l0};
}
inline std::array<FixedInt<8>, 2> remainder(const Bernstein<2>& f, const Bernstein<2>& q) {
  const auto& [q0, q1, q2] = q.c;
  const auto& [f0, f1, f2] = f.c;
  const auto r0 = q2 * f0 - q0 * f2, r1 = q2 * f1 - q1 * f2;  // m = |q2|
  if (q2.negative()) return {-r0, -r1};
  return {r0, r1};
}

// The sign of q at the only root of f in (lo, hi). q also has only one root there; its signs at the
// ends are at_lo and at_hi.
template <int degree>
int sign_where_both_change(const Bernstein<2>& q, int at_lo, int at_hi, const Bernstein<degree>& f,
                           std::int64_t lo, std::int64_t hi) {
  if (q.c[2].sign() == 0)
    return sign_where_both_change(reversed(q), at_hi, at_lo, reversed(f), end_of_time - hi,
                                  end_of_time - lo);
  const auto [r0, r1] = remainder(f, q);
  const auto of_r = [&r0 = r0, &r1 = r1](std::int64_t t) {
    return (r0.times(end_of_time - t) + r1.times(t)).sign();
  };
  const int r_lo = of_r(lo), r_hi = of_r(hi);
  int f_at_q = r_lo;  // the sign of f at the root of q
  if (r_lo == 0 && r_hi == 0) return 0;
  if (r_lo != r_hi) {
    // r is zero at |r0| / (|r0| + |r1|). Is this before the root of q?
    const auto m0 = r0.magnitude(), m1 = r1.magnitude();
    const auto sum = q.c[0] * (m1 * m1) + q.c[1] * (m0 * m1) + q.c[2] * (m0 * m0);
    if (r_lo == 0 || r_hi == 0) return unknown_sign;
    if (sum.sign() == 0) return 0;
    if (sum.sign() == at_lo) f_at_q = r_hi;
  }
  const int f_lo = sign_at(f, lo);
  if (f_lo == 0) return unknown_sign;
  return f_at_q == f_lo ? at_hi : at_lo;  // equal signs: the root of q is before the root of f
}

// The sign of a quadratic at a root. unknown_sign: a narrower interval or Sturm's theorem is
// needed.
template <int degree>
int sign_at(const Bernstein<2>& q, const BernsteinRoot<degree>& root) {
  if (q.zero()) return 0;
  const int at_lo = sign_at(q, root.lo);
  if (!root.of) return at_lo;
  const int at_hi = sign_at(q, root.hi);
  if (at_lo == 0 || at_hi == 0) return unknown_sign;
  if (at_lo != at_hi) return sign_where_both_change(q, at_lo, at_hi, *root.of, root.lo, root.hi);
  // Twice the middle Bernstein coefficient of q on [lo, hi].
  const std::uint64_t t = root.lo, u = root.hi, s = end_of_time - t, r = end_of_time - u;
  const FixedInt<6> a(q.c[0]), b(q.c[1]), c(q.c[2]);
  const auto control = a.times(s).times(r).times(2) + b.times(s).times(u) + b.times(r).times(t) +
                       c.times(t).times(u).times(2);
  return control.sign() == at_lo ? at_lo : unknown_sign;
}

}  // namespace tauguard::cloth
