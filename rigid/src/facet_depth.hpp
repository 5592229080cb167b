// The shortest translation that separates two overlapping bodies, by a search over all facets of
// their difference. Facets have the normals of both bodies' faces and of all pairs of edges.
#pragma once

#include <algorithm>
#include <cmath>

#include "convex_lanes.hpp"
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
  TAUGUARD_INLINE bool solve(const BodyEdges& ea, const BodyEdges& eb, double slack) {
    for (const BodyEdges* e : {&ea, &eb}) {
      const int last = e->faces - 1;
      if (last >= 0 &&
          !consider(lanes(*e, [&](int f) { return e->face[std::min(f, last)][0]; }),
                    lanes(*e, [&](int f) { return e->face[std::min(f, last)][1]; }), false))
        return false;
    }
    Edges y[2];
    for (int k = 0; 4 * k < eb.edges; ++k)
      y[k] = lanes(eb, [&](int j) { return std::min(4 * k + j, eb.edges - 1); });
    for (int i = 0; i < ea.edges; ++i) {
      const Edges x = lanes(ea, [&](int) { return i; });
      for (int k = 0; 4 * k < eb.edges; ++k)
        if (!consider(x, y[k], ea.parallel && eb.parallel)) return false;
    }
    return way > 0 && way < INFINITY && lower_bound() >= way - slack;
  }

  double way = INFINITY;
  Vec3 normal{};  // unit, from a to b; if b moves by `way` along it, the bodies just touch
  bool apart = false;

 private:
  struct Edges {
    Vec3x4 edge;
    Double4 length;
  };
  // Four facets and their opposites.
  struct Facets {
    Vec3x4 normal;
    Double4 top[2], slack;
  };

  // Four edges of a body, which number(lane) lists. Repeated ones change nothing.
  template <class Number>
  static TAUGUARD_INLINE Edges lanes(const BodyEdges& body, const Number& number) {
    Edges out;
    for (int lane = 0; lane < 4; ++lane) {
      const Vec3& e = body.edge[number(lane)];
      out.edge.x[lane] = e.x, out.edge.y[lane] = e.y, out.edge.z[lane] = e.z;
    }
    out.length = sqrt(dot(out.edge, out.edge));
    return out;
  }

  // If two edges of parallelepipeds enclose a sine of at most 2^-49, changing one edge by this
  // fraction of its length makes them parallel, so that they span no facet. The edges of one body
  // add up to at most 3 times the size.
  TAUGUARD_INLINE bool consider(const Edges& x, const Edges& y, bool may_skip) {
    const Vec3x4 c = cross(x.edge, y.edge);
    const Double4 length = sqrt(dot(c, c)), both = x.length * y.length;
    const Mask4 spans = length > 0x1p-49 * both;
    if (!may_skip && !all(spans)) return false;
    Facets& f = facets_[count_++];
    const Double4 scale = 1 / length;
    f.normal = scale * c;
    f.slack = spans ? 0x1p-46 * (both * scale) * size_ : Double4{};
    const Range4 ra = range(a_, f.normal), rb = range(b_, f.normal);
    f.top[0] = spans ? ra.high - rb.low : splat(INFINITY);
    f.top[1] = spans ? rb.high - ra.low : splat(INFINITY);
    const Double4 least = min(f.top[0], f.top[1]);
    apart = any(least < -f.slack);
    way = std::min(way, -largest(-least));
    return all(least > f.slack);
  }

  // The least lower bound of all facets that have one below `way`. Sets `normal`.
  TAUGUARD_INLINE double lower_bound() {
    double low = INFINITY;
    bool known = false;
    for (const Facets* f = facets_; f < facets_ + count_; ++f) {
      if (!any(min(f->top[0], f->top[1]) - 2 * f->slack < way)) continue;
      for (int lane = 0; lane < 4; ++lane)
        for (int back = 0; back < 2; ++back) {
          const double top = f->top[back][lane], slack = f->slack[lane];
          if (top - 2 * slack >= way) continue;
          const Vec3 n =
              (back ? -1.0 : 1.0) * Vec3{f->normal.x[lane], f->normal.y[lane], f->normal.z[lane]};
          if (top == way && !known) normal = n, known = true;
          low = std::min(low, top - spread(a_, n, slack) - spread(b_, -1.0 * n, slack));
        }
    }
    return low;
  }

  // The largest distance below the top, among the vertices within `slack` of the top.
  static double spread(const Points<double>& points, const Vec3& n, double slack) {
    double top = -INFINITY, most = 0;
    for (const Vec3& p : points) top = std::max(top, dot(n, p));
    for (const Vec3& p : points) {
      const double below = top - dot(n, p);
      if (below <= slack) most = std::max(most, below);
    }
    return most;
  }

  const Points<double>&a_, &b_;
  const double size_;
  Facets facets_[14];
  int count_ = 0;
};

}  // namespace tauguard::rigid
