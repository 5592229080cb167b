#include "travel.hpp"

#include <algorithm>
#include <cmath>

namespace tauguard::contacts {
namespace {

double apart(const double* a, const double* b, int n) {
  double sum = 0;
  for (int i = 0; i < n; ++i) sum += (b[i] - a[i]) * (b[i] - a[i]);
  return std::sqrt(sum);
}

}  // namespace

double Travel::flex(int number, const double* x_t0, const double* x_t1) const {
  double most = 0;
  for (int v = vertex_begin_[number]; v < vertex_end_[number]; ++v)
    most = std::max(most, apart(x_t0 + 3 * v, x_t1 + 3 * v, 3));
  return most;
}

double Travel::rigid(int geom, const double* point, const Poses& p) const {
  const int body = body_of_geom_[geom];
  const double *x0 = p.xpos_t0 + 3 * body, *x1 = p.xpos_t1 + 3 * body;
  const double shift = apart(x0, x1, 3);
  // At least the chord that a point one metre away makes.
  const double turn = apart(p.xmat_t0 + 9 * body, p.xmat_t1 + 9 * body, 9);
  return shift + turn * (apart(x0, point, 3) + shift);
}

void Travel::bound(const std::int32_t* geom, const std::int32_t* flex_of, const double* point,
                   std::size_t count, const Poses& p, const double* x_t0, const double* x_t1,
                   double* way, double* core) const {
  std::vector<double> sheets(vertex_begin_.size(), -1);
  for (std::size_t i = 0; i < count; ++i) {
    way[i] = core[i] = 0;
    for (int side = 0; side < 2; ++side) {
      const int g = geom[2 * i + side], f = flex_of[2 * i + side];
      if (g >= 0) {
        way[i] += rigid(g, point + 3 * i, p), core[i] += inner_[g];
        continue;
      }
      if (sheets[f] < 0) sheets[f] = flex(f, x_t0, x_t1);
      way[i] += sheets[f], core[i] += flex_radius_[f];
    }
  }
}

}  // namespace tauguard::contacts
