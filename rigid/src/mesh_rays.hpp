// Queries of points and rays on one mesh. They use the boxes along the axes, which every tree has;
// tests of boxes are in double precision.
#pragma once

#include "mesh_query.hpp"
#include "tauguard/geometry/vec3.hpp"

namespace tauguard::rigid {

using geometry::Vec3;

// The point of the mesh nearest to p. The distance has an error of at most 2^-44 times the largest
// coordinate of a triangle relative to p.
struct NearestPoint {
  double distance;
  Vec3 point;
  std::int32_t face;  // row of the faces; the first one if several are equally near
};
NearestPoint nearest_point(const Mesh& mesh, const Vec3& p);

// Whether p is on the surface, exactly.
bool on_surface(const Mesh& mesh, const Vec3& p);

// How often the surface winds around p, which is not on it. For a closed surface whose faces turn
// counter-clockwise seen from outside it is 1 inside and 0 outside. Exact.
int winding(const Mesh& mesh, const Vec3& p);

// The first triangle that the ray from `origin` along `direction` (not zero) meets. Exactly
// decided: edges and corners belong to the triangles, so a ray cannot pass between two faces.
// Triangles whose plane contains the ray are passed.
struct RayHit {
  double distance;    // along the ray, in the unit of the mesh; inf if there is none
  std::int32_t face;  // -1 if there is none
};
RayHit cast_ray(const Mesh& mesh, const Vec3& origin, const Vec3& direction);

}  // namespace tauguard::rigid
