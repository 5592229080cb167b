// The penetration depth of two touching or overlapping bodies in exact arithmetic. It visits only
// the facets of their difference that double precision leaves undecided.
#pragma once

#include <vector>

#include "facet_depth.hpp"

namespace tauguard::rigid {

// Let one of the bodies have full dimension. Every facet of their difference has the normal of a
// face of a body, or of a pair of edges. The bodies are apart if and only if one of these normals
// separates them (Gottschalk, Lin and Manocha 1996). Otherwise the depth is the least height over
// these normals n, where the height is the largest n . y / |n| of a difference y. Doubles give each
// height with an error of at most 128 u / s times the size (facet_depth.hpp). Only facets whose
// lower bound is at most the least upper bound can be the nearest one or can separate the bodies,
// so only these are visited.
class ExactFacets {
 public:
  enum class Answer { together, apart, unknown };
  // If `together`: b touches a after a motion by `height` / |normal|^2 `normal`.
  Vector3<Dyadic> normal;
  Dyadic height;

  // x, y: the exact vertices; a, b: the vertices in doubles, with errors of at most 4 u `size`.
  Answer solve(const BodyEdges& ea, const BodyEdges& eb, const Points<Dyadic>& x,
               const Points<Dyadic>& y, const Points<double>& a, const Points<double>& b,
               double size) {
    if (!solid(ea) && !solid(eb)) return Answer::unknown;
    for (const BodyEdges* e : {&ea, &eb})
      for (int f = 0; f < e->faces; ++f) add({e, e, e->face[f][0], e->face[f][1]}, a, b, size);
    for (int i = 0; i < ea.edges; ++i)
      for (int j = 0; j < eb.edges; ++j) add({&ea, &eb, i, j}, a, b, size);
    Dyadic square;
    for (const Facet& f : facets_) {
      if (f.low > least_) continue;
      const auto edge = [&](const BodyEdges* e, int k) {
        const auto& points = e == &ea ? x : y;
        return points[e->ends[k][1]] - points[e->ends[k][0]];
      };
      const Vector3<Dyadic> c = cross(edge(f.of_first, f.first), edge(f.of_second, f.second));
      const Vector3<Dyadic> n = f.back ? -c : c, none;
      if (n == none) continue;
      if (!square.is_zero() && cross(n, normal) == none && dot(n, normal).sign() > 0) continue;
      const Dyadic n2 = dot(n, n);
      const Dyadic h = top(x, n) + top(y, -n);
      if (h.sign() < 0) return Answer::apart;
      if (!square.is_zero() && !(h * h * square < height * height * n2)) continue;
      normal = n, height = h, square = n2;
    }
    return square.is_zero() ? Answer::unknown : Answer::together;
  }

 private:
  struct Pair {
    const BodyEdges *of_first, *of_second;
    int first, second;
  };
  struct Facet : Pair {
    bool back;   // the normal is reversed
    double low;  // lower bound of the height
  };

  static bool solid(const BodyEdges& e) {
    if (e.faces < 3) return false;
    const Vec3 &p = e.edge[0], &q = e.edge[1], &r = e.edge[e.faces == 4 ? 3 : 2];
    return std::fabs(dot(p, cross(q, r))) > 1e-9 * norm(p) * norm(q) * norm(r);
  }

  void add(const Pair& pair, const Points<double>& a, const Points<double>& b, double size) {
    const Vec3 &p = pair.of_first->edge[pair.first], &q = pair.of_second->edge[pair.second];
    const Vec3 c = cross(p, q);
    const double length = norm(c), slack = 0x1p-46 * (norm(p) * norm(q) / length) * size;
    for (const bool back : {false, true}) {
      const Vec3 n = ((back ? -1 : 1) / length) * c;
      const double height = top(a, n) + top(b, -n);
      const bool known = height - slack > -HUGE_VAL;  // false for edges that are parallel
      facets_.push_back({pair, back, known ? height - slack : -HUGE_VAL});
      if (known) least_ = std::min(least_, height + slack);
    }
  }

  template <class Number>
  static Number top(const Points<Number>& points, const Vector3<Number>& n) {
    Number most = dot(n, points[0]);
    for (const auto& p : points) {
      const Number x = dot(n, p);
      if (most < x) most = x;
    }
    return most;
  }

  std::vector<Facet> facets_;
  double least_ = HUGE_VAL;
};

}  // namespace tauguard::rigid
