#include "tauguard/rigid/moving_body.hpp"

namespace tauguard::rigid {

MovingBody moving_body(const Bodies& bodies, std::size_t r, const RigidMotion& motion,
                       const Vec3& origin) {
  MovingBody body(motion, origin);
  const Points<double> v = vertices_of<double>(bodies, r);
  for (const Vec3& p : v) body.add_vertex(p);
  const double* row = bodies.row(r);
  if (bodies.kind == Kind::boxes) {
    for (int k = 0; k < 3; ++k) {
      const Vec3 axis = {row[6 + k], row[9 + k], row[12 + k]};
      body.add_normal(axis), body.add_edge(axis);
    }
  } else if (bodies.kind == Kind::parallelepipeds) {
    const Vec3 e[3] = {
        {row[3], row[4], row[5]}, {row[6], row[7], row[8]}, {row[9], row[10], row[11]}};
    for (int k = 0; k < 3; ++k) body.add_normal(cross(e[k], e[(k + 1) % 3])), body.add_edge(e[k]);
    body.complete =
        std::fabs(dot(e[0], cross(e[1], e[2]))) > 1e-9 * norm(e[0]) * norm(e[1]) * norm(e[2]);
  } else if (bodies.kind == Kind::tetrahedra) {
    for (int i = 0; i < 4; ++i)
      for (int j = i + 1; j < 4; ++j) {
        body.add_edge(v[j] - v[i]);
        for (int k = j + 1; k < 4; ++k) body.add_normal(cross(v[j] - v[i], v[k] - v[i]));
      }
    const Vec3 x = v[1] - v[0], y = v[2] - v[0], z = v[3] - v[0];
    body.complete = std::fabs(dot(x, cross(y, z))) > 1e-9 * norm(x) * norm(y) * norm(z);
  } else {
    body.complete = false;
  }
  return body;
}

MovingBody moving_triangle(const double v[3][3], const RigidMotion& motion, const Vec3& origin) {
  MovingBody body(motion, origin);
  Vec3 p[3];
  for (int i = 0; i < 3; ++i) p[i] = {v[i][0], v[i][1], v[i][2]}, body.add_vertex(p[i]);
  const Vec3 n = cross(p[1] - p[0], p[2] - p[0]);
  body.add_normal(n);
  for (int i = 0; i < 3; ++i) {
    const Vec3 e = p[(i + 1) % 3] - p[i];
    body.add_edge(e), body.add_normal(cross(e, n));
  }
  body.complete = norm(n) > 1e-9 * norm(p[1] - p[0]) * norm(p[2] - p[0]);
  return body;
}

}  // namespace tauguard::rigid
