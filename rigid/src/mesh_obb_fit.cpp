// Fits the oriented boxes of a tree in one backward pass over its nodes.
#include <algorithm>

#include "mesh_obb.hpp"
#include "symmetric.hpp"
#include "tauguard/geometry/lanes.hpp"

namespace tauguard::rigid {

using namespace geometry;  // lanes.hpp
namespace {

// Surface moments about the tree's centre: twice the area, and the integrals of x and x x^T times
// constant factors. The factors are the same for all triangles, so moments of a union are sums.
struct Moments {
  double weight = 0, first[3] = {}, second[6] = {};  // second: xx, xy, xz, yy, yz, zz
  void add(const Moments& o) {
    weight += o.weight;
    for (int k = 0; k < 3; ++k) first[k] += o.first[k];
    for (int k = 0; k < 6; ++k) second[k] += o.second[k];
  }
};

// The corners of all triangles in leaf order, relative to the tree's centre, by coordinate.
struct Corners {
  std::vector<float> x[3];
  explicit Corners(const Tree& tree) {
    for (int k = 0; k < 3; ++k) {
      x[k].resize(3 * tree.triangles.size());
      float* out = x[k].data();
      for (const Triangle& t : tree.triangles)
        for (const auto& v : t.v) *out++ = static_cast<float>(v[k] - tree.centre[k]);
    }
  }
};

struct Run {
  std::int32_t begin, end;  // of triangles
};

struct Span {
  float lo[3], hi[3];
};

// Bounds of corners [begin, end) along three axes; at least eight corners.
TAUGUARD_CLONES Span span_wide(const float* x, const float* y, const float* z, std::size_t count,
                               const float axis[3][3]) {
  Float8 lo[3], hi[3];
  for (int i = 0; i < 3; ++i) lo[i] = (Float8){} + INFINITY, hi[i] = (Float8){} - INFINITY;
  for (std::size_t at = 0; at < count; at += 8) {
    const std::size_t from = std::min(at, count - 8);  // the last eight may repeat earlier corners
    Float8 p[3];
    std::memcpy(&p[0], x + from, sizeof p[0]);
    std::memcpy(&p[1], y + from, sizeof p[1]);
    std::memcpy(&p[2], z + from, sizeof p[2]);
    for (int i = 0; i < 3; ++i) {
      const Float8 h = (axis[i][0] * p[0] + axis[i][1] * p[1]) + axis[i][2] * p[2];
      lo[i] = h < lo[i] ? h : lo[i];
      hi[i] = h > hi[i] ? h : hi[i];
    }
  }
  Span out;
  for (int i = 0; i < 3; ++i) {
    out.lo[i] = lo[i][0], out.hi[i] = hi[i][0];
    for (int s = 1; s < 8; ++s)
      out.lo[i] = std::min(out.lo[i], lo[i][s]), out.hi[i] = std::max(out.hi[i], hi[i][s]);
  }
  return out;
}

Span span(const Corners& c, const Run& run, const float axis[3][3]) {
  const std::size_t begin = 3 * std::size_t(run.begin),
                    count = 3 * std::size_t(run.end - run.begin);
  const float *x = c.x[0].data() + begin, *y = c.x[1].data() + begin, *z = c.x[2].data() + begin;
  if (count >= 8) return span_wide(x, y, z, count, axis);
  Span out = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
  for (std::size_t n = 0; n < count; ++n)
    for (int i = 0; i < 3; ++i) {
      const float h = (axis[i][0] * x[n] + axis[i][1] * y[n]) + axis[i][2] * z[n];
      out.lo[i] = std::min(out.lo[i], h), out.hi[i] = std::max(out.hi[i], h);
    }
  return out;
}

// Sets centre and extents of `box` for its axes.
void bound(const Corners& corners, const Run& run, FloatObb* box) {
  const Span s = span(corners, run, box->axis);
  for (int k = 0; k < 3; ++k) {
    double c = 0;
    for (int i = 0; i < 3; ++i) c += 0.5 * (double(s.lo[i]) + s.hi[i]) * box->axis[i][k];
    box->centre[k] = static_cast<float>(c);
    box->extent[k] = 0.5f * (s.hi[k] - s.lo[k]);
  }
}

double dot(const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

void cross(const double* a, const double* b, double* out) {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

// Sets the axes from a normal and a second direction. Coordinate axes are used if one is zero.
void set_axes(const double* normal, const double* along, FloatObb* box) {
  const double nn = dot(normal, normal), part = dot(along, normal) / nn;
  const double flat[3] = {along[0] - part * normal[0], along[1] - part * normal[1],
                          along[2] - part * normal[2]};
  const double ff = dot(flat, flat);
  const bool proper = nn > 1e-200 && ff > 1e-6 * dot(along, along) && ff > 1e-200 &&
                      std::isfinite(nn) && std::isfinite(ff);
  double third[3];
  cross(normal, flat, third);
  const double a = 1 / std::sqrt(ff), b = 1 / std::sqrt(nn), c = a * b;
  for (int k = 0; k < 3; ++k) {
    box->axis[0][k] = static_cast<float>(proper ? a * flat[k] : k == 0);
    box->axis[1][k] = static_cast<float>(proper ? c * third[k] : k == 1);
    box->axis[2][k] = static_cast<float>(proper ? b * normal[k] : k == 2);
  }
}

// The moments of the triangles of a leaf. Also sets the axes of its box.
Moments leaf_moments(const Tree& tree, const Run& run, FloatObb* box) {
  Moments sum;
  double normal[3] = {}, longest[3] = {}, square = 0;
  for (auto i = run.begin; i < run.end; ++i) {
    double p[3][3], e[3][3], n[3];
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < 3; ++k) p[c][k] = tree.triangles[i].v[c][k] - tree.centre[k];
    for (int c = 0; c < 3; ++c) {
      for (int k = 0; k < 3; ++k) e[c][k] = p[(c + 1) % 3][k] - p[c][k];
      const double l = dot(e[c], e[c]);
      if (l > square) square = l, std::copy(e[c], e[c] + 3, longest);
    }
    cross(e[0], e[1], n);
    const double sign = dot(n, normal) < 0 ? -1 : 1, weight = std::sqrt(dot(n, n));
    double q[3];
    for (int k = 0; k < 3; ++k) normal[k] += sign * n[k], q[k] = p[0][k] + p[1][k] + p[2][k];
    // The integral of x x^T over a triangle is area / 12 (9 m m^T + sum p p^T), where p are its
    // corners, q is the sum of the corners, and m = q / 3 is the centroid.
    Moments m;
    m.weight = weight;
    for (int k = 0; k < 3; ++k) m.first[k] = weight / 3 * q[k];
    int at = 0;
    for (int k = 0; k < 3; ++k)
      for (int l = k; l < 3; ++l)
        m.second[at++] =
            weight / 12 * (q[k] * q[l] + p[0][k] * p[0][l] + p[1][k] * p[1][l] + p[2][k] * p[2][l]);
    sum.add(m);
  }
  set_axes(normal, longest, box);
  return sum;
}

// Sets the axes of `box` to the principal axes of the surface with these moments.
void principal_axes(const Moments& m, FloatObb* box) {
  double spread[3][3], axis[3][3];
  const double w = m.weight > 0 ? 1 / m.weight : 0;
  int at = 0;
  for (int k = 0; k < 3; ++k)
    for (int l = k; l < 3; ++l)
      spread[k][l] = spread[l][k] = w * (m.second[at++] - w * m.first[k] * m.first[l]);
  eigenvectors(spread, axis);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) box->axis[i][k] = static_cast<float>(axis[i][k]);
}

}  // namespace

ObbTree fit_obbs(const Tree& tree) {
  const Corners corners(tree);
  ObbTree out;
  out.nodes.resize(tree.nodes.size());
  std::vector<Moments> moments(tree.nodes.size());
  std::vector<Run> run(tree.nodes.size());
  // Children come after their parents, so a backward pass visits the children of a node first.
  for (std::size_t n = tree.nodes.size(); n-- > 0;) {
    const Node& node = tree.nodes[n];
    run[n] = {std::numeric_limits<std::int32_t>::max(), 0};
    for (int s = 0; s < width; ++s) {
      FloatObb box = {{}, {}, {-INFINITY, -INFINITY, -INFINITY}};
      const Child c = node.child[s];
      if (c != no_child) {
        const Run r = is_leaf(c) ? Run{leaf_first(c), leaf_first(c) + leaf_count(c)} : run[c];
        if (is_leaf(c))
          moments[n].add(leaf_moments(tree, r, &box));
        else
          moments[n].add(moments[c]), principal_axes(moments[c], &box);
        bound(corners, r, &box);
        run[n] = {std::min(run[n].begin, r.begin), std::max(run[n].end, r.end)};
      }
      out.nodes[n].set(s, box);
    }
  }
  principal_axes(moments[0], &out.root);
  bound(corners, run[0], &out.root);
  return out;
}

}  // namespace tauguard::rigid
