#include "mesh_body.hpp"

#include "mesh_rays.hpp"

#include <algorithm>

namespace tauguard::rigid {
namespace {

// The unit vector perpendicular to the unit u that is nearest to x; any one if x is parallel to u.
Vec3 across(const Vec3& x, const Vec3& u) {
  const Vec3 y = x - dot(x, u) * u;
  if (norm(y) > 1e-6 * norm(x)) return (1 / norm(y)) * y;
  const int k = std::fabs(u[0]) < 0.6 ? 0 : 1;
  Vec3 e{};
  e[k] = 1;
  const Vec3 z = e - u[k] * u;
  return (1 / norm(z)) * z;
}

}  // namespace

// Axes of an oriented box around the body. The first axis points from the first vertex to the
// farthest one; the second is perpendicular to it, towards the vertex farthest from this line. For
// bodies with eight corners only the ends of the first vertex's edges are considered, so the axes
// of a box are those of its edges.
std::array<Vec3, 3> RoundedBody::axes() const {
  const bool block = bodies.kind != Kind::tetrahedra && bodies.kind != Kind::hulls;
  Vec3 far{}, wide{};
  for (std::size_t i = 1; i < points.size(); ++i) {
    const Vec3 x = points[i] - points[0];
    if ((!block || i == 1 || i == 2 || i == 4) && dot(x, x) > dot(far, far)) far = x;
  }
  const Vec3 u = dot(far, far) > 0 ? (1 / norm(far)) * far : Vec3{1, 0, 0};
  double most = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const Vec3 x = points[i] - points[0], y = x - dot(x, u) * u;
    if ((!block || i == 1 || i == 2 || i == 4) && dot(y, y) > most) most = dot(y, y), wide = x;
  }
  const Vec3 v = across(wide, u);
  return {u, v, cross(u, v)};
}

RoundedBody::RoundedBody(const Bodies& batch, std::size_t row, double r)
    : bodies(row_of(batch, row, offsets_)),
      rounding(r),
      points(vertices_of<double>(batch, row)),
      extent{} {
  const std::array<Vec3, 3> axis = axes();
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) box.axis[i][k] = static_cast<float>(axis[i][k]);
  Vec3 half{};
  for (int i = 0; i < 3; ++i) {
    const Vec3 n = {box.axis[i][0], box.axis[i][1], box.axis[i][2]};
    double low = INFINITY, high = -INFINITY;
    for (const Vec3& p : points) {
      const double x = dot(n, p - points[0]);
      low = std::min(low, x), high = std::max(high, x);
    }
    extent.centre = extent.centre + 0.5 * (low + high) * n;
    half[i] = 0.5 * (high - low);
  }
  extent.centre = points[0] + extent.centre;
  for (const Vec3& p : points) {
    for (const double x : p) extent.magnitude = std::max(extent.magnitude, std::fabs(x) + rounding);
    extent.radius = std::max(extent.radius, norm(p - extent.centre) + rounding);
    // Extents refer to the centre and axes as rounded to float, so that the box contains the body.
    for (int i = 0; i < 3; ++i) {
      const Vec3 n = {box.axis[i][0], box.axis[i][1], box.axis[i][2]};
      half[i] = std::max(half[i], std::fabs(dot(n, p - extent.centre)));
    }
  }
  extent.radius *= 1 + 0x1p-40;
  for (int i = 0; i < 3; ++i) {
    box.centre[i] = 0;
    box.extent[i] =
        std::nextafter(static_cast<float>(half[i] + rounding + 0x1p-20 * extent.radius), INFINITY);
  }
}

namespace {

// Calls visit(triangle in leaf order), until it returns true, for all triangles in leaves whose box
// may be within `margin` of the body's box. The traversal is depth first, nearest centre first.
// `visit` may reduce `margin`.
template <class Visit>
void each_near(const Mesh& mesh, const RoundedBody& body, const double& margin, Visit visit) {
  const Tree& tree = mesh.tree;
  FloatObb box = body.box;
  double square = 0;
  for (int k = 0; k < 3; ++k) {
    const double t = body.extent.centre[k] - tree.centre[k];
    box.centre[k] = static_cast<float>(t), square += t * t;
  }
  // As in Placement: all coordinates are within `reach` of the mesh's centre.
  const double reach = tree.radius + body.extent.radius + std::sqrt(square);
  const double rounding =
      0x1p-16 * reach + 0x1p-140 + 0x1p-48 * (tree.magnitude + body.extent.magnitude);
  const auto pad = [&] { return std::nextafter(static_cast<float>(rounding + margin), INFINITY); };
  std::vector<Child> stack = {0};
  std::vector<std::pair<float, Child>> next;
  ObbNode scratch;
  float key[width];
  while (!stack.empty()) {
    geometry::poll_interrupt();
    const Child c = stack.back();
    stack.pop_back();
    if (is_leaf(c)) {
      for (int i = leaf_first(c); i < leaf_first(c) + leaf_count(c); ++i)
        if (visit(i)) return;
      continue;
    }
    next.clear();
    for (unsigned mask = overlap_mask(oriented(mesh, c, scratch), box, pad(), key); mask;
         mask &= mask - 1) {
      const int s = __builtin_ctz(mask);
      next.emplace_back(key[s], tree.nodes[c].child[s]);
    }
    std::stable_sort(next.begin(), next.end(),
                     [](const auto& x, const auto& y) { return x.first > y.first; });
    for (const auto& [distance, child] : next) stack.push_back(child);
  }
}

constexpr std::int64_t triangle_offsets[2] = {0, 3};
Bodies as_body(const Triangle& t) { return {Kind::hulls, t.v[0], triangle_offsets, 1}; }

// Whether the triangle is certainly more than `margin` from the body along n or -n.
bool beyond(const Triangle& t, const RoundedBody& body, const Vec3& n, double margin) {
  const Vec3& from = body.points[0];
  double a_lo = INFINITY, a_hi = -INFINITY, b_lo = INFINITY, b_hi = -INFINITY, size = 0;
  for (const auto& v : t.v) {
    const Vec3 p = Vec3{v[0], v[1], v[2]} - from;
    const double x = dot(n, p);
    a_lo = std::min(a_lo, x), a_hi = std::max(a_hi, x), size = std::max(size, norm(p));
  }
  for (const Vec3& q : body.points) {
    const double x = dot(n, q - from);
    b_lo = std::min(b_lo, x), b_hi = std::max(b_hi, x), size = std::max(size, norm(q - from));
  }
  const double separation = std::max(a_lo - b_hi, b_lo - a_hi) - 0x1p-46 * size * norm(n);
  return separation > (margin + body.rounding) * norm(n) * (1 + 0x1p-46);
}

Vec3 normal_of(const Triangle& t) {
  const Vec3 x = {t.v[0][0], t.v[0][1], t.v[0][2]}, y = {t.v[1][0], t.v[1][1], t.v[1][2]},
             z = {t.v[2][0], t.v[2][1], t.v[2][2]};
  return cross(y - x, z - x);
}

}  // namespace

std::int32_t first_overlap(const Mesh& mesh, const RoundedBody& body) {
  std::int32_t face = -1;
  each_near(mesh, body, 0, [&](int i) {
    const Triangle& t = mesh.tree.triangles[i];
    if (beyond(t, body, normal_of(t), 0)) return false;
    if (!meet(as_body(t), body.bodies, 0, 0, body.rounding)) return false;
    face = mesh.tree.id[i];
    return true;
  });
  return face;
}

FaceDistance nearest_face(const Mesh& mesh, const RoundedBody& body) {
  FaceDistance best{{INFINITY, {}, {}, {}}, -1};
  double margin = INFINITY;
  each_near(mesh, body, margin, [&](int i) {
    const Triangle& t = mesh.tree.triangles[i];
    const std::int32_t face = mesh.tree.id[i];
    if (best.face >= 0 &&
        (beyond(t, body, best.at.normal, margin) || beyond(t, body, normal_of(t), margin)))
      return false;
    const SignedDistance at = signed_distance(as_body(t), body.bodies, 0, 0, body.rounding);
    const double old = best.at.distance;
    if (at.distance < old || (at.distance == old && face < best.face)) best = {at, face};
    margin = std::max(best.at.distance, 0.0);
    return false;
  });
  return best;
}

FaceDistance deepest_corner(const Mesh& closed, const RoundedBody& body,
                            const FaceDistance& of_surface) {
  // The corners of a curved body's box are not in the body. Its centre is.
  const bool curved = !is_polytope(body.bodies.kind);
  const Points<double> corners =
      curved ? Points<double>{geometry::load(body.bodies.row(0))} : body.points;
  if (of_surface.at.distance > 0 && winding(closed, corners[0]) <= 0) return of_surface;
  FaceDistance out = of_surface;
  for (const Vec3& p : corners) {
    if (on_surface(closed, p) || winding(closed, p) <= 0) continue;
    const NearestPoint at = nearest_point(closed, p);
    const double depth = at.distance + body.rounding;
    const bool first = out.at.distance > 0;
    if (!first && depth <= -out.at.distance) continue;
    const Vec3 n = (1 / at.distance) * (at.point - p);
    out = {{-depth, at.point, p - body.rounding * n, n}, at.face};
  }
  return out;
}

namespace {

// Seen from the mesh, the body moves along a chord in each piece of the step (mesh_pieces.hpp).
class MeshBodyImpact {
 public:
  MeshBodyImpact(const Mesh& mesh, const RoundedBody& body, const RigidMotion& of_mesh,
                 const RigidMotion& of_body)
      : mesh_(mesh), body_(body), pieces_(extent_of(mesh.tree), body.extent, of_mesh, of_body) {}

  void run() {
    pieces_.each(until_, [&] { traverse_piece(); });
  }

  Impact found() const { return {until_, face_ >= 0, normal_}; }
  std::int32_t leaf() const { return face_; }  // in leaf order; -1 if there is none
  const Vec3& origin() const { return pieces_.origin(); }
  MovingBody triangle(int i) const {
    return moving_triangle(mesh_.tree.triangles[i].v, pieces_.motion_a(), origin());
  }
  MovingBody body() const {
    MovingBody out = moving_body(body_.bodies, 0, pieces_.motion_b(), origin());
    out.rounding = body_.rounding;
    return out;
  }

 private:
  struct Open {
    Child child;
    float enter;
  };

  // Traverses depth first: the child with the earliest possible contact is on top of the stack.
  void traverse_piece() {
    const MovingObb box = moving(body_.box, pieces_.in_a());
    std::vector<Open> stack = {{0, 0.0f}};
    float enter[width];
    ObbNode scratch;
    while (!stack.empty()) {
      geometry::poll_interrupt();
      const Open top = stack.back();
      stack.pop_back();
      const float leave = pieces_.left(until_);
      if (top.enter > leave) continue;
      if (is_leaf(top.child)) {
        for (int i = leaf_first(top.child); i < leaf_first(top.child) + leaf_count(top.child); ++i)
          touch(i, pieces_.begin() + std::max(0.0f, top.enter) * pieces_.length() * (1 - 0x1p-20));
        continue;
      }
      unsigned mask = swept_mask(oriented(mesh_, top.child, scratch), box, leave, enter);
      const std::size_t base = stack.size();
      for (; mask; mask &= mask - 1) {
        const int s = __builtin_ctz(mask);
        stack.push_back({mesh_.tree.nodes[top.child].child[s], enter[s]});
      }
      std::stable_sort(stack.begin() + base, stack.end(),
                       [](const Open& x, const Open& y) { return x.enter > y.enter; });
    }
  }

  // Tests triangle i. It is certainly apart from the body before `start`.
  void touch(int i, double start) {
    const double end = std::min(until_, pieces_.end());
    if (start > end) return;
    MovingBody x = triangle(i), y = body();
    const Impact impact = first_contact(x, y, start, end);
    if (!impact.hit) return;
    // Ties are broken by index, so that the answer is unique.
    if (face_ >= 0 && impact.t == until_ && i > face_) return;
    until_ = impact.t, face_ = i, normal_ = impact.normal;
  }

  const Mesh& mesh_;
  const RoundedBody& body_;
  Pieces pieces_;
  double until_ = 1;
  std::int32_t face_ = -1;
  Vec3 normal_{};
};

}  // namespace

FirstTouch mesh_body_impact(const Mesh& mesh, const RoundedBody& body, const RigidMotion& of_mesh,
                            const RigidMotion& of_body, std::int32_t* face) {
  MeshBodyImpact search(mesh, body, of_mesh, of_body);
  search.run();
  *face = search.leaf() < 0 ? -1 : mesh.tree.id[search.leaf()];
  if (*face < 0) return no_touch;
  MovingBody x = search.triangle(search.leaf()), y = search.body();
  return first_touch(search.found(), x, y, search.origin());
}

}  // namespace tauguard::rigid
