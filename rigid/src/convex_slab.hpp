// Time of impact of a translating body, by separating axes. On an axis L the projections overlap
// while low <= t s <= high, with s = L . d. The entry of the axis is the first such t. The latest
// entry over all axes is the time of impact. The bodies are apart until the entry on any axis, also
// on an axis with rounding errors. So an entry minus its error bound is never late.
#pragma once

#include <cmath>
#include <limits>

#include "convex_abfme.hpp"

namespace tauguard::rigid {

template <int Vertices, int Edges>
struct SlabBody {
  static constexpr int edges = Edges;
  double v[Vertices][3], e[Edges][3];
  double reach = 0.0;  // largest 1-norm of a vertex
};

// Vertices relative to `base`, so that bodies far from the origin lose no accuracy.
TAUGUARD_INLINE void load(Kind, const double* p, const double* base, SlabBody<4, 6>& body) {
  constexpr int pairs[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};
  body.reach = offsets_from(p, base, body.v);
  for (int i = 0; i < 6; ++i)
    for (int k = 0; k < 3; ++k) body.e[i][k] = p[3 * pairs[i][1] + k] - p[3 * pairs[i][0] + k];
}
TAUGUARD_INLINE void load(Kind kind, const double* p, const double* base, SlabBody<8, 3>& body) {
  const Zonotope z = zonotope_of(kind, p);
  double center[3];
  for (int k = 0; k < 3; ++k) center[k] = (z.origin[k] - base[k]) + z.shift[k];
  body.reach = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    for (int k = 0; k < 3; ++k) {
      double x = center[k];
      for (int axis = 0; axis < 3; ++axis) x += corner >> axis & 1 ? z.g[axis][k] : -z.g[axis][k];
      body.v[corner][k] = x;
    }
    body.reach = std::max(body.reach, norm1(body.v[corner]));
  }
  for (int axis = 0; axis < 3; ++axis)
    for (int k = 0; k < 3; ++k) body.e[axis][k] = z.g[axis][k];
  body.reach += 2 * (norm1(center) + norm1(z.g[0]) + norm1(z.g[1]) + norm1(z.g[2]));
}

struct Entry {
  double enter =
      -std::numeric_limits<double>::infinity();  // the bodies are certainly apart before this time
  double leave = std::numeric_limits<double>::infinity();  // certainly apart after this time
  double surely_in = enter, surely_out = leave;  // between these times they overlap on every axis
  bool certain = true;                           // false if some axis was too short to decide
  double reliable = enter;                       // `enter` plus twice its error bound
  double normal[3] = {0, 0, 0};                  // the axis that gave `enter`, from a to b

  bool usable = true;  // sizes are in range

  bool miss() const { return usable && (enter > leave || enter > 1.0 || leave < 0.0); }
  bool hit() const {
    return usable && certain && surely_in < surely_out && surely_in < 1.0 && surely_out > 0.0;
  }
};

// Tests one axis. `length` >= |axis|_1 is the product of the sizes of its edges. Error bounds:
//   4 u length           of the axis, which matters to `hit` only,
//   8 u reach            of a vertex,
//   4 u length reach     of a projection, in addition,
//   64 u length reach    of the difference of two projections,
//   8 u length |d|       of the speed L . d.
template <class A, class B>
TAUGUARD_INLINE void cast_axis(const A& a, const B& b, const double* axis, double length,
                               const double* d, Entry& out) {
  if (!(length > 1e-200)) {  // products that may have lost their accuracy to underflow
    out.certain = false;
    return;
  }
  double low_a = dot(axis, a.v[0]), high_a = low_a, low_b = dot(axis, b.v[0]), high_b = low_b;
  for (const auto& v : a.v) {
    const double x = dot(axis, v);
    low_a = std::min(low_a, x), high_a = std::max(high_a, x);
  }
  for (const auto& v : b.v) {
    const double x = dot(axis, v);
    low_b = std::min(low_b, x), high_b = std::max(high_b, x);
  }
  const double error = 64 * unit * length * (a.reach + b.reach);
  const double speed = dot(axis, d), speed_error = 16 * unit * length * norm1(d);
  const double low = low_a - high_b, high = high_a - low_b;
  const double size = std::fabs(speed);
  if (!(size > 2 * speed_error)) {
    const double drift = error + 4 * speed_error;
    if (low > drift || high < -drift) out.leave = -1.0;
    if (!(low < -drift && high > drift)) out.certain = false;
    return;
  }
  const double first = (speed > 0 ? low : -high) / size, last = (speed > 0 ? high : -low) / size;
  const double relative = 2 * speed_error / size + 4 * unit, margin = 2 * error / size;
  const double first_error = margin + std::fabs(first) * relative,
               last_error = margin + std::fabs(last) * relative;
  out.leave = std::min(out.leave, last + last_error);
  out.surely_in = std::max(out.surely_in, first + first_error);
  out.surely_out = std::min(out.surely_out, last - last_error);
  if (!(first - first_error > out.enter)) return;
  out.enter = first - first_error;
  out.reliable = first + first_error;
  for (int k = 0; k < 3; ++k) out.normal[k] = speed > 0 ? -axis[k] : axis[k];
}

// Tests all face normals, then all edge pairs, and ends once a miss is certain.
template <class A, class B>
TAUGUARD_INLINE Entry cast(const A& a, const B& b, const double* d) {
  constexpr int faces[4][2] = {{0, 1}, {0, 2}, {1, 2}, {3, 4}};
  Entry out;
  out.usable = in_range(a.reach + b.reach) && in_range(norm1(d));
  if (!out.usable) return out;
  double axis[3];
  const auto try_axis = [&](const double* e, const double* f) __attribute__((always_inline)) {
    cross(e, f, axis);
    cast_axis(a, b, axis, 2 * norm1(e) * norm1(f), d, out);
    return out.miss();
  };
  for (int i = 0; i < (A::edges == 6 ? 4 : 3); ++i)
    if (try_axis(a.e[faces[i][0]], a.e[faces[i][1]])) return out;
  for (int i = 0; i < (B::edges == 6 ? 4 : 3); ++i)
    if (try_axis(b.e[faces[i][0]], b.e[faces[i][1]])) return out;
  for (const auto& e : a.e)
    for (const auto& f : b.e)
      if (try_axis(e, f)) return out;
  return out;
}

}  // namespace tauguard::rigid
