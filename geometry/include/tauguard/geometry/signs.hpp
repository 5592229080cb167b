// Signs of small determinants: a floating-point filter with a derived bound, then exact arithmetic.
#pragma once

#include <cmath>

#include "tauguard/geometry/dyadic.hpp"
#include "tauguard/geometry/rounding.hpp"

namespace tauguard::geometry {

inline int sign_of(double x) { return (x > 0) - (x < 0); }

// Sign of det[b - a, c - a, d - a] = (b - a) x (c - a) . (d - a). It is positive where a, b, c turn
// counter-clockwise as seen from d. Exact for all finite doubles; needs RoundToNearest.
//
// Error bound of the filter, with u the unit roundoff and P the permanent (the determinant with the
// absolute value of every term):
// * Each of the six terms contains 3 differences and 2 products: at most 5 u P in all.
// * Their sum has at most 5 roundings: at most 5 u P.
// * P is computed with the same relative error, so 16 u times the computed P exceeds 10 u P.
// * An underflow adds at most 2^-1074 times the other factor. For P > 1e-250 the difference between
//   16 and 10 covers this.
inline int orient3d(const double* a, const double* b, const double* c, const double* d) {
  const double ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2];
  const double vx = c[0] - a[0], vy = c[1] - a[1], vz = c[2] - a[2];
  const double wx = d[0] - a[0], wy = d[1] - a[1], wz = d[2] - a[2];
  const double yz = uy * vz, zy = uz * vy, zx = uz * vx, xz = ux * vz, xy = ux * vy, yx = uy * vx;
  const double det = (yz - zy) * wx + (zx - xz) * wy + (xy - yx) * wz;
  const double permanent = (std::fabs(yz) + std::fabs(zy)) * std::fabs(wx) +
                           (std::fabs(zx) + std::fabs(xz)) * std::fabs(wy) +
                           (std::fabs(xy) + std::fabs(yx)) * std::fabs(wz);
  if (permanent > 1e-250 && permanent < 1e300 && std::fabs(det) > 16 * unit_roundoff * permanent)
    return sign_of(det);
  Dyadic m[3][3];
  for (int k = 0; k < 3; ++k) {
    const Dyadic o(a[k]);
    m[0][k] = Dyadic(b[k]) - o;
    m[1][k] = Dyadic(c[k]) - o;
    m[2][k] = Dyadic(d[k]) - o;
  }
  return ((m[0][1] * m[1][2] - m[0][2] * m[1][1]) * m[2][0] +
          (m[0][2] * m[1][0] - m[0][0] * m[1][2]) * m[2][1] +
          (m[0][0] * m[1][1] - m[0][1] * m[1][0]) * m[2][2])
      .sign();
}

// Sign of det[b - a, c - a] in the plane: positive where a, b, c turn counter-clockwise.
inline int orient2d(const double* a, const double* b, const double* c) {
  const double ux = b[0] - a[0], uy = b[1] - a[1], vx = c[0] - a[0], vy = c[1] - a[1];
  const double left = ux * vy, right = uy * vx, det = left - right;
  const double permanent = std::fabs(left) + std::fabs(right);
  if (permanent > 1e-250 && permanent < 1e300 && std::fabs(det) > 8 * unit_roundoff * permanent)
    return sign_of(det);
  const Dyadic ax(a[0]), ay(a[1]);
  return ((Dyadic(b[0]) - ax) * (Dyadic(c[1]) - ay) - (Dyadic(b[1]) - ay) * (Dyadic(c[0]) - ax))
      .sign();
}

}  // namespace tauguard::geometry
