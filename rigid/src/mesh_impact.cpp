#include "mesh_impact.hpp"

#include <algorithm>

#include "first_touch.hpp"
#include "mesh_pieces.hpp"

namespace tauguard::rigid {
namespace {

struct Found {
  double t = 1;
  std::int32_t a = -1, b = -1;  // triangles in leaf order
  Vec3 normal{};
};

class MeshImpact {
 public:
  MeshImpact(const Mesh& a, const Mesh& b, const RigidMotion& ma, const RigidMotion& mb)
      : mesh_a_(a),
        mesh_b_(b),
        a_(a.tree),
        b_(b.tree),
        pieces_(extent_of(a.tree), extent_of(b.tree), ma, mb) {}

  Found run() {
    pieces_.each(found_.t, [&] { traverse_piece(); });
    return found_;
  }

  const Vec3& origin() const { return pieces_.origin(); }
  MovingBody triangle_a(int i) const {
    return moving_triangle(a_.triangles[i].v, pieces_.motion_a(), origin());
  }
  MovingBody triangle_b(int j) const {
    return moving_triangle(b_.triangles[j].v, pieces_.motion_b(), origin());
  }

 private:
  static Vec3 centre(const Tree& t) { return {t.centre[0], t.centre[1], t.centre[2]}; }

  struct Open {
    SlotPair slots;
    float enter;
  };

  // Depth first: the pair with the earliest possible contact is on top of the stack.
  void traverse_piece() {
    stack_.clear();
    stack_.push_back({{{-1, 0}, {-1, 0}}, 0});
    float enter[width];
    ObbNode scratch;
    while (!stack_.empty()) {
      geometry::poll_interrupt();
      const Open top = stack_.back();
      stack_.pop_back();
      const float leave = pieces_.left(found_.t);
      if (top.enter > leave) continue;
      const Slot sa = top.slots.a, sb = top.slots.b;
      const Child ca = sa.child(a_), cb = sb.child(b_);
      if (is_leaf(ca) && is_leaf(cb)) {
        touch_triangles(ca, cb);
        continue;
      }
      const bool open_a = is_leaf(cb) || (!is_leaf(ca) && sa.box(a_).size() >= sb.box(b_).size());
      const FloatObb fixed = open_a ? oriented_box(mesh_b_, sb) : oriented_box(mesh_a_, sa);
      const std::int32_t node = open_a ? ca : cb;
      unsigned mask =
          swept_mask(oriented(open_a ? mesh_a_ : mesh_b_, node, scratch),
                     moving(fixed, open_a ? pieces_.in_a() : pieces_.in_b()), leave, enter);
      const std::size_t base = stack_.size();
      for (; mask; mask &= mask - 1) {
        const int s = __builtin_ctz(mask);
        stack_.push_back({open_a ? SlotPair{{node, s}, sb} : SlotPair{sa, {node, s}}, enter[s]});
      }
      std::stable_sort(stack_.begin() + base, stack_.end(),
                       [](const Open& x, const Open& y) { return x.enter > y.enter; });
    }
  }

  void touch_triangles(Child ca, Child cb) {
    for (int j = leaf_first(cb); j < leaf_first(cb) + leaf_count(cb); ++j) {
      const Chord& in_a = pieces_.in_a();
      Vec3 b0[3], b1[3];
      for (int c = 0; c < 3; ++c) {
        const double* v = b_.triangles[j].v[c];
        const Vec3 y = Vec3{v[0], v[1], v[2]} - centre(b_);
        b0[c] = in_a.start(y), b1[c] = in_a.end(y);
      }
      for (int i = leaf_first(ca); i < leaf_first(ca) + leaf_count(ca); ++i) {
        Vec3 a[3];
        for (int c = 0; c < 3; ++c) {
          const double* v = a_.triangles[i].v[c];
          a[c] = Vec3{v[0], v[1], v[2]} - centre(a_);
        }
        const double until = certainly_apart(a, b0, b1, in_a.sagitta + in_a.rounding);
        if (until <= 1)
          touch_pair(i, j, pieces_.begin() + until * pieces_.length() * (1 - 0x1p-40));
      }
    }
  }

  void touch_pair(int i, int j, double start) {
    const double end = std::min(found_.t, pieces_.end());
    if (start > end) return;
    MovingBody x = triangle_a(i), y = triangle_b(j);
    const Impact impact = first_contact(x, y, start, end);
    if (!impact.hit) return;
    // The pair of least indices is chosen among ties, so that the answer is unique.
    const bool tie = found_.a >= 0 && impact.t == found_.t;
    if (tie && (i > found_.a || (i == found_.a && j > found_.b))) return;
    found_ = {impact.t, i, j, impact.normal};
  }

  const Mesh &mesh_a_, &mesh_b_;
  const Tree &a_, &b_;
  Pieces pieces_;
  std::vector<Open> stack_;
  Found found_;
};

}  // namespace

FirstTouch meshes_impact(const Mesh& a, const Mesh& b, const RigidMotion& motion_a,
                         const RigidMotion& motion_b, FacePair* faces) {
  MeshImpact search(a, b, motion_a, motion_b);
  const Found found = search.run();
  *faces = {-1, -1};
  if (found.a < 0) return no_touch;
  *faces = {a.tree.id[found.a], b.tree.id[found.b]};
  MovingBody x = search.triangle_a(found.a), y = search.triangle_b(found.b);
  return first_touch({found.t, true, found.normal}, x, y, search.origin());
}

}  // namespace tauguard::rigid
