// Eigenvectors of a symmetric 3x3 matrix.
#pragma once

#include <cmath>

namespace tauguard::rigid {

// Writes the eigenvectors of `m` to the rows of `axis`, by cyclic Jacobi rotations. Afterwards `m`
// is diagonal up to the tolerance.
inline void eigenvectors(double m[3][3], double axis[3][3]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) axis[i][j] = i == j;
  for (int sweep = 0; sweep < 12; ++sweep) {
    // An error of about 1e-6 rad in a direction does not widen a box noticeably.
    const double off = m[0][1] * m[0][1] + m[0][2] * m[0][2] + m[1][2] * m[1][2];
    const double trace = m[0][0] + m[1][1] + m[2][2];
    if (!(off > 1e-12 * trace * trace)) break;
    for (int p = 0; p < 2; ++p)
      for (int q = p + 1; q < 3; ++q) {
        if (m[p][q] == 0) continue;
        const double theta = (m[q][q] - m[p][p]) / (2 * m[p][q]);
        const double t = (theta >= 0 ? 1 : -1) / (std::fabs(theta) + std::sqrt(theta * theta + 1));
        const double c = 1 / std::sqrt(t * t + 1), s = t * c;
        if (!std::isfinite(theta)) continue;
        for (int k = 0; k < 3; ++k) {
          const double x = m[k][p], y = m[k][q];
          m[k][p] = c * x - s * y, m[k][q] = s * x + c * y;
        }
        for (int k = 0; k < 3; ++k) {
          const double x = m[p][k], y = m[q][k];
          m[p][k] = c * x - s * y, m[q][k] = s * x + c * y;
          const double u = axis[p][k], v = axis[q][k];
          axis[p][k] = c * u - s * v, axis[q][k] = s * u + c * v;
        }
      }
  }
}

}  // namespace tauguard::rigid
