// Signed distance of two convex bodies, row by row.
#pragma once

#include <optional>

#include "hull_index.hpp"
#include "tauguard/rigid/moving_body.hpp"

namespace tauguard::rigid {

// distance = (point_b - point_a) . normal, with a unit normal from a to b. If the bodies are apart,
// the distance is the length of the shortest segment between them. If they overlap, it is minus the
// length of the shortest translation that separates them, which is along the normal.
struct SignedDistance {
  double distance;
  Vec3 point_a, point_b, normal;
};

// The signed distance of row `row`, with each body grown by a ball of the given radius. For other
// bodies than polytopes it is that of support_distance.hpp; for polytopes the sign is
// exact, and the error is at most 2^-45 times the largest coordinate relative to a point of a.
SignedDistance signed_distance(const Bodies& a, const Bodies& b, std::size_t row, double radius_a,
                               double radius_b);

// A result in double precision is accepted if its upper and lower bound of the distance differ by
// at most this fraction of the size (the largest coordinate). Its error is then below 2^-45 of the
// size, or 256 unit roundoffs, which have these parts:
//   128    difference of the bounds,
//   18     rounding of the vertices,
//   21     rounding of the upper bound,
//   69     rounding of the lower bound: at most 18 if the bodies are apart, 39 in least_depth, and
//          21 + 48 in FacetDepth (48 for the facets that it leaves out).
inline constexpr double certain = 0x1p-46;
// Distances below this fraction of the size need exact arithmetic, for the sign.
inline constexpr double near = 1e-10;
// Inside this range products of four lengths neither overflow nor underflow.
inline bool in_range(double size) { return size > 1e-40 && size < 1e40; }

// The largest coordinate of two lists of points.
double size_of(const Points<double>& a, const Points<double>& b);
// Vertices relative to `origin`. Each subtraction is rounded once: a relative error of u.
void local_points(const Bodies& bodies, std::size_t row, const Vec3& origin, Points<double>* out);
// The result for bodies that are apart, and for overlapping bodies, which touch after b is moved by
// `depth` along n.
SignedDistance apart(const Vec3& point_a, const Vec3& point_b);
SignedDistance together(const Points<double>& a, const Points<double>& b, const Vec3& n,
                        double depth, double size);

// The result for bodies grown by balls. If `known`, `sign` is the exact sign of the distance.
SignedDistance grown(SignedDistance g, double radius_a, double radius_b, int sign, bool known);

// As signed_distance for bodies at poses of which one is an indexed hull. False if the result is
// not certain; otherwise it has the same bounds, and the same bits if the bodies are apart.
bool posed_distance(const PosedRow& a, const PosedRow& b, double radius_a, double radius_b,
                    SignedDistance* out);
// Whether such bodies share a point, if this is certain.
std::optional<bool> posed_meet(const PosedRow& a, const PosedRow& b, double radius_a,
                               double radius_b);

// Whether the grown bodies of row `row` share a point, exactly. Touching counts.
bool meet(const Bodies& a, const Bodies& b, std::size_t row, double radius_a, double radius_b);

}  // namespace tauguard::rigid
