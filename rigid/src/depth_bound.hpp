// A lower bound of the depth of the origin in a polytope of differences computed in doubles.
//
// For bodies of very different sizes, faces have edges that are almost parallel, and rounding turns
// their normals by any angle. So nothing below depends on the accuracy of a normal. For any n, a
// triangle lies in the half-space n . x >= m, where m is the least n . y of its three corners y.
// Only the rounding of these products matters. With u the unit roundoff and all coordinates of both
// bodies at most s, |y| <= 2 sqrt(3) s, and a product is off by 3 u |n| |y| <= 11 u |n| s.
//
// The surface S of all faces is closed, convex or not: a step replaces faces by the cone over their
// rim. Let c be the centre of the first tetrahedron.
// 1. n . c < m for every face ever made. `side` is 4 (n . c - n . y) for one corner y. It is off by
//    at most 142 u |n| s: twice 42 by its products, 27 by their difference, 31 by the rounding of
//    c. Four times the largest |n . y - n . y'| of the corners is off by 112. More than 512 is
//    required (unsure). So the centre is in no face of the first tetrahedron, and thus inside it.
// 2. A corner w that replaces a face is further along n than y, except for 28 u |n| s of rounding;
//    the 512 cover four times that too. So c is not in the tetrahedron of w and that face, and the
//    number of times that S winds around c stays odd.
// 3. If 0 < m for all faces of the final S, no face meets the segment from c to the origin, and S
//    winds around the origin an odd number of times. No face is nearer to the origin than
//    L = m / |n|, so the same holds around every point of the ball of radius L. A closed surface
//    does not wind around a point outside the hull of its corners, so the ball is in the hull.
// L is off by 23 u s. The stored corners are off by 16 u s (two coordinates, two differences and a
// sum of that size); S keeps its winding if they move by less than L, so this costs 16 u s.
#pragma once

#include <algorithm>
#include <cmath>

#include "expanding_polytope.hpp"

namespace tauguard::rigid {

// A lower bound of the depth, off by at most 39 u of the size. If it is 0 or less, nothing is
// known.
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
