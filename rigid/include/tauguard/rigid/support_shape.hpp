// Convex shapes given by support functions, and their motion in a step.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "tauguard/geometry/rounding.hpp"
#include "tauguard/rigid/moving_body.hpp"

namespace tauguard::rigid {

using geometry::unit_roundoff;

// A convex core grown by `radius`, in its own frame: the axis of symmetry is z, and sizes are half
// lengths (of a segment, cylinder and cone: radius, half length). The apex of a cone is at z > 0. A
// half-space is z <= 0. Tetrahedra and parallelepipeds are hulls here.
struct Shape {
  Kind kind;
  double size[3];
  double radius;
  std::vector<double> x, y, z;       // the vertices of a hull, by coordinate
  std::vector<Vec3> normals, edges;  // of a polytope with few of them, else empty

  Vec3 support(const Vec3& d) const;  // the point of the core that is furthest along d
  // The smooth piece of the support function that is highest along d (support_pieces.hpp), the
  // point of a piece, and the derivative of that point: x . (d point / d d) y.
  int piece(const Vec3& d) const;
  Vec3 point_of(int piece, const Vec3& d) const;
  double curvature(int piece, const Vec3& d, const Vec3& x, const Vec3& y) const;
  double extent() const;  // bound on the distance of the core's points from the origin
  std::size_t highest_vertex(const Vec3& d) const;
  bool polytope() const { return kind == Kind::boxes || kind == Kind::hulls; }
};

struct LocalFrame {
  Vec3 row[3];  // of the rotation
  Vec3 at;
  Vec3 out(const Vec3& y) const {
    return Vec3{dot(row[0], y), dot(row[1], y), dot(row[2], y)} + at;
  }
  Vec3 turn(const Vec3& y) const { return {dot(row[0], y), dot(row[1], y), dot(row[2], y)}; }
  Vec3 back(const Vec3& d) const { return d[0] * row[0] + d[1] * row[1] + d[2] * row[2]; }
};

// The body of row `r` of a batch, grown by a ball, as a shape and its frame.
struct PlacedShape {
  Shape shape;
  LocalFrame frame;
};
void place(const Bodies& bodies, std::size_t r, double radius, PlacedShape* out);

// The motion of a body between two poses. The origin moves linearly, and the frame rotates at a
// constant rate by the shortest rotation vector. If `turn` is given, full turns are added to this
// vector so that it is as near to `turn` as possible.
RigidMotion motion_between(const double* xpos_t0, const double* xmat_t0, const double* xpos_t1,
                           const double* xmat_t1, const double* turn = nullptr);

// A shape on a moving body, or a simplex whose vertices move linearly. Positions are relative to
// `origin`, which the caller chooses near both shapes of a pair.
class SupportShape {
 public:
  SupportShape(const Shape& shape, const LocalFrame& in_body, const RigidMotion& motion,
               const Vec3& origin);
  SupportShape(const PlacedShape& at_rest, const Vec3& origin);
  SupportShape(const double* const* x_t0, const double* const* x_t1, int count, double radius,
               const Vec3& origin);

  void move_to(double t);
  Vec3 support(const Vec3& d) const;
  // As of Shape, in the common frame.
  int piece(const Vec3& d) const { return shape_->piece(frame_.back(d)); }
  Vec3 point_of(int piece, const Vec3& d) const {
    return frame_.out(shape_->point_of(piece, frame_.back(d)));
  }
  double curvature(int piece, const Vec3& d, const Vec3& x, const Vec3& y) const {
    return shape_->curvature(piece, frame_.back(d), frame_.back(x), frame_.back(y));
  }
  // The maximum over the core of n.(x - c) + h (r.(x - c) + n.(x' - drift)), and its slope in h.
  // For each point x the expression is the tangent, at h = 0, of the projection of x on n + h r.
  double tangent(const Vec3& n, const Vec3& r, double h, const Vec3& c, const Vec3& drift,
                 double* slope) const;
  // The bounds of the same names in MovingBody.
  double speed_about(const Vec3& drift) const;
  double acceleration(const Vec3& n, double drift) const;
  Vec3 angular() const { return corners_ ? Vec3{} : motion_->speed * motion_->axis; }
  Vec3 linear() const { return corners_ ? corners_->velocity[0] : motion_->linear; }
  Vec3 centre() const { return corners_ ? corners_->now[0] : centre_; }
  Vec3 middle() const;
  Vec3 plane_normal() const { return {frame_.row[0][2], frame_.row[1][2], frame_.row[2][2]}; }
  bool half_space() const { return shape_ != nullptr && shape_->kind == Kind::half_spaces; }
  double radius() const { return radius_; }
  double reach() const { return reach_; }
  double magnitude() const { return magnitude_; }

 private:
  const Shape* shape_ = nullptr;
  LocalFrame in_body_{}, frame_{};
  const RigidMotion* motion_ = nullptr;
  struct Corners {
    int count;
    Vec3 start[4], velocity[4], now[4];
  };
  std::optional<Corners> corners_;  // only of a simplex
  Vec3 shift_, centre_;
  double radius_ = 0, reach_ = 0, magnitude_ = 0;
};

}  // namespace tauguard::rigid
