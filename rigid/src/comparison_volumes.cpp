#include "comparison_volumes.hpp"

#include "symmetric.hpp"
#include "tauguard/geometry/k_dop.hpp"

namespace tauguard::rigid {
namespace {

// A factor that covers the relative rounding error of each expression below.
constexpr double up = 1 + 0x1p-46;

double dot(const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

template <class Visit>
void each_corner(const Cluster& c, Visit visit) {
  for (const Triangle* t = c.begin; t != c.end; ++t)
    for (const auto& v : t->v) {
      const double p[3] = {v[0] - c.centre[0], v[1] - c.centre[1], v[2] - c.centre[2]};
      visit(p);
    }
}

// The projections of `p` on the axes of geometry/k_dop.hpp, in their order.
void project(const double* p, double* out) {
  out[0] = p[0], out[1] = p[1], out[2] = p[2];
  for (int i = 0; i < 2; ++i)
    for (int j = i + 1; j < 3; ++j) {
      out[geometry::edge_axis(i, j, false)] = p[i] + p[j];
      out[geometry::edge_axis(i, j, true)] = p[i] - p[j];
    }
}

double along(const std::int8_t* axis, const double* p) {
  return axis[0] * p[0] + axis[1] * p[1] + axis[2] * p[2];
}

// The index of the axis parallel to sx e_x + sy e_y (x != y). *flip is 1 if the two have the same
// direction, -1 if they are opposite.
int pair_index(int x, int y, double sx, double sy, double* flip) {
  if (x > y) std::swap(x, y), std::swap(sx, sy);
  *flip = sx;
  return geometry::edge_axis(x, y, sx * sy < 0);
}

// Interval [lo, hi] that contains the projection of `k` on the direction that `cone` represents.
void bounds(const KDop& k, const KDop::Cone& cone, double* lo, double* hi) {
  *lo = *hi = 0;
  for (int i = 0; i < 3; ++i) {
    const double w = cone.weight[i];
    const double l = k.lo[cone.index[i]], h = k.hi[cone.index[i]];
    *lo += w >= 0 ? w * l : w * h;
    *hi += w >= 0 ? w * h : w * l;
  }
}

}  // namespace

// The pad covers rounding: each result below comes from at most 40 operations on values of at most
// 3 (ra + rb), with ra and rb the radii of the trees, and 40 * 3 * 2^-53 < 2^-45.
Frame::Frame(const Tree& a, const Tree& b, const Pose& pose) {
  double skew = 0, largest = a.magnitude;
  for (int i = 0; i < 3; ++i) {
    t[i] =
        ((pose.r[i][0] * b.centre[0] + pose.r[i][1] * b.centre[1]) + pose.r[i][2] * b.centre[2]) +
        (pose.t[i] - a.centre[i]);
    largest = std::max(largest, 2 * b.magnitude + std::fabs(pose.t[i]));
    for (int j = 0; j < 3; ++j) {
      r[i][j] = pose.r[i][j];
      double d = i == j ? -1.0 : 0.0;
      for (int k = 0; k < 3; ++k) d += pose.r[k][i] * pose.r[k][j];
      skew = std::max(skew, std::fabs(d));
    }
  }
  const double reach = a.radius + b.radius + std::fabs(t[0]) + std::fabs(t[1]) + std::fabs(t[2]);
  pad = (0x1p-43 + 12 * skew) * reach + 0x1p-48 * largest;
}

Ball Ball::fit(const Cluster& c) {
  geometry::Aabb box;
  each_corner(c, [&](const double* p) { box.add(p); });
  Ball ball;
  for (int k = 0; k < 3; ++k) ball.centre[k] = 0.5 * (box.lo[k] + box.hi[k]);
  double square = 0;
  each_corner(c, [&](const double* p) {
    const double d[3] = {p[0] - ball.centre[0], p[1] - ball.centre[1], p[2] - ball.centre[2]};
    square = std::max(square, dot(d, d));
  });
  ball.radius = std::sqrt(square) * up;
  return ball;
}

bool Ball::meet(const Ball& a, const Ball& b, const Relation& at) {
  double c[3];
  at.apply(b.centre, c);
  const double d[3] = {c[0] - a.centre[0], c[1] - a.centre[1], c[2] - a.centre[2]};
  const double reach = a.radius + b.radius + at.pad;
  return dot(d, d) <= reach * reach * up;
}

Obb Obb::fit(const Cluster& c) {
  double mean[3] = {}, n = 0, spread[3][3] = {};
  each_corner(c, [&](const double* p) {
    for (int k = 0; k < 3; ++k) mean[k] += p[k];
    ++n;
  });
  for (double& m : mean) m /= n;
  each_corner(c, [&](const double* p) {
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) spread[i][j] += (p[i] - mean[i]) * (p[j] - mean[j]);
  });
  Obb box;
  eigenvectors(spread, box.axis);
  geometry::Aabb bound;
  each_corner(c, [&](const double* p) {
    const double q[3] = {dot(box.axis[0], p), dot(box.axis[1], p), dot(box.axis[2], p)};
    bound.add(q);
  });
  double middle[3];
  for (int k = 0; k < 3; ++k) {
    middle[k] = 0.5 * (bound.lo[k] + bound.hi[k]);
    box.extent[k] = 0.5 * (bound.hi[k] - bound.lo[k]) * up;
  }
  for (int k = 0; k < 3; ++k)
    box.centre[k] =
        box.axis[0][k] * middle[0] + box.axis[1][k] * middle[1] + box.axis[2][k] * middle[2];
  return box;
}

bool Obb::meet(const Obb& a, const Obb& b, const Relation& at) {
  double c[3], d[3], r[3][3], s[3][3];
  at.apply(b.centre, c);
  for (int k = 0; k < 3; ++k) c[k] -= a.centre[k];
  for (int i = 0; i < 3; ++i) {
    d[i] = dot(a.axis[i], c);
    const double* n = a.axis[i];
    const double turned[3] = {n[0] * at.r[0][0] + n[1] * at.r[1][0] + n[2] * at.r[2][0],
                              n[0] * at.r[0][1] + n[1] * at.r[1][1] + n[2] * at.r[2][1],
                              n[0] * at.r[0][2] + n[1] * at.r[1][2] + n[2] * at.r[2][2]};
    for (int j = 0; j < 3; ++j) r[i][j] = dot(turned, b.axis[j]), s[i][j] = std::fabs(r[i][j]);
  }
  for (int i = 0; i < 3; ++i) {
    if (std::fabs(d[i]) > a.extent[i] + dot(s[i], b.extent) + at.pad) return false;
    const double along = d[0] * r[0][i] + d[1] * r[1][i] + d[2] * r[2][i];
    const double reach = a.extent[0] * s[0][i] + a.extent[1] * s[1][i] + a.extent[2] * s[2][i];
    if (std::fabs(along) > reach + b.extent[i] + at.pad) return false;
  }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      const double reach = a.extent[i1] * s[i2][j] + a.extent[i2] * s[i1][j] +
                           b.extent[j1] * s[i][j2] + b.extent[j2] * s[i][j1];
      if (std::fabs(d[i2] * r[i1][j] - d[i1] * r[i2][j]) > reach + at.pad) return false;
    }
  return true;
}

KDop KDop::fit(const Cluster& c) {
  KDop k;
  std::fill(k.lo, k.lo + directions, INFINITY);
  std::fill(k.hi, k.hi + directions, -INFINITY);
  each_corner(c, [&](const double* p) {
    double h[directions];
    project(p, h);
    for (int i = 0; i < directions; ++i)
      k.lo[i] = std::min(k.lo[i], h[i]), k.hi[i] = std::max(k.hi[i], h[i]);
  });
  for (int i = 0; i < 3; ++i) k.centre[i] = 0.5 * (k.lo[i] + k.hi[i]);
  return k;
}

KDop::Cone KDop::Cone::around(const double* d) {
  int x = 0, y = 1, z = 2;  // sorted by falling |d|
  if (std::fabs(d[x]) < std::fabs(d[y])) std::swap(x, y);
  if (std::fabs(d[y]) < std::fabs(d[z])) std::swap(y, z);
  if (std::fabs(d[x]) < std::fabs(d[y])) std::swap(x, y);
  const double p = std::fabs(d[x]), q = std::fabs(d[y]), s = std::fabs(d[z]);
  const double sx = d[x] < 0 ? -1 : 1, sy = d[y] < 0 ? -1 : 1, sz = d[z] < 0 ? -1 : 1;
  Cone c;
  double flip[3];
  c.index[0] = pair_index(x, y, sx, sy, &flip[0]);
  c.index[1] = pair_index(x, z, sx, sz, &flip[1]);
  if (p >= q + s) {
    c.index[2] = x, flip[2] = sx;
    c.weight[0] = q, c.weight[1] = s, c.weight[2] = p - q - s;
  } else {
    c.index[2] = pair_index(y, z, sy, sz, &flip[2]);
    c.weight[0] = 0.5 * (p + q - s), c.weight[1] = 0.5 * (p + s - q),
    c.weight[2] = 0.5 * (q + s - p);
  }
  for (int i = 0; i < 3; ++i) c.weight[i] *= flip[i];
  return c;
}

KDop::Relation::Relation(const Tree& a, const Tree& b, const Pose& pose) : at(a, b, pose) {
  // `pad` is for unit directions. Directions of length up to sqrt 2 and weights with a sum of at
  // most sqrt 3 multiply an error by at most sqrt 6.
  at.pad *= 4;
  for (int k = 0; k < directions; ++k) {
    const auto* axis = geometry::k_dop_axes[k];
    double in_b[3], in_a[3];
    for (int i = 0; i < 3; ++i) {
      const double column[3] = {at.r[0][i], at.r[1][i], at.r[2][i]};
      in_b[i] = along(axis, column);
      in_a[i] = along(axis, at.r[i]);
    }
    a_from_b[k] = Cone::around(in_b);
    b_from_a[k] = Cone::around(in_a);
    shift_a[k] = along(axis, at.t);
    shift_b[k] = -dot(in_a, at.t);
  }
}

bool KDop::meet(const KDop& a, const KDop& b, const Relation& at) {
  double lo, hi;
  for (int k = 0; k < directions; ++k) {
    bounds(b, at.a_from_b[k], &lo, &hi);
    if (lo + at.shift_a[k] > a.hi[k] + at.at.pad || hi + at.shift_a[k] < a.lo[k] - at.at.pad)
      return false;
    bounds(a, at.b_from_a[k], &lo, &hi);
    if (lo + at.shift_b[k] > b.hi[k] + at.at.pad || hi + at.shift_b[k] < b.lo[k] - at.at.pad)
      return false;
  }
  return true;
}

template <class Volume>
std::vector<Volume> fit_all(const Tree& tree) {
  std::vector<Volume> out(1 + std::size_t(width) * tree.nodes.size());
  const Triangle* t = tree.triangles.data();
  out[0] = Volume::fit({t, t + tree.triangles.size(), tree.centre});
  // Children come after their parents, so a backward pass visits the children of a node first.
  std::vector<std::pair<int, int>> run(tree.nodes.size());
  for (std::size_t n = tree.nodes.size(); n-- > 0;) {
    const Node& node = tree.nodes[n];
    run[n] = {std::numeric_limits<int>::max(), 0};
    for (int s = 0; s < width && node.child[s] != no_child; ++s) {
      const Child c = node.child[s];
      const auto r =
          is_leaf(c) ? std::make_pair(leaf_first(c), leaf_first(c) + leaf_count(c)) : run[c];
      run[n] = {std::min(run[n].first, r.first), std::max(run[n].second, r.second)};
      out[1 + width * n + s] = Volume::fit({t + r.first, t + r.second, tree.centre});
    }
  }
  return out;
}

template std::vector<Ball> fit_all(const Tree&);
template std::vector<KDop> fit_all(const Tree&);

}  // namespace tauguard::rigid
