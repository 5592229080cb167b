#include "impact_zone.hpp"

#include <algorithm>
#include <cmath>

namespace tauguard::contacts {
namespace {

// Pivots below this fraction of the largest one belong to rows that depend on others.
constexpr double dependent = 1e-10;

double dot(const double* a, const double* b, std::size_t n) {
  double sum = 0;
  for (std::size_t i = 0; i < n; ++i) sum += a[i] * b[i];
  return sum;
}

// Solves A x = b for a positive definite A (n, n), which becomes its Cholesky factor if `factor`.
void solve(std::vector<double>* matrix, std::size_t n, bool factor, double* x) {
  std::vector<double>& c = *matrix;
  for (std::size_t i = 0; factor && i < n; ++i)
    for (std::size_t j = 0; j <= i; ++j) {
      const double left = c[n * i + j] - dot(&c[n * i], &c[n * j], j);
      c[n * i + j] = i == j ? std::sqrt(left) : left / c[n * j + j];
    }
  for (std::size_t i = 0; i < n; ++i) x[i] = (x[i] - dot(&c[n * i], x, i)) / c[n * i + i];
  for (std::size_t i = n; i-- > 0;) {
    for (std::size_t k = i + 1; k < n; ++k) x[i] -= c[n * k + i] * x[k];
    x[i] /= c[n * i + i];
  }
}

// The shortest least-squares solution of A x = b for a positive semidefinite A (n, n). With pivoted
// Cholesky A = L L', where L has full rank, the pseudo-inverse of A is L (L' L)^-2 L'.
std::vector<double> least_squares(const std::vector<double>& a, const std::vector<double>& b) {
  const std::size_t n = b.size();
  std::vector<double> left(n), l, y;  // l: columns of L, one after the other
  for (std::size_t i = 0; i < n; ++i) left[i] = a[(n + 1) * i];
  const double least = dependent * *std::max_element(left.begin(), left.end());
  std::size_t rank = 0;
  for (; rank < n; ++rank) {
    const std::size_t p = std::max_element(left.begin(), left.end()) - left.begin();
    if (!(left[p] > least)) break;
    const double pivot = std::sqrt(left[p]);
    l.resize(n * (rank + 1), 0);
    for (std::size_t i = 0; i < n; ++i) {
      if (left[i] == -INFINITY) continue;  // was a pivot
      double sum = a[n * p + i];
      for (std::size_t k = 0; k < rank; ++k) sum -= l[n * k + p] * l[n * k + i];
      l[n * rank + i] = i == p ? pivot : sum / pivot;
      left[i] -= l[n * rank + i] * l[n * rank + i];
    }
    left[p] = -INFINITY;
  }
  std::vector<double> square(rank * rank), x(n, 0);
  for (std::size_t i = 0; i < rank; ++i) {
    y.push_back(dot(&l[n * i], b.data(), n));
    for (std::size_t j = 0; j < rank; ++j) square[rank * i + j] = dot(&l[n * i], &l[n * j], n);
  }
  solve(&square, rank, true, y.data()), solve(&square, rank, false, y.data());
  for (std::size_t k = 0; k < rank; ++k)
    for (std::size_t i = 0; i < n; ++i) x[i] += l[n * k + i] * y[k];
  return x;
}

bool finite(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

}  // namespace

ImpactZone::ImpactZone(const Engine& engine, const Mocap& mocap, double length)
    : e_(engine), mocap_(mocap), length_(length), free_(engine.qvel, engine.qvel + engine.nv) {}

bool ImpactZone::add(int pair, const Partners& partners,
                     const std::vector<std::int32_t>& vertices) {
  if (!added_.emplace(pair, vertices).second) return false;
  begin_.push_back(carried_.size());
  const Place &one = partners.first, &other = partners.second;
  const int geom = other.kind == Place::geom ? e_.geom_bodyid[other.number] : -1;
  if (one.kind == Place::geom) {
    const int a = e_.geom_bodyid[one.number];
    const double* at = e_.xipos + 3 * (e_.body_dofnum[e_.body_weldid[a]] ? a : geom);
    add_rows(6, a, at, geom, at);
    return true;
  }
  for (const std::int32_t v : vertices) {
    const double *at = e_.flexvert_xpos + 3 * v, *first = e_.flexvert_xpos + 3 * vertices[0];
    if (geom >= 0)
      add_rows(3, e_.flex_vertbodyid[v], at, geom, at);
    else if (v != vertices[0])
      add_rows(3, e_.flex_vertbodyid[v], at, e_.flex_vertbodyid[vertices[0]], first);
  }
  return true;
}

// Adds the motion of a point of body a relative to a point of body b: three rows of linear motion
// and, if `count` is 6, three of rotation. A vertex between the nodes of a flex has no body (-1).
void ImpactZone::add_rows(int count, int a, const double* at_a, int b, const double* at_b) {
  if (a < 0 || b < 0) return;
  const std::size_t nv = e_.nv;
  std::vector<double> of_a(6 * nv, 0), of_b(6 * nv, 0);
  e_.jac(e_.model, e_.data, of_a.data(), of_a.data() + 3 * nv, at_a, a);
  e_.jac(e_.model, e_.data, of_b.data(), of_b.data() + 3 * nv, at_b, b);
  const Vec3 carried[] = {mocap_.displacement(a, at_a) - mocap_.displacement(b, at_b),
                          mocap_.turn(a) - mocap_.turn(b)};
  // The largest entries of linear motion and of rotation. A linear one is a product of an axis and
  // a lever, which is a difference of positions of about the size `far`. 64 u covers 32 operations
  // on them for each body. Rows below this are zero: a point on the axis of its joint does not
  // move.
  double most[2] = {0, 0}, far = 0;
  for (std::size_t i = 0; i < 6 * nv; ++i) {
    double& m = most[i / (3 * nv)];
    m = std::max({m, std::fabs(of_a[i]), std::fabs(of_b[i])});
    of_a[i] -= of_b[i];
  }
  for (int k = 0; k < 3; ++k) far = std::max({far, std::fabs(at_a[k]), std::fabs(at_b[k])});
  const double rounded[] = {64 * unit_roundoff * (most[0] + far * most[1]),
                            64 * unit_roundoff * most[1]};
  for (int k = 0; k < count; ++k) {
    const auto row = of_a.begin() + k * nv;
    const double least = rounded[k / 3];
    if (std::all_of(row, row + nv, [&](double v) { return std::fabs(v) <= least; })) continue;
    rows_.insert(rows_.end(), row, row + nv);
    carried_.push_back(carried[k / 3][k % 3] / length_);
  }
}

// Multiplies the rows of each pair by a power of two that brings their largest inverse inertia into
// [1, 4), so that the rows of heavy bodies do not count as dependent beside those of light ones.
void ImpactZone::scale(std::vector<double>* square, std::vector<double>* speeds,
                       std::vector<double>* factors) const {
  const std::size_t n = carried_.size();
  factors->assign(n, 1);
  for (std::size_t k = 0; k < begin_.size(); ++k) {
    const std::size_t end = k + 1 < begin_.size() ? begin_[k + 1] : n;
    double most = 0;
    for (std::size_t i = begin_[k]; i < end; ++i) most = std::max(most, (*square)[(n + 1) * i]);
    if (!(most > 0)) continue;
    const double factor = std::ldexp(1.0, -(std::ilogb(most) >> 1));
    std::fill(factors->begin() + begin_[k], factors->begin() + end, factor);
  }
  for (std::size_t i = 0; i < n; ++i) {
    (*speeds)[i] *= (*factors)[i];
    for (std::size_t j = 0; j < n; ++j) (*square)[n * i + j] *= (*factors)[i] * (*factors)[j];
  }
}

// With the mocap velocity c and the impulses S: J M^-1 J' S = J v + c; mocap bodies do the work S
// c.
bool ImpactZone::join(double* work) {
  const std::size_t nv = e_.nv, n = carried_.size();
  *work = 0;
  std::copy(free_.begin(), free_.end(), e_.qvel);
  if (!n) return true;
  weighted_.resize(n * nv);
  e_.solve_m(e_.model, e_.data, weighted_.data(), rows_.data(), static_cast<int>(n));
  std::vector<double> square(n * n), joined = free_, speeds = carried_;
  for (std::size_t i = 0; i < n; ++i) {
    speeds[i] += dot(&rows_[nv * i], free_.data(), nv);
    for (std::size_t j = 0; j < n; ++j)
      square[n * i + j] = dot(&rows_[nv * i], &weighted_[nv * j], nv);
  }
  if (!finite(square) || !finite(speeds)) return false;
  std::vector<double> factors;
  scale(&square, &speeds, &factors);
  std::vector<double> impulses = least_squares(square, speeds);
  for (std::size_t i = 0; i < n; ++i) {
    impulses[i] *= factors[i];
    *work += impulses[i] * carried_[i];
    for (std::size_t k = 0; k < nv; ++k) joined[k] -= impulses[i] * weighted_[nv * i + k];
  }
  if (!finite(joined)) return false;
  std::copy(joined.begin(), joined.end(), e_.qvel);
  return true;
}

}  // namespace tauguard::contacts
