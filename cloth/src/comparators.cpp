#include "comparators.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "batch.hpp"
#include "query.hpp"
#include "tauguard/geometry/interrupt.hpp"
#include "tauguard/geometry/scratch.hpp"

namespace tauguard::cloth {
namespace {

constexpr std::size_t block = 512;  // queries at a time

// Tolerance of the barycentric weights at a root, similar to the published codes.
constexpr double inside_tolerance = 1e-10;

int variations(const double* a) {
  int count = 0;
  double last = 0;
  for (int i = 0; i < 4; ++i) {
    if (a[i] == 0) continue;
    count += last * a[i] < 0 || (last != 0 && (last > 0) != (a[i] > 0));
    last = a[i];
  }
  return count;
}

// Converts the Bernstein coefficients b of a cubic to its coefficients a in powers of t.
void powers(const double* b, double* a) {
  a[0] = b[0];
  a[1] = 3 * (b[1] - b[0]);
  a[2] = 3 * (b[2] - 2 * b[1] + b[0]);
  a[3] = b[3] - 3 * b[2] + 3 * b[1] - b[0];
}

Cubic part(const Cubic& c, double from, double to) {
  Cubic left, right, rest;
  halve(c, from, left, rest);
  halve(rest, from < 1 ? (to - from) / (1 - from) : 1, left, right);
  return left;
}

bool inside(const Query& k, double t, bool vf) {
  const Vec3 p = mix(k.p[0], k.p[1], t), q = mix(k.q[0], k.q[1], t), r = mix(k.r[0], k.r[1], t);
  const Vec3 n = cross(q, r);
  const double nn = dot(n, n);
  if (nn == 0) return false;
  const double low = -inside_tolerance, high = 1 + inside_tolerance;
  const double v = dot(cross(p, r), n) / nn;
  const double w = vf ? dot(cross(q, p), n) / nn : dot(cross(p, q), n) / nn;
  return v >= low && w >= low && (vf ? v + w <= high : v <= high && w <= high);
}

bool filtered_out(const Cubic& c, Comparator comparator) {
  double a[4];
  switch (comparator) {
    case Comparator::dnf:
      return one_sign(c, 0) != 0;
    case Comparator::vcd:
      return variations(c.b) == 0 && c.b[0] != 0 && c.b[3] != 0;
    case Comparator::scd: {
      powers(c.b, a);
      if (variations(a) == 0 && a[0] != 0) return true;
      const double reversed[4] = {c.b[3], c.b[2], c.b[1], c.b[0]};
      powers(reversed, a);
      return variations(a) == 0 && a[0] != 0;
    }
    default:
      return false;
  }
}

// The first root at which the features meet; infinity if there is none.
double first_root_inside(const Query& k, const Cubic& c, Comparator comparator, bool vf) {
  double cut[4] = {0, 1, 1, 1};
  int cuts = 1;
  if (!(comparator == Comparator::vcd && variations(c.b) == 1)) {
    // Split where the derivative is zero, so that the cubic is monotone in every piece.
    double a[4];
    powers(c.b, a);
    const double d = a[2] * a[2] - 3 * a[1] * a[3];
    if (d > 0) {
      const double s = -(a[2] + std::copysign(std::sqrt(d), a[2]));
      double x = s / (3 * a[3]), y = a[1] / s;
      if (x > y) std::swap(x, y);
      for (const double z : {x, y})
        if (z > 0 && z < 1) cut[cuts++] = z;
    }
  }
  cut[cuts] = 1;
  for (int i = 0; i < cuts; ++i) {
    const Cubic piece = cuts == 1 ? c : part(c, cut[i], cut[i + 1]);
    const double *b = piece.b, width = cut[i + 1] - cut[i];
    if (b[0] == 0 && inside(k, cut[i], vf)) return cut[i];
    if ((b[0] < 0 && b[3] > 0) || (b[0] > 0 && b[3] < 0)) {
      const double t = cut[i] + width * root(b);
      if (inside(k, t, vf)) return t;
    }
    if (b[3] == 0 && inside(k, cut[i + 1], vf)) return cut[i + 1];
  }
  return never;
}

template <bool vf>
Query query_of(const Ends& x, const std::int32_t* row, double scale) {
  Query k{};
  for (int e = 0; e < 2; ++e) {
    const Vec3 a = x(e, row[0]), b = x(e, row[1]), c = x(e, row[2]), d = x(e, row[3]);
    k.p[e] = scale * (vf ? a - b : c - a);
    k.q[e] = scale * (vf ? c - b : b - a);
    k.r[e] = scale * (vf ? d - b : d - c);
  }
  return k;
}

template <bool vf>
void compare(const Ends& x, const std::int32_t* rows, std::size_t n, Comparator comparator,
             std::uint8_t* hit, ImpactArrays out, Stats& stats) {
  geometry::Scratch<std::array<Group, block / width>> scratch;
  Group* groups = scratch->data();
  for (std::size_t first = 0; first < n; first += block) {
    geometry::poll_interrupt();
    const int count = static_cast<int>(std::min(block, n - first));
    const std::int32_t* part = rows + 4 * first;
    batch_kernels().gather(vf, x, part, count, groups);
    for (int i = 0; i < count; ++i) {
      const Group& g = groups[i / width];
      const int lane = i % width;
      Cubic whole;
      for (int j = 0; j < 4; ++j) whole.b[j] = g.value[Group::cubic + j][lane];
      double toi = never;
      if (filtered_out(whole, comparator)) {
        ++stats.cubic_sign;
      } else {
        const double scale = g.value[Group::scale][lane];
        const Query query = query_of<vf>(x, part + 4 * i, scale);
        toi = first_root_inside(query, whole, comparator, vf);
        stats.roots += !(toi <= 1);
      }
      hit[first + i] = toi <= 1;
      if (!hit[first + i]) continue;
      out.toi[first + i] = toi;
      if (out.point) describe<vf>(x, part + 4 * i, toi, 0, out, first + i);
    }
  }
}

}  // namespace

void compare_vf(const Ends& x, const std::int32_t* rows, std::size_t n, Comparator comparator,
                std::uint8_t* hit, ImpactArrays impacts, Stats& stats) {
  compare<true>(x, rows, n, comparator, hit, impacts, stats);
}
void compare_ee(const Ends& x, const std::int32_t* rows, std::size_t n, Comparator comparator,
                std::uint8_t* hit, ImpactArrays impacts, Stats& stats) {
  compare<false>(x, rows, n, comparator, hit, impacts, stats);
}

}  // namespace tauguard::cloth
