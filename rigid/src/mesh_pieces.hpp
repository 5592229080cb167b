// Divides the step of two moving bodies into pieces that are short enough for little rotation. In a
// piece, the path of a point of one body in the frame of the other is approximated by its chord.
#pragma once

#include <algorithm>

#include "mesh_swept.hpp"
#include "tauguard/geometry/interrupt.hpp"

namespace tauguard::rigid {

// A ball around a body in its own frame, rounded up, and the body's largest |coordinate|.
struct Extent {
  Vec3 centre;
  double radius, magnitude;
};

inline Extent extent_of(const Tree& t) {
  return {{t.centre[0], t.centre[1], t.centre[2]}, t.radius, t.magnitude};
}

class Pieces {
 public:
  Pieces(const Extent& a, const Extent& b, const RigidMotion& ma, const RigidMotion& mb)
      : a_(a), b_(b), ma_(ma), mb_(mb), origin_(ma.x0 + ma.turn(a.centre)) {
    const double arm_a = (norm(a.centre) + a.radius) * more,
                 arm_b = (norm(b.centre) + b.radius) * more;
    drift_ = norm(mb.linear - ma.linear) * more;
    speed_ = drift_ + (ma.speed * arm_a + mb.speed * arm_b) * more;
    const double skew = skewness(ma) + skewness(mb);
    const double largest =
        a.magnitude + b.magnitude + norm(ma.x0) + norm(mb.x0) + norm(ma.linear) + norm(mb.linear);
    // The rounding bounds of Placement (mesh_boxes.hpp), for two rotations and rounded angles.
    coarse_ = 0x1p-16 + 12 * skew;
    fine_ = 0x1p-44 + 12 * skew;
    shift_ = 0x1p-44 * (largest + (ma.speed * arm_a + mb.speed * arm_b)) + 0x1p-140;
  }

  // Calls open(), in order of time, for every piece in which the bodies may meet and that begins
  // before `until`. open() may lower `until` to the time of the first hit.
  template <class Open>
  void each(const double& until, Open open) {
    piece(0, 1, until, open);
  }

  // The open piece is the one for which open() is being called.
  double begin() const { return begin_; }
  double end() const { return begin_ + length_; }
  double length() const { return length_; }
  const Chord& in_a() const { return in_a_; }
  const Chord& in_b() const { return in_b_; }
  // The fraction of the open piece at the time `until`, rounded up; at most 1.
  float left(double until) const {
    if (until >= end()) return 1.0f;
    return std::nextafter(static_cast<float>((until - begin_) / length_), 2.0f);
  }

  // A point near both bodies, to which positions are relative.
  const Vec3& origin() const { return origin_; }
  const RigidMotion& motion_a() const { return ma_; }
  const RigidMotion& motion_b() const { return mb_; }

 private:
  static constexpr double more = 1 + 0x1p-40;
  // A piece is halved if the bodies rotate more than most_turn [rad] in all, or if points move more
  // than most_move times the sum of the radii, unless the balls around the bodies stay apart.
  static constexpr double most_turn = 1.0 / 16, most_move = 0.5;

  static double skewness(const RigidMotion& m) {
    double skew = 0;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        skew = std::max(skew, std::fabs(dot(m.r0[i], m.r0[j]) - (i == j)));
    return skew;
  }

  // Distance of the centres of the balls.
  double apart(double t) const {
    const Place at_a = place_at(ma_, t), at_b = place_at(mb_, t);
    return norm(at_b(b_.centre) - at_a(a_.centre));
  }

  template <class Open>
  void piece(double begin, double length, const double& until, Open& open) {
    if (begin > until) return;
    geometry::poll_interrupt();
    const double both = (a_.radius + b_.radius) * more, gap = apart(begin + 0.5 * length);
    const double slack = fine_ * (both + gap) + shift_;
    if (gap > (both + 0.5 * length * speed_ + slack) * more) return;
    const bool short_enough =
        (ma_.speed + mb_.speed) * length <= most_turn && speed_ * length <= most_move * both;
    // Pieces shorter than 2^-50 are not halved: their ends hardly differ in double precision.
    if (short_enough || length < 0x1p-50) {
      place(begin, length, both);
      open();
      return;
    }
    piece(begin, 0.5 * length, until, open);
    piece(begin + 0.5 * length, 0.5 * length, until, open);
  }

  void place(double begin, double length, double both) {
    begin_ = begin, length_ = length;
    const Place a[3] = {place_at(ma_, begin), place_at(ma_, begin + 0.5 * length),
                        place_at(ma_, begin + length)};
    const Place b[3] = {place_at(mb_, begin), place_at(mb_, begin + 0.5 * length),
                        place_at(mb_, begin + length)};
    const double reach = both + apart(begin) + speed_ * length;
    const Vec3 from_a = mb_.x0 - ma_.x0 + begin * (mb_.linear - ma_.linear);
    const double far = norm(from_a) + length * drift_;
    fill(in_a_, a, b, a_.centre, b_.centre, mb_.speed, ma_.speed, norm(b_.centre) + b_.radius, far,
         reach);
    fill(in_b_, b, a, b_.centre, a_.centre, ma_.speed, mb_.speed, norm(a_.centre) + a_.radius, far,
         reach);
  }

  // The motion of `moved` in the frame of `at`, both relative to their centres. Let the frame
  // rotate at the rate w, and let x be a point in it that rotates at the rate v, with radius `arm`,
  // about an origin of velocity `drift`. The acceleration of the point in the frame is at most
  //   v^2 arm + 2 w (drift + v arm) + w^2 |x|.
  // During a time h, the distance of its path from the chord is at most h^2 / 8 times this bound.
  void fill(Chord& chord, const Place* at, const Place* moved, const Vec3& centre,
            const Vec3& moved_centre, double v, double w, double arm, double far, double reach) {
    Place* out[3] = {&chord.start, &chord.middle, &chord.end};
    for (int k = 0; k < 3; ++k) {
      Vec3 column[3];
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

  const Extent a_, b_;
  const RigidMotion &ma_, &mb_;
  const Vec3 origin_;
  double drift_;                   // bound on the relative speed of the origins
  double speed_;                   // bound on the relative speed of any two points
  double coarse_, fine_;           // relative rounding errors in float and in double
  double shift_;                   // absolute rounding error
  double begin_ = 0, length_ = 1;  // the piece that is open
  Chord in_a_, in_b_;
};

}  // namespace tauguard::rigid
