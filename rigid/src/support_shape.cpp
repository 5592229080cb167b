#include "tauguard/rigid/support_shape.hpp"

#include <algorithm>

namespace tauguard::rigid {

std::size_t Shape::highest_vertex(const Vec3& d) const {
  std::size_t best = 0;
  double most = -INFINITY;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double p = d[0] * x[i] + d[1] * y[i] + d[2] * z[i];
    if (p > most) most = p, best = i;
  }
  return best;
}

Vec3 Shape::support(const Vec3& d) const {
  switch (kind) {
    case Kind::half_spaces:
    case Kind::points:
      return {0, 0, 0};
    case Kind::segments:
      return {0, 0, d[2] >= 0 ? size[1] : -size[1]};
    case Kind::boxes:
      return {d[0] >= 0 ? size[0] : -size[0], d[1] >= 0 ? size[1] : -size[1],
              d[2] >= 0 ? size[2] : -size[2]};
    case Kind::ellipsoids: {
      const Vec3 e = {size[0] * d[0], size[1] * d[1], size[2] * d[2]};
      const double length = norm(e);
      if (!(length > 0)) return {size[0], 0, 0};
      return {size[0] * e[0] / length, size[1] * e[1] / length, size[2] * e[2] / length};
    }
    case Kind::cylinders: {
      const double across = std::sqrt(d[0] * d[0] + d[1] * d[1]),
                   z = d[2] >= 0 ? size[1] : -size[1];
      if (!(across > 0)) return {0, 0, z};
      return {size[0] * d[0] / across, size[0] * d[1] / across, z};
    }
    case Kind::cones: {
      const double across = std::sqrt(d[0] * d[0] + d[1] * d[1]);
      if (size[0] * across <= 2 * size[1] * d[2]) return {0, 0, size[1]};
      if (!(across > 0)) return {0, 0, -size[1]};
      return {size[0] * d[0] / across, size[0] * d[1] / across, -size[1]};
    }
    case Kind::tetrahedra:
    case Kind::parallelepipeds:
    case Kind::polygons:
    case Kind::hulls: {
      const std::size_t best = highest_vertex(d);
      return {x[best], y[best], z[best]};
    }
  }
  return {};
}

int Shape::piece(const Vec3& d) const {
  switch (kind) {
    case Kind::half_spaces:
    case Kind::points:
    case Kind::ellipsoids:
      return 0;
    case Kind::segments:
    case Kind::cylinders:
      return d[2] >= 0;
    case Kind::cones:
      return size[0] * std::sqrt(d[0] * d[0] + d[1] * d[1]) <= 2 * size[1] * d[2];
    case Kind::boxes:
      return (d[0] >= 0 ? 1 : 0) | (d[1] >= 0 ? 2 : 0) | (d[2] >= 0 ? 4 : 0);
    default:
      return static_cast<int>(highest_vertex(d));
  }
}

Vec3 Shape::point_of(int piece, const Vec3& d) const {
  switch (kind) {
    case Kind::segments:
      return {0, 0, piece ? size[1] : -size[1]};
    case Kind::cylinders:
    case Kind::cones: {
      const double z = piece ? size[1] : -size[1], across = std::sqrt(d[0] * d[0] + d[1] * d[1]);
      if (!(across > 0) || (piece && kind == Kind::cones)) return {0, 0, z};
      return {size[0] * d[0] / across, size[0] * d[1] / across, z};
    }
    case Kind::boxes:
      return {piece & 1 ? size[0] : -size[0], piece & 2 ? size[1] : -size[1],
              piece & 4 ? size[2] : -size[2]};
    case Kind::hulls:
      return {x[piece], y[piece], z[piece]};
    default:
      return support(d);
  }
}

double Shape::curvature(int piece, const Vec3& d, const Vec3& u, const Vec3& v) const {
  if (kind == Kind::cylinders || (kind == Kind::cones && !piece)) {  // of the rim, r |d_xy|
    const double square = d[0] * d[0] + d[1] * d[1], turn = d[0] * u[1] - d[1] * u[0];
    return square > 0 ? size[0] * turn * (d[0] * v[1] - d[1] * v[0]) / (square * std::sqrt(square))
                      : 0;
  }
  if (kind == Kind::ellipsoids) {  // of the norm of e
    const auto scaled = [&](const Vec3& w) {
      return Vec3{size[0] * w[0], size[1] * w[1], size[2] * w[2]};
    };
    const Vec3 e = scaled(d), eu = scaled(u), ev = scaled(v);
    const double length = norm(e);
    return length > 0 ? (dot(eu, ev) - dot(e, eu) / length * (dot(e, ev) / length)) / length : 0;
  }
  return 0;
}

double Shape::extent() const {
  switch (kind) {
    case Kind::half_spaces:
    case Kind::points:
      return 0;
    case Kind::segments:
      return size[1];
    case Kind::boxes:
      return norm(Vec3{size[0], size[1], size[2]});
    case Kind::ellipsoids:
      return std::max({size[0], size[1], size[2]});
    case Kind::cylinders:
    case Kind::cones:
      return std::hypot(size[0], size[1]);
    case Kind::tetrahedra:
    case Kind::parallelepipeds:
    case Kind::polygons:
    case Kind::hulls: {
      double most = 0;
      for (std::size_t i = 0; i < x.size(); ++i)
        most = std::max(most, norm(Vec3{x[i], y[i], z[i]}));
      return most;
    }
  }
  return 0;
}

void place(const Bodies& bodies, std::size_t r, double radius, PlacedShape* out) {
  const double* p = bodies.row(r);
  Shape& shape = out->shape;
  LocalFrame& frame = out->frame;
  shape.kind = bodies.kind, shape.radius = radius;
  switch (bodies.kind) {
    case Kind::boxes:
    case Kind::ellipsoids:
    case Kind::cylinders:
    case Kind::cones:
      std::copy(p + 3, p + 6, shape.size);
      frame = {{geometry::load(p + 6), geometry::load(p + 9), geometry::load(p + 12)},
               geometry::load(p)};
      return;
    case Kind::half_spaces: {
      const Vec3 raw = geometry::load(p), n = (1 / norm(raw)) * raw;
      Vec3 side{};
      side[geometry::smallest_axis(n)] = 1;
      const Vec3 across = cross(n, side), u = (1 / norm(across)) * across, v = cross(n, u);
      for (int i = 0; i < 3; ++i) frame.row[i] = {u[i], v[i], n[i]};
      frame.at = (p[3] / norm(raw)) * n;
      return;
    }
    default: {
      shape.kind = Kind::hulls;
      frame = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {}};
      const Points<double> vertices = vertices_of<double>(bodies, r);
      frame.at = vertices[0];
      shape.x.clear(), shape.y.clear(), shape.z.clear();
      for (const Vec3& v : vertices) {
        const Vec3 y = v - frame.at;
        shape.x.push_back(y[0]), shape.y.push_back(y[1]), shape.z.push_back(y[2]);
      }
    }
  }
}

namespace {

const RigidMotion& no_motion() {
  static const double pose[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, zero[3] = {};
  static const RigidMotion motion(pose, zero, zero);
  return motion;
}

// Adds full turns to the rotation vector `angular` so that it is as near as possible to `turn`.
void add_turns(const double* turn, double* angular) {
  const Vec3 to = {turn[0], turn[1], turn[2]}, from = {angular[0], angular[1], angular[2]};
  const double angle = norm(from), far = norm(to);
  if (!(far > 0)) return;
  const Vec3 axis = angle > 1e-9 ? (1 / angle) * from : (1 / far) * to;
  const double whole = 2 * M_PI * std::round((dot(to, axis) - angle) / (2 * M_PI));
  for (int i = 0; i < 3; ++i) angular[i] += whole * axis[i];
}

}  // namespace

RigidMotion motion_between(const double* xpos_t0, const double* xmat_t0, const double* xpos_t1,
                           const double* xmat_t1, const double* turn) {
  double pose[16] = {}, linear[3], angular[3] = {};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) pose[4 * i + j] = xmat_t0[3 * i + j];
    pose[4 * i + 3] = xpos_t0[i];
    linear[i] = xpos_t1[i] - xpos_t0[i];
  }
  pose[15] = 1;
  if (!std::equal(xmat_t0, xmat_t0 + 9, xmat_t1)) {
    double r[3][3];  // from the first orientation to the second, world frame
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        r[i][j] = xmat_t1[3 * i] * xmat_t0[3 * j] + xmat_t1[3 * i + 1] * xmat_t0[3 * j + 1] +
                  xmat_t1[3 * i + 2] * xmat_t0[3 * j + 2];
    // The quaternion is computed from its largest entry (Shepperd 1978), accurate for every angle.
    const double trace = r[0][0] + r[1][1] + r[2][2];
    double q[4];
    int k = -1;
    for (int i = 0; i < 3; ++i)
      if (r[i][i] > (k < 0 ? trace : r[k][k])) k = i;
    if (k < 0) {
      const double s = 2 * std::sqrt(std::max(0.0, 1 + trace));
      q[0] = s / 4;
      q[1] = (r[2][1] - r[1][2]) / s, q[2] = (r[0][2] - r[2][0]) / s,
      q[3] = (r[1][0] - r[0][1]) / s;
    } else {
      const int j = (k + 1) % 3, l = (k + 2) % 3;
      const double s = 2 * std::sqrt(std::max(0.0, 1 + r[k][k] - r[j][j] - r[l][l]));
      q[0] = (r[l][j] - r[j][l]) / s;
      q[1 + k] = s / 4, q[1 + j] = (r[j][k] + r[k][j]) / s, q[1 + l] = (r[l][k] + r[k][l]) / s;
    }
    const Vec3 axis = {q[1], q[2], q[3]};
    const double sine = norm(axis), sign = q[0] < 0 ? -1 : 1;
    if (sine > 0) {
      const double scale = sign * 2 * std::atan2(sine, std::fabs(q[0])) / sine;
      for (int i = 0; i < 3; ++i) angular[i] = scale * axis[i];
    }
  }
  if (turn) add_turns(turn, angular);
  return RigidMotion(pose, linear, angular);
}

SupportShape::SupportShape(const Shape& shape, const LocalFrame& in_body, const RigidMotion& motion,
                           const Vec3& origin)
    : shape_(&shape),
      in_body_(in_body),
      motion_(&motion),
      shift_(motion.x0 - origin),
      radius_(shape.radius) {
  reach_ = norm(in_body.at) + shape.extent();
  magnitude_ = norm(shift_) + norm(motion.linear) + (4 + motion.speed) * reach_ + radius_;
}

SupportShape::SupportShape(const PlacedShape& at_rest, const Vec3& origin)
    : SupportShape(at_rest.shape, at_rest.frame, no_motion(), origin) {
  centre_ = -1.0 * origin;
  frame_ = {{in_body_.row[0], in_body_.row[1], in_body_.row[2]}, in_body_.at - origin};
}

SupportShape::SupportShape(const double* const* x_t0, const double* const* x_t1, int count,
                           double radius, const Vec3& origin)
    : corners_(Corners{count, {}, {}, {}}), radius_(radius) {
  Vec3 *start = corners_->start, *velocity = corners_->velocity;
  for (int i = 0; i < count; ++i) {
    const Vec3 from = geometry::load(x_t0[i]);
    start[i] = from - origin;
    velocity[i] = geometry::load(x_t1[i]) - from;
    magnitude_ = std::max(magnitude_, norm(start[i]) + norm(velocity[i]) + radius);
    reach_ = std::max(reach_, norm(start[i] - start[0]));
  }
}

void SupportShape::move_to(double t) {
  if (corners_) {
    Corners& c = *corners_;
    for (int i = 0; i < c.count; ++i) c.now[i] = c.start[i] + t * c.velocity[i];
    return;
  }
  centre_ = shift_ + t * motion_->linear;
  LocalFrame body{{motion_->r0[0], motion_->r0[1], motion_->r0[2]}, centre_};
  if (motion_->speed != 0) {
    const double angle = motion_->speed * t, c = std::cos(angle), s = std::sin(angle),
                 half = std::sin(0.5 * angle);
    const Vec3& u = motion_->axis;
    for (int j = 0; j < 3; ++j) {  // column j is the rotated axis j
      const Vec3 w = {motion_->r0[0][j], motion_->r0[1][j], motion_->r0[2][j]};
      const Vec3 turned = c * w + s * cross(u, w) + (2 * half * half * dot(u, w)) * u;
      for (int i = 0; i < 3; ++i) body.row[i][j] = turned[i];
    }
  }
  frame_.at = body.out(in_body_.at);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      frame_.row[i][j] = body.row[i][0] * in_body_.row[0][j] + body.row[i][1] * in_body_.row[1][j] +
                         body.row[i][2] * in_body_.row[2][j];
}

Vec3 SupportShape::support(const Vec3& d) const {
  if (!corners_) return frame_.out(shape_->support(frame_.back(d)));
  const Vec3* now = corners_->now;
  int best = 0;
  double most = dot(d, now[0]);
  for (int i = 1; i < corners_->count; ++i) {
    const double p = dot(d, now[i]);
    if (p > most) most = p, best = i;
  }
  return now[best];
}

double SupportShape::tangent(const Vec3& n, const Vec3& r, double h, const Vec3& c,
                             const Vec3& drift, double* slope) const {
  if (!corners_) {
    // For x = centre + y: x' = linear + w x y, and n.(w x y) = y.(n x w).
    const Vec3 rate = r + cross(n, angular()), m = n + h * rate;
    const Vec3 y = support(m) - centre_, from = centre_ - c;
    const double straight = dot(r, from) + dot(n, motion_->linear - drift);
    *slope = straight + dot(rate, y);
    return dot(n, from) + h * straight + dot(m, y);
  }
  double most = -INFINITY;
  for (int i = 0; i < corners_->count; ++i) {
    const Vec3 x = corners_->now[i] - c;
    const double v = dot(r, x) + dot(n, corners_->velocity[i] - drift), p = dot(n, x) + h * v;
    if (p > most) most = p, *slope = v;
  }
  return most;
}

double SupportShape::speed_about(const Vec3& drift) const {
  if (!corners_) return norm(motion_->linear - drift) + motion_->speed * reach_;
  double most = 0;
  for (int i = 0; i < corners_->count; ++i)
    most = std::max(most, norm(corners_->velocity[i] - drift));
  return most;
}

double SupportShape::acceleration(const Vec3& n, double drift) const {
  if (corners_ || motion_->speed == 0) return 0;
  const Vec3 across = n - dot(n, motion_->axis) * motion_->axis;
  return motion_->speed * motion_->speed * reach_ * (norm(across) + drift + 0x1p-40);
}

Vec3 SupportShape::middle() const {
  if (!corners_) return frame_.at;
  Vec3 sum{};
  for (int i = 0; i < corners_->count; ++i) sum += corners_->now[i];
  return (1.0 / corners_->count) * sum;
}

}  // namespace tauguard::rigid
