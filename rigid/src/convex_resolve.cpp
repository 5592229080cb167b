#include "convex_resolve.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "convex_eliminate.hpp"
#include "convex_simplex.hpp"

namespace tauguard::rigid {

namespace {

// numerator / denominator with a precision of about 50 bits, for any exponents.
double quotient(const Dyadic& numerator, const Dyadic& denominator) {
  if (numerator.is_zero()) return 0.0;
  const auto n = numerator.floor_log2(), d = denominator.floor_log2();
  const double q = numerator.scaled(-n).to_double() / denominator.scaled(-d).to_double();
  return std::ldexp(q, static_cast<int>(std::clamp<std::int64_t>(n - d, -5000, 5000)));
}

Dyadic projection(const double* n, const Vector3<Dyadic>& p) {
  return Dyadic(n[0]) * p[0] + Dyadic(n[1]) * p[1] + Dyadic(n[2]) * p[2];
}

// The largest projection of a and the smallest of b.
std::array<Dyadic, 2> extent(const Points<Dyadic>& a, const Points<Dyadic>& b,
                             const double* normal) {
  Dyadic high = projection(normal, a[0]), low = projection(normal, b[0]);
  for (const auto& p : a) {
    const Dyadic x = projection(normal, p);
    if (high < x) high = x;
  }
  for (const auto& p : b) {
    const Dyadic x = projection(normal, p);
    if (x < low) low = x;
  }
  return {high, low};
}

Vector3<Dyadic> shifted(const Vector3<Dyadic>& p, const double* d, double time) {
  const Dyadic t(time);
  return {p[0] + Dyadic(d[0]) * t, p[1] + Dyadic(d[1]) * t, p[2] + Dyadic(d[2]) * t};
}

void write_plane(const HullSimplex<Dyadic>& lp, const Points<Dyadic>& a, const Points<Dyadic>& b,
                 double* normal, double* offset) {
  std::int64_t top = std::numeric_limits<std::int64_t>::min();
  for (int k = 0; k < 3; ++k)
    if (!lp.plane()[k].is_zero()) top = std::max(top, lp.plane()[k].floor_log2());
  double length = 0.0;
  for (int k = 0; k < 3; ++k) {
    normal[k] = lp.plane()[k].scaled(-top).to_double();
    length += normal[k] * normal[k];
  }
  for (int k = 0; k < 3; ++k) normal[k] /= std::sqrt(length);
  const auto [high, low] = extent(a, b, normal);
  *offset = (high + low).scaled(-1).to_double();
}

void write_point(const HullSimplex<Dyadic>& lp, const Points<Dyadic>& a, double* point) {
  for (int k = 0; k < 3; ++k) {
    Dyadic sum;
    for (int c = 0; c < 4; ++c)
      if (!lp.is_artificial(c)) sum += lp.weight(c) * a[lp.basis_pair(c)[0]][k];
    point[k] = quotient(sum, lp.determinant());
  }
}

using Lp = HullSimplex<double>;

// Makes all coordinates relative to the first vertex of a. Returns the points' largest 1-norm.
double localize(Points<double>& a, Points<double>& b, Vec3& base) {
  base = a[0];
  double reach = 0.0;
  for (auto* points : {&a, &b})
    for (auto& p : *points) {
      p = p - base;
      reach = std::max(reach, norm1(p.data()));
    }
  return reach;
}

// A lower bound of the gap between the projections on n. Error bounds: u reach for coordinates,
// 4 u |n| reach for a dot product.
double certain_gap(const Points<double>& a, const Points<double>& b, const double* n, double reach,
                   double& high, double& low) {
  high = -HUGE_VAL, low = HUGE_VAL;
  for (const auto& p : a) high = std::max(high, dot(n, p.data()));
  for (const auto& p : b) low = std::min(low, dot(n, p.data()));
  return low - high - 16 * unit * norm1(n) * reach;
}

// Common point or separating plane in doubles; false if the error exceeds a few roundings.
bool find_witness_quickly(const Bodies& bodies_a, const Bodies& bodies_b, std::size_t row,
                          Verdict known, double* out) {
  auto a = vertices_of<double>(bodies_a, row), b = vertices_of<double>(bodies_b, row);
  Vec3 base;
  const double reach = localize(a, b, base);
  if (!in_range(reach)) return false;
  Lp lp(a, b);
  const auto answer = lp.solve(64);
  if (known != (answer == Lp::Answer::separated ? separated : common)) return false;
  if (answer == Lp::Answer::separated) {
    double n[3], high, low;
    const double length = std::sqrt(dot(lp.plane().data(), lp.plane().data()));
    for (int k = 0; k < 3; ++k) n[k] = lp.plane()[k] / length;
    if (!(certain_gap(a, b, n, reach + norm1(base.data()), high, low) > 0)) return false;
    std::copy(n, n + 3, out + 3);
    out[6] = 0.5 * (high + low) + dot(n, base.data());
    return true;
  }
  if (answer != Lp::Answer::common) return false;
  double point[3] = {0, 0, 0}, other[3] = {0, 0, 0};
  for (int c = 0; c < 4; ++c) {
    const double weight = lp.weight(c) / lp.determinant();
    if (lp.is_artificial(c)) continue;
    if (!(weight >= 0)) return false;
    const auto [i, j] = lp.basis_pair(c);
    for (int k = 0; k < 3; ++k) {
      point[k] += weight * a[i][k];
      other[k] += weight * b[j][k];
    }
  }
  for (int k = 0; k < 3; ++k) {
    if (!(std::fabs(point[k] - other[k]) <= 8 * unit * reach)) return false;
    out[k] = point[k] + base[k];
  }
  return true;
}

}  // namespace

// The hulls meet if the simplex basis has four columns a_i - b_j with positive weights, because
// these columns enclose the origin. Error bounds, where `size` includes the distance of the origin:
// * A vertex has an error of u reach, and of 8 u size if it is computed from generators.
// * A column has a 1-norm of at most 2 size and an error of 16 u size.
// * A weight is a determinant of three columns. The columns add 3 * 16 * 4 u size^3 to its error,
//   the arithmetic 48 u size^3. Together they are below 512 u size^3.
Verdict resolve_hulls(const Bodies& bodies_a, const Bodies& bodies_b, std::size_t row) {
  auto a = vertices_of<double>(bodies_a, row), b = vertices_of<double>(bodies_b, row);
  Vec3 base;
  const double reach = localize(a, b, base);
  const auto given = [](Kind kind) { return is_cloud(kind) || kind == Kind::tetrahedra; };
  const double size =
      given(bodies_a.kind) && given(bodies_b.kind) ? reach : 2 * (reach + norm1(base.data()));
  if (!in_range(reach) || !in_range(size)) return undecided;
  Lp lp(a, b);
  const auto answer = lp.solve(64);
  if (answer == Lp::Answer::separated) {
    double high, low;
    return certain_gap(a, b, lp.plane().data(), size, high, low) > 0 ? separated : undecided;
  }
  if (answer != Lp::Answer::common) return undecided;
  for (int c = 0; c < 4; ++c)
    if (lp.is_artificial(c) || !(lp.weight(c) > 512 * unit * size * size * size)) return undecided;
  return common;
}

Verdict eliminate_hulls(const Bodies& bodies_a, const Bodies& bodies_b, std::size_t row) {
  auto a = vertices_of<double>(bodies_a, row), b = vertices_of<double>(bodies_b, row);
  Vec3 base;
  const double reach = localize(a, b, base);
  if (!in_range(reach)) return undecided;
  if (bodies_a.kind == Kind::polygons) return HullElimination<2>(a, b, reach).decide();
  return HullElimination<3>(a, b, reach).decide();
}

Verdict resolve_exactly(const Bodies& a, const Bodies& b, std::size_t row) {
  const auto pa = vertices_of<Dyadic>(a, row), pb = vertices_of<Dyadic>(b, row);
  HullSimplex<Dyadic> lp(pa, pb);
  return lp.solve() == HullSimplex<Dyadic>::Answer::separated ? separated : common;
}

Verdict resolve_sweep_exactly(const Bodies& a, const Bodies& b, const double* d, std::size_t row) {
  const auto pa = vertices_of<Dyadic>(a, row);
  auto pb = vertices_of<Dyadic>(b, row);
  const std::size_t n = pb.size();
  for (std::size_t j = 0; j < n; ++j) pb.push_back(shifted(pb[j], d, 1.0));
  HullSimplex<Dyadic> lp(pa, pb);
  return lp.solve() == HullSimplex<Dyadic>::Answer::separated ? separated : common;
}

double advance_exactly(const Bodies& a, const Bodies& b, const double* d, std::size_t row,
                       double* normal) {
  std::fill(normal, normal + 3, std::numeric_limits<double>::quiet_NaN());
  const auto pa = vertices_of<Dyadic>(a, row), start = vertices_of<Dyadic>(b, row);
  double time = 0.0;
  for (int step = 0; step < 200; ++step) {
    auto pb = start;
    for (auto& p : pb) p = shifted(p, d, time);
    HullSimplex<Dyadic> lp(pa, pb);
    if (lp.solve() != HullSimplex<Dyadic>::Answer::separated) return time;
    double offset;
    write_plane(lp, pa, pb, normal, &offset);
    const auto [high, low] = extent(pa, pb, normal);
    const Dyadic gap = low - high;
    const Dyadic closing = -projection(normal, {Dyadic(d[0]), Dyadic(d[1]), Dyadic(d[2])});
    if (gap.sign() <= 0 || closing.sign() <= 0)
      return time;  // the rounding error of the plane is as large as the gap
    const double next = std::nextafter(time + quotient(gap, closing) * (1 - 0x1p-46), 0.0);
    if (!(next > time) || next > 1.0) return std::min(1.0, std::max(time, next));
    time = next;
  }
  return time;
}

void find_witness(const Bodies& a, const Bodies& b, std::size_t row, Verdict known, double* out) {
  std::fill(out, out + 7, std::numeric_limits<double>::quiet_NaN());
  if (find_witness_quickly(a, b, row, known, out)) return;
  std::fill(out, out + 7, std::numeric_limits<double>::quiet_NaN());
  const auto pa = vertices_of<Dyadic>(a, row), pb = vertices_of<Dyadic>(b, row);
  HullSimplex<Dyadic> lp(pa, pb);
  if (lp.solve() == HullSimplex<Dyadic>::Answer::separated)
    write_plane(lp, pa, pb, out + 3, out + 6);
  else
    write_point(lp, pa, out);
}

}  // namespace tauguard::rigid
