#include "mesh_query.hpp"

#include <algorithm>

#include "tauguard/geometry/feature_gap.hpp"

namespace tauguard::rigid {

FacePair first_overlap(const Mesh& a, const Mesh& b, const Pose& pose, Scratch& scratch) {
  FacePair found = {-1, -1};
  each_overlap(a, b, pose, scratch, [&](int i, int j, const Triangle&) {
    found = {a.tree.id[i], b.tree.id[j]};
    return true;
  });
  return found;
}

namespace {

using geometry::Vec3;

double dot(const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

void cross(const double* a, const double* b, double* out) {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

void edge(const Triangle& t, int i, double* out) {
  for (int k = 0; k < 3; ++k) out[k] = t.v[(i + 1) % 3][k] - t.v[i][k];
}

// Finds the shorter translation of b along +axis or -axis that separates the projections, and
// keeps it in `c` if it is the shortest over all axes so far.
void separate(const Triangle& a, const Triangle& b, const double* axis, double size, Contact& c) {
  const double length = std::sqrt(dot(axis, axis));
  if (!(length > size)) return;
  double lo[2] = {INFINITY, INFINITY}, hi[2] = {-INFINITY, -INFINITY};
  for (int i = 0; i < 3; ++i) {
    // Relative to one corner of a, so that triangles far from the origin lose no accuracy.
    const double x[3] = {a.v[i][0] - a.v[0][0], a.v[i][1] - a.v[0][1], a.v[i][2] - a.v[0][2]};
    const double y[3] = {b.v[i][0] - a.v[0][0], b.v[i][1] - a.v[0][1], b.v[i][2] - a.v[0][2]};
    const double p = dot(axis, x) / length, q = dot(axis, y) / length;
    lo[0] = std::min(lo[0], p), hi[0] = std::max(hi[0], p);
    lo[1] = std::min(lo[1], q), hi[1] = std::max(hi[1], q);
  }
  const double forward = hi[0] - lo[1], backward = hi[1] - lo[0];
  const double depth = std::max(0.0, std::min(forward, backward));
  if (depth >= c.depth) return;
  c.depth = depth;
  const double sign = forward <= backward ? 1.0 : -1.0;
  for (int k = 0; k < 3; ++k) c.normal[k] = sign * axis[k] / length;
}

// A common point of triangles that touch or are coplanar: the mean of all nearest points of two
// edges, or of a corner and a triangle, whose distance is only rounding.
void touching_point(const Triangle& a, const Triangle& b, double* point) {
  const Triangle* both[2] = {&a, &b};
  Vec3 corner[2][3], sum{}, nearest{};
  double n = 0, size = 0, least = INFINITY;
  const Vec3 origin = geometry::load(a.v[0]);
  for (int side = 0; side < 2; ++side)
    for (int i = 0; i < 3; ++i) {
      corner[side][i] = geometry::load(both[side]->v[i]) - origin;
      size = std::max(size, geometry::largest(corner[side][i]));
    }
  const double enough = 0x1p-46 * size;
  const auto take = [&](const Vec3& at, double gap) {
    if (gap <= enough) sum = sum + at, ++n;
    if (gap < least) least = gap, nearest = at;
  };
  for (int side = 0; side < 2; ++side)
    for (const Vec3& x : corner[side]) {
      const auto& y = corner[1 - side];
      const auto gap = geometry::point_triangle(x, y[0], y[1], y[2]);
      take(x, gap.size(gap.shortest(enough)));
    }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const Vec3 *x = corner[0], *y = corner[1];
      const auto gap = geometry::segments(x[i], x[(i + 1) % 3], y[j], y[(j + 1) % 3]);
      const auto at = gap.shortest(enough);
      take(x[i] + at.u * gap.q, gap.size(at));
    }
  const Vec3 mean = origin + (n > 0 ? (1 / n) * sum : nearest);
  std::copy(mean.begin(), mean.end(), point);
}

// The mean of the points where edges of one triangle pierce the other. In general position it is
// the middle of the common segment.
void common_point(const Triangle& a, const Triangle& b, double* point) {
  double sum[3] = {}, n = 0;
  for (int side = 0; side < 2; ++side) {
    const Triangle &t = side ? b : a, &s = side ? a : b;
    double u[3], v[3], normal[3];
    edge(s, 0, u), edge(s, 1, v), cross(u, v, normal);
    for (int i = 0; i < 3; ++i) {
      const double *p = t.v[i], *q = t.v[(i + 1) % 3];
      const double dp[3] = {p[0] - s.v[0][0], p[1] - s.v[0][1], p[2] - s.v[0][2]};
      const double dq[3] = {q[0] - s.v[0][0], q[1] - s.v[0][1], q[2] - s.v[0][2]};
      const double hp = dot(normal, dp), hq = dot(normal, dq);
      if (hp == hq || (hp > 0) == (hq > 0) || !exact::segment_meets(p, q, s)) continue;
      const double w = hp / (hp - hq);
      for (int k = 0; k < 3; ++k) sum[k] += p[k] + w * (q[k] - p[k]);
      ++n;
    }
  }
  if (n > 0) {
    for (int k = 0; k < 3; ++k) point[k] = sum[k] / n;
    return;
  }
  touching_point(a, b, point);
}

Contact describe(const Triangle& a, const Triangle& b) {
  Contact c;
  c.depth = INFINITY;
  double ea[3][3], eb[3][3], na[3], nb[3], axis[3], longest = 0;
  for (int i = 0; i < 3; ++i) {
    edge(a, i, ea[i]), edge(b, i, eb[i]);
    longest = std::max({longest, dot(ea[i], ea[i]), dot(eb[i], eb[i])});
  }
  // The direction of a smaller cross product is not reliable: its rounding error is about 2^-52
  // times the product of the edges.
  const double size = 0x1p-40 * longest;
  cross(ea[0], ea[1], na), cross(eb[0], eb[1], nb);
  separate(a, b, na, size, c);
  separate(a, b, nb, size, c);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) cross(ea[i], eb[j], axis), separate(a, b, axis, size, c);
  if (!(c.depth < INFINITY)) {  // two segments on a line, or points: no axis was reliable
    c.depth = 0;
    c.normal[0] = c.normal[1] = 0, c.normal[2] = 1;
  }
  common_point(a, b, c.point);
  return c;
}

// Whether triangles of one mesh share a point other than their common corners and edge. `p` and `q`
// number the corners; a face may have several equal corners.
bool meet_beyond(const Triangle& a, const std::int32_t* p, const Triangle& b,
                 const std::int32_t* q) {
  int shared = 0, at_a[3], at_b[3];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      if (p[i] == q[j] && shared < 3) at_a[shared] = i, at_b[shared++] = j;
  if (shared == 0) return triangles_overlap(a, b);
  const auto proper = [](const std::int32_t* f) {
    return f[0] != f[1] && f[1] != f[2] && f[2] != f[0];
  };
  if (!proper(p) || !proper(q)) return false;  // edges and points belong to their neighbours
  if (shared == 3) return true;
  if (shared == 1) {
    // They meet elsewhere if the side opposite to the corner meets the other triangle.
    const auto side_meets = [](const Triangle& s, int corner, const Triangle& t) {
      return exact::segment_meets(s.v[(corner + 1) % 3], s.v[(corner + 2) % 3], t);
    };
    return side_meets(a, at_a[0], b) || side_meets(b, at_b[0], a);
  }
  // With a common edge they must be in one plane, on the same side of the edge.
  const int apex_a = 3 - at_a[0] - at_a[1], apex_b = 3 - at_b[0] - at_b[1];
  const double *x = a.v[at_a[0]], *y = a.v[at_a[1]];
  if (orient3d(x, y, a.v[apex_a], b.v[apex_b]) != 0) return false;
  const int k = exact::dropped_axis(x, y, a.v[apex_a]);
  const int other = exact::dropped_axis(x, y, b.v[apex_b]);
  if (k < 0 || other < 0) return false;  // one of them has no area
  return exact::turn(x, y, a.v[apex_a], k) == exact::turn(x, y, b.v[apex_b], k);
}

}  // namespace

bool first_contact(const Mesh& a, const Mesh& b, const Pose& pose, Scratch& scratch, Contact* out) {
  return each_overlap(a, b, pose, scratch, [&](int i, int j, const Triangle& moved) {
    *out = describe(a.tree.triangles[i], moved);
    out->a = a.tree.id[i], out->b = b.tree.id[j];
    return true;
  });
}

void self_contacts(const Mesh& mesh, const std::int32_t* ids, Scratch& scratch,
                   ContactBudget& budget, std::vector<Contact>& out) {
  const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  const Pose pose(identity);
  const Placement at(mesh.tree, mesh.tree, pose);
  const Tree& tree = mesh.tree;
  const auto pair = [&](int i, int j) {
    const std::int32_t a = std::min(tree.id[i], tree.id[j]), b = std::max(tree.id[i], tree.id[j]);
    if (a == b || !meet_beyond(tree.triangles[i], ids + 3 * tree.id[i], tree.triangles[j],
                               ids + 3 * tree.id[j]))
      return;
    budget.take();
    const bool ordered = tree.id[i] == a;
    Contact c = describe(tree.triangles[ordered ? i : j], tree.triangles[ordered ? j : i]);
    c.a = a, c.b = b;
    out.push_back(c);
  };
  const auto leaf = [&](Child ca, Child cb) {
    for (int j = leaf_first(cb); j < leaf_first(cb) + leaf_count(cb); ++j)
      for (int i = leaf_first(ca); i < leaf_first(ca) + leaf_count(ca) && i < j; ++i) pair(i, j);
    return false;
  };
  if (mesh.kind == VolumeKind::obb)
    traverse(tree, tree, ObbBounds{mesh.obbs, mesh.obbs, at}, scratch, leaf);
  else
    traverse(tree, tree, BoxBounds{tree, tree, at}, scratch, leaf);
  std::sort(out.begin(), out.end(),
            [](const Contact& x, const Contact& y) { return x.a != y.a ? x.a < y.a : x.b < y.b; });
}

void all_contacts(const Mesh& a, const Mesh& b, const Pose& pose, Scratch& scratch,
                  ContactBudget& budget, std::vector<Contact>& out) {
  const auto first = static_cast<std::ptrdiff_t>(out.size());
  each_overlap(a, b, pose, scratch, [&](int i, int j, const Triangle& moved) {
    budget.take();
    Contact c = describe(a.tree.triangles[i], moved);
    c.a = a.tree.id[i], c.b = b.tree.id[j];
    out.push_back(c);
    return false;
  });
  std::sort(out.begin() + first, out.end(),
            [](const Contact& x, const Contact& y) { return x.a != y.a ? x.a < y.a : x.b < y.b; });
}

}  // namespace tauguard::rigid
