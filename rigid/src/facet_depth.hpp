// The shortest translation that separates two overlapping bodies, by a search over all facets of
// their difference. Facets have the normals of both bodies' faces and of all pairs of edges.
#pragma once

#include <algorithm>
#include <cmath>

#include "tauguard/rigid/moving_body.hpp"

namespace tauguard::rigid {

// Edges of a parallelepiped or of a hull of at most four points, and the pairs of edges that span
// its faces. The relative error of an edge is at most 4 u.
struct BodyEdges {
  Vec3 edge[6];
  int ends[6][2];  // the vertices at the ends of each edge
  int edges = 0, faces = 0;
  int face[4][2];
  bool parallel = false;  // opposite faces are parallel
};

inline bool edges_of(const Bodies& bodies, std::size_t row, BodyEdges* out) {
  const double* p = bodies.row(row);
  if (bodies.kind == Kind::boxes || bodies.kind == Kind::parallelepipeds) {
    const Zonotope z = zonotope_of(bodies.kind, p);
    for (int i = 0; i < 3; ++i) {
      out->edge[i] = geometry::load(z.g[i]);
      out->ends[i][0] = 0, out->ends[i][1] = 1 << i;
      out->face[i][0] = i, out->face[i][1] = (i + 1) % 3;
    }
    out->edges = out->faces = 3, out->parallel = true;
    return true;
  }
  const int n = static_cast<int>(bodies.vertex_count(row));
  if (bodies.kind == Kind::polygons || n > 4) return false;
  // The edges 01, 02, 12, 03, 13, 23 between the n vertices; the faces are 012, 013, 023, 123.
  for (int j = 1; j < n; ++j)
    for (int i = 0; i < j; ++i, ++out->edges) {
      out->edge[out->edges] = geometry::load(p + 3 * j) - geometry::load(p + 3 * i);
      out->ends[out->edges][0] = i, out->ends[out->edges][1] = j;
    }
  constexpr int pairs[4][2] = {{0, 1}, {0, 3}, {1, 3}, {2, 4}};
  out->faces = n == 4 ? 4 : n == 3 ? 1 : 0;
  for (int f = 0; f < out->faces; ++f) std::copy_n(pairs[f], 2, out->face[f]);
  return true;
}

// Bounds on the depth. Let n be a unit vector, and call n . y the height of a difference y. The
// largest height of all differences is the top. The size is the largest coordinate.
// 1. Upper bound: the top is the length of a translation along n that separates the bodies.
// 2. Lower bound: the distance of a facet from the origin is at least the least height of its
//    vertices, for any n. The computed normal of a facet has an angle of at most 16 u / s to the
//    true one, where s is the sine of the angle between its edges. So the vertices of the facet are
//    among the differences whose height is at most 128 u / s times the size below the top.
// 3. If the origin is inside the difference, the point nearest to it in the plane of the nearest
//    facet is in this facet. The depth is then between the least lower bound and the least top.
// 4. The origin is inside if it is below the true plane of every facet. A top of more than 128 u /
//    s times the size is enough for this: turning n to the true normal changes the top by at most
//    the angle times the largest difference, which is 2 sqrt(3) times the size.
class FacetDepth {
 public:
  FacetDepth(const Points<double>& a, const Points<double>& b, double size)
      : a_(a), b_(b), size_(size) {}

  // False if the sign is uncertain or the bounds of the depth differ by more than `slack`. Sets
  // `apart` if the bodies are certainly apart.
  bool solve(const BodyEdges& ea, const BodyEdges& eb, double slack) {
    for (const BodyEdges* e : {&ea, &eb})
      for (int f = 0; f < e->faces; ++f)
        if (!consider(e->edge[e->face[f][0]], e->edge[e->face[f][1]], false)) return false;
    for (int i = 0; i < ea.edges; ++i)
      for (int j = 0; j < eb.edges; ++j)
        if (!consider(ea.edge[i], eb.edge[j], ea.parallel && eb.parallel)) return false;
    return way > 0 && way < INFINITY && low_ >= way - slack;
  }

  double way = INFINITY;
  Vec3 normal{};  // unit, from a to b; if b moves by `way` along it, the bodies just touch
  bool apart = false;

 private:
  // If two edges of parallelepipeds enclose a sine of at most 2^-49, changing one edge by this
  // fraction of its length makes them parallel, so that they span no facet. The edges of one body
  // add up to at most 3 times the size.
  bool consider(const Vec3& x, const Vec3& y, bool may_skip) {
    const Vec3 c = cross(x, y);
    const double length = norm(c), both = norm(x) * norm(y);
    if (!(length > 0x1p-49 * both)) return may_skip;
    const double slack = 0x1p-46 * (both / length) * size_;
    const Vec3 n = (1 / length) * c;
    const Range ra = range(a_, n), rb = range(b_, n);
    return bound(n, ra.high - rb.low, slack) && bound(-1.0 * n, rb.high - ra.low, slack);
  }

  struct Range {
    double low = INFINITY, high = -INFINITY;
  };
  static Range range(const Points<double>& points, const Vec3& n) {
    Range r;
    for (const Vec3& p : points) {
      const double x = dot(n, p);
      r.low = std::min(r.low, x), r.high = std::max(r.high, x);
    }
    return r;
  }

  bool bound(const Vec3& n, double top, double slack) {
    if (top < way) way = top, normal = n;
    if (!(top > slack)) {
      apart = top < -slack;
      return false;
    }
    if (top - 2 * slack >= std::min(low_, way)) return true;
    low_ = std::min(low_, top - spread(a_, n, slack) - spread(b_, -1.0 * n, slack));
    return true;
  }

  // The largest distance below the top, among the vertices within `slack` of the top.
  static double spread(const Points<double>& points, const Vec3& n, double slack) {
    const double top = range(points, n).high;
    double most = 0;
    for (const Vec3& p : points) {
      const double below = top - dot(n, p);
      if (below <= slack) most = std::max(most, below);
    }
    return most;
  }

  const Points<double>&a_, &b_;
  const double size_;
  double low_ = INFINITY;
};

}  // namespace tauguard::rigid
