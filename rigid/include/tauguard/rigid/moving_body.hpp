// A convex body under constant linear and angular velocity, in closed form. A vertex is
//   x(t) = centre(0) + t linear + along + cos(speed t) swing + sin(speed t) side,
// where `along` is parallel to the rotation axis, and `swing` and `side` are perpendicular to it.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "tauguard/rigid/bodies.hpp"

namespace tauguard::rigid {

struct RigidMotion {
  Vec3 r0[3];  // rows of the rotation at t = 0
  Vec3 x0, linear, axis;
  double speed;  // rad over the step

  // `pose`: homogeneous matrix, 16 doubles by rows.
  RigidMotion(const double* pose, const double* lin, const double* angular) {
    for (int i = 0; i < 3; ++i) {
      r0[i] = {pose[4 * i], pose[4 * i + 1], pose[4 * i + 2]};
      x0[i] = pose[4 * i + 3];
      linear[i] = lin[i];
      axis[i] = angular[i];
    }
    // Below 2^-900, where 1 / most may overflow, the vector is lifted by a power of two (exact).
    const double lift = largest(axis) < 0x1p-900 ? 0x1p900 : 1;
    axis = lift * axis;
    const double most = largest(axis);
    speed = most == 0 ? 0 : most * norm((1 / most) * axis);
    axis = speed == 0 ? Vec3{} : (1 / speed) * axis;
    speed /= lift;
  }
  Vec3 turn(const Vec3& y) const { return {dot(r0[0], y), dot(r0[1], y), dot(r0[2], y)}; }
};

// A vector that rotates with a body, in terms of the formula above. At t = 0 it is along + swing.
struct Swing {
  Vec3 along, swing, side;
  Swing(const RigidMotion& m, const Vec3& w)
      : along(dot(m.axis, w) * m.axis), swing(w - along), side(cross(m.axis, w)) {}
  Vec3 at(double c, double s) const { return along + (c * swing + s * side); }
};

class MovingBody {
 public:
  // `origin` is subtracted from every position: the caller picks one near both bodies.
  MovingBody(const RigidMotion& motion, const Vec3& origin)
      : motion_(motion), shift_(motion.x0 - origin) {}

  void add_vertex(const Vec3& y) {
    const Vec3 w = motion_.turn(y);
    vertices_.emplace_back(motion_, w);
    radius_ = std::max(radius_, norm(w));
    sweep_ = std::max(sweep_, norm(vertices_.back().swing));
  }
  void add_normal(const Vec3& n) { add_direction(normals_, n); }
  void add_edge(const Vec3& e) { add_direction(edges_, e); }

  // Sets `now`, `velocity`, `centre()`, `normal` and `edge` for time t.
  void move_to(double t) {
    const double c = std::cos(motion_.speed * t), s = std::sin(motion_.speed * t);
    const double w = motion_.speed;
    now.resize(vertices_.size()), velocity.resize(vertices_.size());
    centre_ = shift_ + t * motion_.linear;
    for (std::size_t i = 0; i < vertices_.size(); ++i) {
      now[i] = centre_ + vertices_[i].at(c, s);
      velocity[i] = motion_.linear + w * (c * vertices_[i].side - s * vertices_[i].swing);
    }
    normal.clear(), edge.clear();
    for (const Swing& n : normals_) normal.push_back(n.at(c, s));
    for (const Swing& e : edges_) edge.push_back(e.at(c, s));
  }

  // A bound on |m . x''| over all vertices and times, and over all m with |m - n| <= drift.
  double acceleration(const Vec3& n, double drift) const {
    const Vec3 across = n - dot(n, motion_.axis) * motion_.axis;
    return motion_.speed * motion_.speed * sweep_ * (norm(across) + drift + 0x1p-40) *
           (1 + 0x1p-40);
  }
  // The range of the vertices' projections on the unit vector n, relative to the centre, over a
  // full rotation of the body.
  std::array<double, 2> spun(const Vec3& n) const {
    const double across = norm(n - dot(n, motion_.axis) * motion_.axis) + 0x1p-40;
    double low = INFINITY, high = -INFINITY;
    for (const Swing& v : vertices_) {
      const double middle = dot(n, v.along), reach = across * norm(v.swing) * (1 + 0x1p-40);
      low = std::min(low, middle - reach), high = std::max(high, middle + reach);
    }
    return {low, high};
  }
  // A bound on every vertex's speed relative to the centre.
  double turning_speed() const { return motion_.speed * sweep_ * (1 + 0x1p-40); }
  // A bound on every vertex's speed relative to a point that moves with velocity `drift`.
  double speed_about(const Vec3& drift) const {
    return norm(motion_.linear - drift) * (1 + 0x1p-40) + turning_speed();
  }
  Vec3 angular() const { return motion_.speed * motion_.axis; }
  const Vec3& axis() const { return motion_.axis; }  // unit, zero without rotation
  double angular_speed() const { return motion_.speed; }
  // A bound on all magnitudes from which a position is computed; rounding errors are relative to
  // it. It includes the rotation angle, because an error of the angle rotates the body.
  double magnitude() const {
    return norm(shift_) + norm(motion_.linear) + (4 + motion_.speed) * radius_ + rounding;
  }
  const Vec3& centre() const { return centre_; }  // a point of the rotation axis
  double radius() const { return radius_; }
  const Vec3& linear() const { return motion_.linear; }

  std::vector<Vec3> now, velocity, normal, edge;
  double rounding = 0;  // the body is the hull of its vertices grown by a ball of this radius
  // Whether normals and edges are complete: for two such bodies that are apart, some normal or some
  // cross product of edges is a separating axis.
  bool complete = true;

 private:
  void add_direction(std::vector<Swing>& list, const Vec3& d) {
    const Vec3 w = motion_.turn(d);
    const double length = norm(w);
    if (length > 0) list.emplace_back(motion_, (1 / length) * w);
  }

  const RigidMotion& motion_;
  Vec3 shift_, centre_{};
  std::vector<Swing> vertices_, normals_, edges_;
  double radius_ = 0, sweep_ = 0;
};

// The body of row `r` with `motion`.
MovingBody moving_body(const Bodies& bodies, std::size_t r, const RigidMotion& motion,
                       const Vec3& origin);
MovingBody moving_triangle(const double v[3][3], const RigidMotion& motion, const Vec3& origin);

}  // namespace tauguard::rigid
