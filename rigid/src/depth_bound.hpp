// A lower bound of the depth of the origin in a polytope of differences computed in doubles.
//
// If the bodies have very different sizes, faces have nearly parallel edges, and rounding can turn
// their normals by any angle. The bound therefore holds for any vector n as the normal of a face.
// For any n, the face is in the half-space n . x >= m, where m is the least n . y of its corners y.
// Only the rounding of these products matters. Let u be the unit roundoff and s a bound on all
// coordinates of both bodies. Then |y| <= 2 sqrt(3) s, and the error of a product is at most
// 3 u |n| |y| <= 11 u |n| s.
//
// The surface S of all faces is closed, because each step of the expansion replaces faces by the
// cone over their rim; it need not be convex. Let c be the centre of the first tetrahedron.
// 1. n . c < m for every face ever made. The code computes side = 4 (n . c - n . y) for one corner
//    y, and 4 max |n . y - n . y'| over the other corners y'. Errors, in units of u |n| s: at most
//    142 of `side` (84 from its products, 27 from their difference, 31 from the rounding of c), and
//    at most 112 of the maximum. `unsure` requires that |side| exceeds the maximum by 512. So c is
//    in no face of the first tetrahedron, and thus inside it.
// 2. A corner w that replaces a face is further along n than y, up to a rounding error of 28 u |n|
//    s. The margin of 512 covers four times this error, too. So c is not in the tetrahedron of w
//    and that face, and the number of times that S winds around c stays odd.
// 3. If 0 < m for all faces of the final S, no face meets the segment from c to the origin, and S
//    winds around the origin an odd number of times. Let L be the least m / |n|. No face is nearer
//    to the origin than L, so S winds in the same way around every point of the ball of radius L. A
//    closed surface does not wind around a point outside the hull of its corners, so the ball is in
//    the hull, and L is a lower bound of the depth.
// 4. The error of the computed L is at most 23 u s. The error of a stored corner is at most 16 u s
//    (two coordinates, two differences and their sum). Moving corners by less than L does not
//    change how S winds around the origin, so this error lowers the bound by at most 16 u s.
#pragma once

#include <algorithm>
#include <cmath>

#include "expanding_polytope.hpp"

namespace tauguard::rigid {

// The bound L, with an error of at most 39 u times the size. L <= 0 is no bound.
template <class Polytope>
double least_depth(const Polytope& polytope) {
  double least = INFINITY;
  for (const auto& face : polytope.faces()) {
    double low = INFINITY;
    for (const int corner : face.corner)
      low = std::min(low, dot(face.normal, polytope.point(corner)));
    least = std::min(least, low / std::sqrt(face.square));
  }
  return least;
}

}  // namespace tauguard::rigid
