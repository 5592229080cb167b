#include "mesh_impact.hpp"

#include <algorithm>

#include "convex_contact.hpp"
#include "mesh_swept.hpp"
#include "nearest.hpp"
#include "tauguard/geometry/interrupt.hpp"

namespace tauguard::rigid {
namespace {

constexpr FirstTouch no_touch = {INFINITY, {NAN, NAN, NAN}, {NAN, NAN, NAN}};

// Point and normal of a hit. The normal is undefined where the bodies were in each other from the
// start; the point comes from the features that touch along the normal, or from the nearest points.
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
  if (along)
    contact_point(a.now, b.now, impact.normal.data(), tolerance, point.data());
  else
    point = middle_point(a.now, b.now);
  for (int k = 0; k < 3; ++k) {
    out.point[k] = point[k] + origin[k];
    if (along) out.normal[k] = impact.normal[k];
  }
  return out;
}

// Pieces of the step turn by at most this much [rad] and move by at most this share of the meshes'
// size, or are split where the balls around the meshes do not already keep them apart.
constexpr double most_turn = 1.0 / 16, most_move = 0.5;

struct Found {
  double t = 1;
  std::int32_t a = -1, b = -1;  // triangles in leaf order
  Vec normal{};
};

class MeshImpact {
 public:
  MeshImpact(const Mesh& a, const Mesh& b, const RigidMotion& ma, const RigidMotion& mb)
      : mesh_a_(a),
        mesh_b_(b),
        a_(a.tree),
        b_(b.tree),
        ma_(ma),
        mb_(mb),
        centre_a_{a_.centre[0], a_.centre[1], a_.centre[2]},
        centre_b_{b_.centre[0], b_.centre[1], b_.centre[2]},
        origin_(ma.x0 + ma.turn(centre_a_)) {
    const double arm_a = (norm(centre_a_) + a_.radius) * more,
                 arm_b = (norm(centre_b_) + b_.radius) * more;
    drift_ = norm(mb.linear - ma.linear) * more;
    speed_ = drift_ + (ma.speed * arm_a + mb.speed * arm_b) * more;
    const double skew = skewness(ma) + skewness(mb);
    const double largest =
        a_.magnitude + b_.magnitude + norm(ma.x0) + norm(mb.x0) + norm(ma.linear) + norm(mb.linear);
    // As in Placement (mesh_boxes.hpp), for both rotations; an angle's rounding turns a body.
    coarse_ = 0x1p-16 + 12 * skew;
    fine_ = 0x1p-44 + 12 * skew;
    shift_ = 0x1p-44 * (largest + (ma.speed * arm_a + mb.speed * arm_b)) + 0x1p-140;
  }

  // Pieces in order, so that the first hit's piece is the last one opened.
  Found run() {
    piece(0, 1);
    return found_;
  }

  const Vec& origin() const { return origin_; }
  MovingBody triangle_a(int i) const { return moving_triangle(a_.triangles[i].v, ma_, origin_); }
  MovingBody triangle_b(int j) const { return moving_triangle(b_.triangles[j].v, mb_, origin_); }

 private:
  static constexpr double more = 1 + 0x1p-40;

  static double skewness(const RigidMotion& m) {
    double skew = 0;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        skew = std::max(skew, std::fabs(dot(m.r0[i], m.r0[j]) - (i == j)));
    return skew;
  }

  // Distance of the meshes' centres.
  double apart(double t) const {
    const Place at_a = place_at(ma_, t), at_b = place_at(mb_, t);
    return norm(at_b(centre_b_) - at_a(centre_a_));
  }

  void piece(double begin, double length) {
    if (begin > found_.t) return;
    geometry::poll_interrupt();
    const double both = (a_.radius + b_.radius) * more, gap = apart(begin + 0.5 * length);
    const double slack = fine_ * (both + gap) + shift_;
    if (gap > (both + 0.5 * length * speed_ + slack) * more) return;
    const bool short_enough =
        (ma_.speed + mb_.speed) * length <= most_turn && speed_ * length <= most_move * both;
    // Below 2^-50 of the step the ends of a piece are hardly told apart, whatever moves how fast.
    if (short_enough || length < 0x1p-50) return open(begin, length, both);
    piece(begin, 0.5 * length);
    piece(begin + 0.5 * length, 0.5 * length);
  }

  void open(double begin, double length, double both) {
    begin_ = begin, length_ = length;
    const Place a[3] = {place_at(ma_, begin), place_at(ma_, begin + 0.5 * length),
                        place_at(ma_, begin + length)};
    const Place b[3] = {place_at(mb_, begin), place_at(mb_, begin + 0.5 * length),
                        place_at(mb_, begin + length)};
    const double reach = both + apart(begin) + speed_ * length;
    const Vec from_a = mb_.x0 - ma_.x0 + begin * (mb_.linear - ma_.linear);
    const double far = norm(from_a) + length * drift_;
    fill(in_a_, a, b, centre_a_, centre_b_, mb_.speed, ma_.speed, norm(centre_b_) + b_.radius, far,
         reach);
    fill(in_b_, b, a, centre_b_, centre_a_, ma_.speed, mb_.speed, norm(centre_a_) + a_.radius, far,
         reach);
    traverse_piece();
  }

  // `moved` seen from `at`, both from their centres. Seen from a frame that turns at w, a point at
  // x from its origin that itself turns at v about an origin that drifts is accelerated by at most
  // v^2 arm + 2 w (drift + v arm) + w^2 |x|; over a time h its path leaves its chord by an eighth
  // of that h^2.
  void fill(Chord& chord, const Place* at, const Place* moved, const Vec& centre,
            const Vec& moved_centre, double v, double w, double arm, double far, double reach) {
    Place* out[3] = {&chord.start, &chord.middle, &chord.end};
    for (int k = 0; k < 3; ++k) {
      Vec column[3];
      for (int j = 0; j < 3; ++j)
        column[j] = at[k].turn_back({moved[k].r[0][j], moved[k].r[1][j], moved[k].r[2][j]});
      for (int i = 0; i < 3; ++i) out[k]->r[i] = {column[0][i], column[1][i], column[2][i]};
      out[k]->t = at[k].turn_back(moved[k](moved_centre) - at[k].t) - centre;
    }
    const double pull = v * v * arm + 2 * w * (drift_ + v * arm) + w * w * (far + arm);
    chord.sagitta = 0.125 * length_ * length_ * pull * more;
    chord.turn = 0.5 * length_ * (v + w) * more;
    chord.rounding = fine_ * reach + shift_;
    chord.float_rounding = std::nextafter(static_cast<float>(coarse_ * reach + shift_), INFINITY);
  }

  struct Open {
    SlotPair slots;
    float enter;
  };

  // Depth first, the pair that may touch first on top.
  void traverse_piece() {
    stack_.clear();
    stack_.push_back({{{-1, 0}, {-1, 0}}, 0});
    float enter[width];
    ObbNode scratch;
    while (!stack_.empty()) {
      geometry::poll_interrupt();
      const Open top = stack_.back();
      stack_.pop_back();
      const float leave = left();
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
      unsigned mask = swept_mask(oriented(open_a ? mesh_a_ : mesh_b_, node, scratch),
                                 moving(fixed, open_a ? in_a_ : in_b_), leave, enter);
      const std::size_t base = stack_.size();
      for (; mask; mask &= mask - 1) {
        const int s = __builtin_ctz(mask);
        stack_.push_back({open_a ? SlotPair{{node, s}, sb} : SlotPair{sa, {node, s}}, enter[s]});
      }
      std::stable_sort(stack_.begin() + base, stack_.end(),
                       [](const Open& x, const Open& y) { return x.enter > y.enter; });
    }
  }

  // The share of the piece after which nothing is sought, rounded up.
  float left() const {
    if (found_.t >= begin_ + length_) return 1.0f;
    return std::nextafter(static_cast<float>((found_.t - begin_) / length_), 2.0f);
  }

  void touch_triangles(Child ca, Child cb) {
    for (int j = leaf_first(cb); j < leaf_first(cb) + leaf_count(cb); ++j) {
      Vec b0[3], b1[3];
      for (int c = 0; c < 3; ++c) {
        const double* v = b_.triangles[j].v[c];
        const Vec y = Vec{v[0], v[1], v[2]} - centre_b_;
        b0[c] = in_a_.start(y), b1[c] = in_a_.end(y);
      }
      for (int i = leaf_first(ca); i < leaf_first(ca) + leaf_count(ca); ++i) {
        Vec a[3];
        for (int c = 0; c < 3; ++c) {
          const double* v = a_.triangles[i].v[c];
          a[c] = Vec{v[0], v[1], v[2]} - centre_a_;
        }
        const double until = certainly_apart(a, b0, b1, in_a_.sagitta + in_a_.rounding);
        if (until <= 1) touch_pair(i, j, begin_ + until * length_ * (1 - 0x1p-40));
      }
    }
  }

  void touch_pair(int i, int j, double start) {
    const double end = std::min(found_.t, begin_ + length_);
    if (start > end) return;
    MovingBody x = triangle_a(i), y = triangle_b(j);
    const Impact impact = first_contact(x, y, start, end);
    if (!impact.hit) return;
    // Ties by index, so that the answer has one order.
    const bool tie = found_.a >= 0 && impact.t == found_.t;
    if (tie && (i > found_.a || (i == found_.a && j > found_.b))) return;
    found_ = {impact.t, i, j, impact.normal};
  }

  const Mesh &mesh_a_, &mesh_b_;
  const Tree &a_, &b_;
  const RigidMotion &ma_, &mb_;
  const Vec centre_a_, centre_b_, origin_;
  double drift_, speed_;           // of the origins and of any two points past each other, at most
  double coarse_, fine_, shift_;   // rounding: shares of a length, and a length
  double begin_ = 0, length_ = 1;  // the piece that is open
  Chord in_a_, in_b_;
  std::vector<Open> stack_;
  Found found_;
};

}  // namespace

FirstTouch bodies_impact(const Bodies& a, const Bodies& b, std::size_t row,
                         const RigidMotion& motion_a, const RigidMotion& motion_b) {
  // Positions relative to a's first vertex at the start, so that a far-away scene costs no digits
  // twice.
  const double* p = a.row(row);
  const Vec origin = motion_a.x0 + motion_a.turn({p[0], p[1], p[2]});
  MovingBody x = moving_body(a, row, motion_a, origin), y = moving_body(b, row, motion_b, origin);
  return touch(first_contact(x, y, 0, 1), x, y, origin);
}

FirstTouch meshes_impact(const Mesh& a, const Mesh& b, const RigidMotion& motion_a,
                         const RigidMotion& motion_b, FacePair* faces) {
  MeshImpact search(a, b, motion_a, motion_b);
  const Found found = search.run();
  *faces = {-1, -1};
  if (found.a < 0) return no_touch;
  *faces = {a.tree.id[found.a], b.tree.id[found.b]};
  MovingBody x = search.triangle_a(found.a), y = search.triangle_b(found.b);
  return touch({found.t, true, found.normal}, x, y, search.origin());
}

}  // namespace tauguard::rigid
