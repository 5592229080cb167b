// Overlap in successive frames: the plane that separated a pair in the last frame is tested first.
// It decides nearly every pair that is still apart. A plane that no longer separates costs time,
// but never makes an answer wrong.
#include <atomic>

#include "convex_overlap.hpp"
#include "convex_resolve.hpp"
#include "convex_slab.hpp"
#include "tauguard/geometry/interrupt.hpp"

namespace tauguard::rigid {

namespace {

struct Extent {
  double low, high, reach;
};

// The range of a body's projections on n relative to `base`, and a bound on its points' 1-norm.
TAUGUARD_INLINE Extent extent_along(const Bodies& bodies, std::size_t row, const double* base,
                                    const double* n) {
  const double* p = bodies.row(row);
  if (bodies.kind == Kind::boxes || bodies.kind == Kind::parallelepipeds) {
    const Zonotope z = zonotope_of(bodies.kind, p);
    double center[3], away[3];
    for (int k = 0; k < 3; ++k) {
      away[k] = z.origin[k] - base[k];
      center[k] = away[k] + z.shift[k];
    }
    const double middle = dot(n, center);
    const double radius =
        std::fabs(dot(n, z.g[0])) + std::fabs(dot(n, z.g[1])) + std::fabs(dot(n, z.g[2]));
    return {middle - radius, middle + radius,
            norm1(away) + 2 * (norm1(z.g[0]) + norm1(z.g[1]) + norm1(z.g[2]))};
  }
  const std::size_t width = bodies.kind == Kind::polygons ? 2 : 3, count = bodies.vertex_count(row);
  Extent out{HUGE_VAL, -HUGE_VAL, 0.0};
  for (std::size_t j = 0; j < count; ++j) {
    double x[3] = {0, 0, 0};
    for (std::size_t k = 0; k < width; ++k) x[k] = p[width * j + k] - base[k];
    const double value = dot(n, x);
    out.low = std::min(out.low, value);
    out.high = std::max(out.high, value);
    out.reach = std::max(out.reach, norm1(x));
  }
  return out;
}

// Whether some plane with normal n certainly has a below and b above it. Error bounds: 8 u reach
// for a point, 4 u (relative) for a dot product.
TAUGUARD_INLINE bool plane_holds(const Bodies& a, const Bodies& b, std::size_t row,
                                 const double* n) {
  const double* base = a.row(row);
  const Extent ea = extent_along(a, row, base, n), eb = extent_along(b, row, base, n);
  const double reach = ea.reach + eb.reach;
  return in_range(reach) && eb.low - ea.high > 32 * unit * norm1(n) * reach;
}

// Finds the first axis that certainly separates the bodies, as a unit normal from a to b.
template <class A, class B>
bool find_axis(const Bodies& a, const Bodies& b, std::size_t row, double* n) {
  constexpr int faces[4][2] = {{0, 1}, {0, 2}, {1, 2}, {3, 4}};
  A body_a;
  B body_b;
  load(a.kind, a.row(row), a.row(row), body_a);
  load(b.kind, b.row(row), a.row(row), body_b);
  const auto accept = [&](const double* e, const double* f) {
    double axis[3];
    cross(e, f, axis);
    double low_a = HUGE_VAL, high_a = -HUGE_VAL, low_b = HUGE_VAL, high_b = -HUGE_VAL;
    for (const auto& v : body_a.v)
      low_a = std::min(low_a, dot(axis, v)), high_a = std::max(high_a, dot(axis, v));
    for (const auto& v : body_b.v)
      low_b = std::min(low_b, dot(axis, v)), high_b = std::max(high_b, dot(axis, v));
    const bool above = low_b > high_a;
    if (!above && !(low_a > high_b)) return false;
    const double length = (above ? 1.0 : -1.0) * std::sqrt(dot(axis, axis));
    for (int k = 0; k < 3; ++k) n[k] = axis[k] / length;
    return true;
  };
  for (int i = 0; i < (A::edges == 6 ? 4 : 3); ++i)
    if (accept(body_a.e[faces[i][0]], body_a.e[faces[i][1]])) return true;
  for (int i = 0; i < (B::edges == 6 ? 4 : 3); ++i)
    if (accept(body_b.e[faces[i][0]], body_b.e[faces[i][1]])) return true;
  for (const auto& e : body_a.e)
    for (const auto& f : body_b.e)
      if (accept(e, f)) return true;
  return false;
}

void renew(const Bodies& a, const Bodies& b, std::size_t row, double* n) {
  using T = SlabBody<4, 6>;
  using Z = SlabBody<8, 3>;
  const bool ta = a.kind == Kind::tetrahedra, tb = b.kind == Kind::tetrahedra;
  bool found = false;
  if (is_cloud(a.kind) || is_cloud(b.kind)) {
    double witness[7];
    find_witness(a, b, row, separated, witness);
    std::copy(witness + 3, witness + 6, n);
    found = true;
  } else if (ta) {
    found = tb ? find_axis<T, T>(a, b, row, n) : find_axis<T, Z>(a, b, row, n);
  } else {
    found = tb ? find_axis<Z, T>(a, b, row, n) : find_axis<Z, Z>(a, b, row, n);
  }
  if (!found) std::fill(n, n + 3, 0.0);
}

}  // namespace

std::size_t overlap_cached(const Bodies& a, const Bodies& b, std::size_t n, int threads,
                           double* normals, std::uint8_t* hit) {
  const RowMethod rest = row_method(a.kind, b.kind);
  std::atomic<std::size_t> answered{0};
  geometry::interruptible_for(n, threads, 1024, [&](auto begin, auto end, auto) {
    std::size_t mine = 0;
    for (auto i = begin; i < end; ++i) {
      double* normal = normals + 3 * i;
      if (plane_holds(a, b, i, normal)) {
        hit[i] = 0;
        ++mine;
        continue;
      }
      rest(a, b, i, hit);
      if (!hit[i]) renew(a, b, i, normal);
    }
    answered += mine;
  });
  return answered;
}

}  // namespace tauguard::rigid
