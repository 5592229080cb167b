#include "convex_resolve.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "convex_simplex.hpp"

namespace tauguard::rigid {

namespace {

// numerator / denominator to about 50 bits, whatever their exponents.
double quotient(const Dyadic& numerator, const Dyadic& denominator) {
  if (numerator.is_zero()) return 0.0;
  const auto n = numerator.floor_log2(), d = denominator.floor_log2();
  const double q = numerator.scaled(-n).to_double() / denominator.scaled(-d).to_double();
  return std::ldexp(q, static_cast<int>(std::clamp<std::int64_t>(n - d, -5000, 5000)));
}

Dyadic projection(const double* n, const std::array<Dyadic, 3>& p) {
  return Dyadic(n[0]) * p[0] + Dyadic(n[1]) * p[1] + Dyadic(n[2]) * p[2];
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
  Dyadic high = projection(normal, a[0]), low = projection(normal, b[0]);
  for (const auto& p : a) {
    const Dyadic x = projection(normal, p);
    if (high < x) high = x;
  }
  for (const auto& p : b) {
    const Dyadic x = projection(normal, p);
    if (x < low) low = x;
  }
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

}  // namespace

Verdict resolve_exactly(const Bodies& a, const Bodies& b, std::size_t row) {
  const auto pa = vertices_of<Dyadic>(a, row), pb = vertices_of<Dyadic>(b, row);
  HullSimplex<Dyadic> lp(pa, pb);
  return lp.solve() == HullSimplex<Dyadic>::Answer::separated ? separated : common;
}

void find_witness(const Bodies& a, const Bodies& b, std::size_t row, double* out) {
  std::fill(out, out + 7, std::numeric_limits<double>::quiet_NaN());
  const auto pa = vertices_of<Dyadic>(a, row), pb = vertices_of<Dyadic>(b, row);
  HullSimplex<Dyadic> lp(pa, pb);
  if (lp.solve() == HullSimplex<Dyadic>::Answer::separated)
    write_plane(lp, pa, pb, out + 3, out + 6);
  else
    write_point(lp, pa, out);
}

}  // namespace tauguard::rigid
