#include "mesh_impact.hpp"

#include <queue>

#include "convex_contact.hpp"
#include "nearest.hpp"

namespace tauguard::rigid {
namespace {

constexpr FirstTouch no_touch = {INFINITY, {NAN, NAN, NAN}, {NAN, NAN, NAN}};

// Point and normal of a hit. The normal is undefined where the bodies were in each other from the start; the
// point comes from the features that touch along the normal, or from the nearest points.
FirstTouch touch(const Impact& impact, MovingBody& a, MovingBody& b, const Vec& origin) {
  if (!impact.hit) return no_touch;
  FirstTouch out = no_touch;
  out.toi = impact.t;
  a.move_to(impact.t), b.move_to(impact.t);
  double top = -INFINITY, bottom = INFINITY;
  for (const Vec& p : a.now) top = std::max(top, dot(impact.normal, p));
  for (const Vec& p : b.now) bottom = std::min(bottom, dot(impact.normal, p));
  const double tolerance = contact_tolerance(a, b);
  const bool along = norm(impact.normal) > 0 && bottom - top >= -tolerance;
  Vec point;
  if (along) contact_point(a.now, b.now, impact.normal.data(), tolerance, point.data());
  else point = middle_point(a.now, b.now);
  for (int k = 0; k < 3; ++k) {
    out.point[k] = point[k] + origin[k];
    if (along) out.normal[k] = impact.normal[k];
  }
  return out;
}

// A pair of children that cannot touch before `t`; a pair of triangles (in leaf order) where `exact`.
struct Candidate {
  double t;
  bool exact;
  std::int32_t a, b;  // exact: triangles
  SlotPair slots;
  Vec normal;
  // Earliest first; ties by index, so that the answer has one order.
  bool operator<(const Candidate& o) const {
    if (t != o.t) return t > o.t;
    if (exact != o.exact) return o.exact;
    return a != o.a ? a > o.a : b > o.b;
  }
};

class MeshImpact {
 public:
  MeshImpact(const Mesh& a, const Mesh& b, const RigidMotion& ma, const RigidMotion& mb)
      : a_(a.tree), b_(b.tree), ma_(ma), mb_(mb), origin_(ma.x0) {
    const Vec c = {a_.centre[0], a_.centre[1], a_.centre[2]};
    origin_ = ma.x0 + ma.turn(c);
  }

  // Best first: the earliest lower bound is opened until it belongs to a pair of triangles.
  Candidate run() {
    push({{-1, 0}, {-1, 0}}, 0, box(a_, {-1, 0}, ma_), box(b_, {-1, 0}, mb_));
    while (!queue_.empty()) {
      const Candidate top = queue_.top();
      if (top.exact) return top;
      queue_.pop();
      open(top);
    }
    return {INFINITY, true, -1, -1, {}, {}};
  }

  const Vec& origin() const { return origin_; }
  MovingBody triangle_a(int i) const { return moving_triangle(a_.triangles[i].v, ma_, origin_); }
  MovingBody triangle_b(int j) const { return moving_triangle(b_.triangles[j].v, mb_, origin_); }

 private:
  MovingBody box(const Tree& tree, const Slot& slot, const RigidMotion& motion) const {
    const Box b = slot.box(tree);
    return moving_box({tree.centre[0] + b.centre[0], tree.centre[1] + b.centre[1], tree.centre[2] + b.centre[2]},
                      {b.extent[0], b.extent[1], b.extent[2]}, motion, origin_);
  }

  void push(const SlotPair& slots, double start, MovingBody a, MovingBody b) {
    // A tenth of the smaller box: closer than that, opening it tells more than advancing.
    const double gap = 0.1 * std::min(slots.a.box(a_).size(), slots.b.box(b_).size());
    const Impact bound = first_contact(a, b, start, best_, gap);
    if (bound.hit) queue_.push({bound.t, false, 0, 0, slots, {}});
  }

  void open(const Candidate& pair) {
    const Slot sa = pair.slots.a, sb = pair.slots.b;
    const Child ca = sa.child(a_), cb = sb.child(b_);
    if (is_leaf(ca) && is_leaf(cb)) return touch_triangles(ca, cb, pair.t);
    const bool open_a = is_leaf(cb) || (!is_leaf(ca) && sa.box(a_).size() >= sb.box(b_).size());
    const MovingBody fixed = open_a ? box(b_, sb, mb_) : box(a_, sa, ma_);
    const std::int32_t node = open_a ? ca : cb;
    const Tree& tree = open_a ? a_ : b_;
    for (int s = 0; s < width && tree.nodes[node].child[s] != no_child; ++s) {
      if (open_a)
        push({{node, s}, sb}, pair.t, box(a_, {node, s}, ma_), fixed);
      else
        push({sa, {node, s}}, pair.t, fixed, box(b_, {node, s}, mb_));
    }
  }

  void touch_triangles(Child ca, Child cb, double start) {
    for (int i = leaf_first(ca); i < leaf_first(ca) + leaf_count(ca); ++i)
      for (int j = leaf_first(cb); j < leaf_first(cb) + leaf_count(cb); ++j) {
        MovingBody x = triangle_a(i), y = triangle_b(j);
        const Impact impact = first_contact(x, y, start, best_);
        if (!impact.hit) continue;
        best_ = std::min(best_, impact.t);
        queue_.push({impact.t, true, i, j, {}, impact.normal});
      }
  }

  const Tree &a_, &b_;
  const RigidMotion &ma_, &mb_;
  Vec origin_;
  double best_ = 1;
  std::priority_queue<Candidate> queue_;
};

}  // namespace

FirstTouch bodies_impact(const Bodies& a, const Bodies& b, std::size_t row, const RigidMotion& motion_a,
                         const RigidMotion& motion_b) {
  // Positions relative to a's first vertex at the start, so that a far-away scene costs no digits twice.
  const double* p = a.row(row);
  const Vec origin = motion_a.x0 + motion_a.turn({p[0], p[1], p[2]});
  MovingBody x = moving_body(a, row, motion_a, origin), y = moving_body(b, row, motion_b, origin);
  return touch(first_contact(x, y, 0, 1), x, y, origin);
}

FirstTouch meshes_impact(const Mesh& a, const Mesh& b, const RigidMotion& motion_a, const RigidMotion& motion_b,
                         FacePair* faces) {
  MeshImpact search(a, b, motion_a, motion_b);
  const Candidate found = search.run();
  *faces = {-1, -1};
  if (found.a < 0) return no_touch;
  *faces = {a.tree.id[found.a], b.tree.id[found.b]};
  MovingBody x = search.triangle_a(found.a), y = search.triangle_b(found.b);
  return touch({found.t, true, found.normal}, x, y, search.origin());
}

}  // namespace tauguard::rigid
