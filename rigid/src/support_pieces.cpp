#include "support_pieces.hpp"

#include <algorithm>
#include <array>
#include <cstring>

namespace tauguard::rigid {
namespace {

constexpr int most_pieces = 3;  // active pieces of one shape
constexpr int most_rounds = 30;

// Solves the square system m x = r by elimination with pivots. An unknown that nothing determines
// becomes 0: among equally good directions the present one is kept.
template <int N>
void solve(double (&m)[N][N], double (&r)[N], int size) {
  for (int k = 0; k < size; ++k) {
    int pivot = k;
    for (int i = k + 1; i < size; ++i)
      if (std::fabs(m[i][k]) > std::fabs(m[pivot][k])) pivot = i;
    if (!(std::fabs(m[pivot][k]) > 1e-13)) {
      for (int i = 0; i < size; ++i) m[i][k] = 0;
      for (int j = k; j < size; ++j) m[k][j] = 0;
      m[k][k] = 1, r[k] = 0;
      continue;
    }
    if (pivot != k) {
      for (int j = k; j < size; ++j) std::swap(m[k][j], m[pivot][j]);
      std::swap(r[k], r[pivot]);
    }
    for (int i = k + 1; i < size; ++i) {
      const double f = m[i][k] / m[k][k];
      for (int j = k; j < size; ++j) m[i][j] -= f * m[k][j];
      r[i] -= f * r[k];
    }
  }
  for (int k = size - 1; k >= 0; --k) {
    for (int j = k + 1; j < size; ++j) r[k] -= m[k][j] * r[j];
    r[k] /= m[k][k];
  }
}

// The active pieces of one shape along `sign` n.
struct Active {
  const SupportShape& shape;
  double sign;
  int count = 0;
  int id[most_pieces];
  double weight[most_pieces];
  Vec3 point[most_pieces];

  Active(const SupportShape& shape, double sign) : shape(shape), sign(sign) {}
  void move_to(const Vec3& n) {
    for (int i = 0; i < count; ++i) point[i] = shape.point_of(id[i], sign * n);
  }
  bool holds(int piece) const { return std::find(id, id + count, piece) != id + count; }
  bool add(int piece, double share) {
    if (count == most_pieces) return false;
    id[count] = piece, weight[count] = share, ++count;
    return true;
  }
  void drop(int i) {
    --count;
    for (int k = i; k < count; ++k)
      id[k] = id[k + 1], weight[k] = weight[k + 1], point[k] = point[k + 1];
  }
  int lightest() const { return int(std::min_element(weight, weight + count) - weight); }
  Vec3 mean() const {
    Vec3 sum{};
    for (int i = 0; i < count; ++i) sum += weight[i] * point[i];
    return sum;
  }
};

// Two unit vectors perpendicular to the unit vector n and to each other.
std::array<Vec3, 2> tangents(const Vec3& n) {
  Vec3 side{};
  side[geometry::smallest_axis(n)] = 1;
  const Vec3 u = cross(n, side), v = (1 / norm(u)) * u;
  return {v, cross(n, v)};
}

class Stationary {
 public:
  // Starts with the pieces that are highest along n, and along directions at the angle `tilt` to
  // it.
  Stationary(const SupportShape& a, const SupportShape& b, const Vec3& n, double tilt)
      : a_(a, 1), b_(b, -1), n_(n) {
    const std::array<Vec3, 2> t = tangents(n);
    a_.add(a.piece(n), 1), b_.add(b.piece(-1.0 * n), 1);
    for (int k = 0; k < 4 && tilt > 0; ++k) {
      const Vec3 m = n + (k & 1 ? tilt : -tilt) * t[k / 2];
      for (Active* shape : {&a_, &b_}) {
        const int piece = shape->shape.piece(shape->sign * m);
        if (a_.count + b_.count < 4 && !shape->holds(piece)) shape->add(piece, 0);
      }
    }
    for (Active* shape : {&a_, &b_})
      for (int i = 0; i < shape->count; ++i) shape->weight[i] = 1.0 / shape->count;
  }

  bool run(double size) {
    for (int round = 0; round < most_rounds; ++round) {
      a_.move_to(n_), b_.move_to(n_);
      double step;
      if (!newton(size, &step)) return false;
      a_.move_to(n_), b_.move_to(n_);
      const bool changed = update(size);
      if (!changed && step < 1e-9) return true;
    }
    return false;
  }
  const Vec3& n() const { return n_; }
  Vec3 on_a() const { return a_.mean(); }
  Vec3 on_b() const { return b_.mean(); }

 private:
  // One step for n and the weights. Unknowns: the step in the tangent plane (2), the weights of
  // both shapes, and the heights of both. Lengths are divided by `size`.
  bool newton(double size, double* step) {
    const std::array<Vec3, 2> t = tangents(n_);
    constexpr int most = 4 + 2 * most_pieces;
    const int ca = a_.count, cb = b_.count, size_of_system = 4 + ca + cb;
    double m[most][most] = {}, r[most] = {};
    const double s = dot(n_, b_.mean() - a_.mean()) / size;
    for (int x = 0; x < 2; ++x) {
      for (int y = 0; y < 2; ++y) {
        double k = x == y ? s : 0;
        for (const Active* shape : {&a_, &b_})
          for (int i = 0; i < shape->count; ++i)
            k += shape->weight[i] / size *
                 shape->shape.curvature(shape->id[i], shape->sign * n_, t[x], t[y]);
        m[x][y] = k;
      }
      for (int i = 0; i < ca; ++i) m[x][2 + i] = dot(t[x], a_.point[i] - a_.point[0]) / size;
      for (int j = 0; j < cb; ++j) m[x][2 + ca + j] = -dot(t[x], b_.point[j] - b_.point[0]) / size;
      r[x] = dot(t[x], b_.point[0] - a_.point[0]) / size;
    }
    int row = 2;
    const auto equal_heights = [&](const Active& shape, int column) {
      for (int i = 1; i < shape.count; ++i, ++row) {
        const Vec3 e = shape.point[i] - shape.point[0];
        for (int x = 0; x < 2; ++x) m[row][x] = dot(t[x], e) / size;
        r[row] = -dot(n_, e) / size;
      }
      for (int i = 0; i < shape.count; ++i) m[row][column + i] = 1;
      r[row++] = 1;
    };
    equal_heights(a_, 2), equal_heights(b_, 2 + ca);
    solve(m, r, size_of_system - 2);
    *step = std::hypot(r[0], r[1]);
    if (!std::isfinite(*step)) return false;
    const double scale = std::min(1.0, 0.3 / *step);
    const Vec3 moved = n_ + scale * (r[0] * t[0] + r[1] * t[1]);
    n_ = (1 / norm(moved)) * moved;
    for (int i = 0; i < ca; ++i) a_.weight[i] = r[2 + i];
    for (int j = 0; j < cb; ++j) b_.weight[j] = r[2 + ca + j];
    return true;
  }

  // Drops a piece of negative weight, and adds a piece that is higher than the active ones.
  bool update(double size) {
    bool changed = false;
    for (Active* shape : {&a_, &b_}) {
      const int light = shape->lightest();
      if (shape->weight[light] < -1e-9) {
        shape->drop(light);
        double sum = 0;
        for (int i = 0; i < shape->count; ++i) sum += std::max(0.0, shape->weight[i]);
        for (int i = 0; i < shape->count; ++i)
          shape->weight[i] = sum > 0 ? std::max(0.0, shape->weight[i]) / sum : 1.0 / shape->count;
        changed = true;
      }
      const Vec3 d = shape->sign * n_;
      const int piece = shape->shape.piece(d);
      if (shape->holds(piece)) continue;
      double high = -INFINITY;
      for (int i = 0; i < shape->count; ++i) high = std::max(high, dot(d, shape->point[i]));
      const Vec3 other = shape->shape.point_of(piece, d);
      if (!(dot(d, other) > high + 1e-14 * size)) continue;
      if (!shape->add(piece, 0)) shape->drop(shape->lightest()), shape->add(piece, 0);
      shape->point[shape->count - 1] = other;
      changed = true;
    }
    while (a_.count + b_.count > 4) {  // two conditions determine a direction
      Active& shape = a_.count > b_.count ? a_ : b_;
      shape.drop(shape.lightest());
    }
    return changed;
  }

  Active a_, b_;
  Vec3 n_;
};

void sharpen_from(const SupportShape& a, const SupportShape& b, double size, const Vec3& start,
                  double tilt, Distance* d) {
  Stationary search(a, b, start, tilt);
  if (!search.run(size)) return;
  const Vec3 n = search.n();
  const double s = dot(n, b.support(-1.0 * n) - a.support(n));
  if (!(s >= d->lower - 1e-15 * size)) return;
  const Vec3 way = search.on_b() - search.on_a();
  if (!(norm(way - s * n) <= 1e-9 * size)) return;
  d->lower = s, d->n = n, d->on_a = search.on_a(), d->on_b = search.on_b(), d->upper = norm(way);
}

}  // namespace

bool sharpen(const SupportShape& a, const SupportShape& b, double size, Distance* d) {
  const Vec3 way = d->on_b - d->on_a;
  const double length = norm(way), lower = d->lower,
               tilt = std::sqrt(std::max(0.0, d->upper - lower) / size);
  const Vec3 starts[2] = {d->n, length > 0 ? (1 / length) * way : d->n};
  const Distance before = *d;
  for (const double angle : {0.0, std::min(tilt, 0.3), 1e-3, 1e-5, 1e-2, 1e-4, 0.1})
    for (const Vec3& start : starts) {
      sharpen_from(a, b, size, start, angle, d);
      const bool improved = !(d->on_a == before.on_a && d->on_b == before.on_b);
      if (improved && std::fabs(d->upper - std::fabs(d->lower)) <= 1e-12 * size) return true;
    }
  return !(d->on_a == before.on_a && d->on_b == before.on_b);
}

}  // namespace tauguard::rigid
