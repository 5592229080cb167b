// For comparison only: separating axes as in textbooks (Ericson 2005, 5.2.1). The test projects
// every vertex on all face normals of both bodies, then on the cross products of all edge pairs,
// and ends at the first axis that separates. Rounding can make an answer wrong.
#pragma once

#include "convex_lanes.hpp"
#include "tauguard/rigid/bodies.hpp"

namespace tauguard::rigid {

template <int Vertices, int Normals, int Edges>
struct TextbookBody {
  static constexpr int vertices = Vertices, normals = Normals, edges = Edges;
  double v[Vertices][3], n[Normals][3], e[Edges][3];
};

using TextbookTetrahedron = TextbookBody<4, 4, 6>;
using TextbookBlock = TextbookBody<8, 3, 3>;

TAUGUARD_INLINE void textbook_cross(const double* x, const double* y, double* out) {
  out[0] = x[1] * y[2] - x[2] * y[1];
  out[1] = x[2] * y[0] - x[0] * y[2];
  out[2] = x[0] * y[1] - x[1] * y[0];
}

TAUGUARD_INLINE void load(Kind, const double* p, TextbookTetrahedron& body) {
  constexpr int pairs[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 3; ++k) body.v[i][k] = p[3 * i + k];
  for (int i = 0; i < 6; ++i)
    for (int k = 0; k < 3; ++k) body.e[i][k] = body.v[pairs[i][1]][k] - body.v[pairs[i][0]][k];
  textbook_cross(body.e[0], body.e[1], body.n[0]);
  textbook_cross(body.e[0], body.e[2], body.n[1]);
  textbook_cross(body.e[1], body.e[2], body.n[2]);
  textbook_cross(body.e[3], body.e[4], body.n[3]);
}

TAUGUARD_INLINE void load(Kind kind, const double* p, TextbookBlock& body) {
  const Zonotope z = zonotope_of(kind, p);
  for (int corner = 0; corner < 8; ++corner)
    for (int k = 0; k < 3; ++k) {
      double x = z.origin[k] + z.shift[k];
      for (int axis = 0; axis < 3; ++axis) x += corner >> axis & 1 ? z.g[axis][k] : -z.g[axis][k];
      body.v[corner][k] = x;
    }
  for (int axis = 0; axis < 3; ++axis) {
    for (int k = 0; k < 3; ++k) body.e[axis][k] = z.g[axis][k];
    if (kind == Kind::boxes) {
      for (int k = 0; k < 3; ++k) body.n[axis][k] = p[6 + 3 * k + axis];
    } else {
      textbook_cross(z.g[(axis + 1) % 3], z.g[(axis + 2) % 3], body.n[axis]);
    }
  }
}

template <class Body>
TAUGUARD_INLINE void project_all(const Body& body, const double* axis, double& low, double& high) {
  low = high = axis[0] * body.v[0][0] + axis[1] * body.v[0][1] + axis[2] * body.v[0][2];
  for (int i = 1; i < Body::vertices; ++i) {
    const double x = axis[0] * body.v[i][0] + axis[1] * body.v[i][1] + axis[2] * body.v[i][2];
    if (x < low) low = x;
    if (x > high) high = x;
  }
}

template <class A, class B>
TAUGUARD_INLINE bool axis_separates(const A& a, const B& b, const double* axis) {
  double low_a, high_a, low_b, high_b;
  project_all(a, axis, low_a, high_a);
  project_all(b, axis, low_b, high_b);
  return high_a < low_b || high_b < low_a;
}

template <class A, class B>
TAUGUARD_INLINE bool textbook_overlap(Kind kind_a, const double* pa, Kind kind_b,
                                      const double* pb) {
  A a;
  B b;
  load(kind_a, pa, a);
  load(kind_b, pb, b);
  for (const auto& n : a.n)
    if (axis_separates(a, b, n)) return false;
  for (const auto& n : b.n)
    if (axis_separates(a, b, n)) return false;
  for (const auto& e : a.e)
    for (const auto& f : b.e) {
      double axis[3];
      textbook_cross(e, f, axis);
      if (axis_separates(a, b, axis)) return false;
    }
  return true;
}

}  // namespace tauguard::rigid
