// Boxes of one tree against a box of the other, under a pose: the separating-axis test, eight boxes
// at a time (Gottschalk, Lin and Manocha 1996). All boxes of a tree share one rotation. Boxes that
// meet are never called clear.
#pragma once

#include "mesh_tree.hpp"

namespace tauguard::rigid {

// The pose of one tree's centred frame in another's, in float, with the pad that covers all
// rounding.
struct Relative {
  float r[3][3], abs_r[3][3], t[3], pad;
};

// A pose as given: x -> R x + t, with products summed from left to right. This expression, in
// doubles, defines the corner of a posed triangle; every exact answer is about these doubles.
struct Pose {
  double r[3][3], t[3];
  explicit Pose(const double* m) {
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) r[i][j] = m[4 * i + j];
      t[i] = m[4 * i + 3];
    }
  }
  void apply(const double* x, double* out) const {
    for (int i = 0; i < 3; ++i)
      out[i] = ((r[i][0] * x[0] + r[i][1] * x[1]) + r[i][2] * x[2]) + t[i];
  }
  Triangle apply(const Triangle& s) const {
    Triangle out;
    for (int c = 0; c < 3; ++c) apply(s.v[c], out.v[c]);
    return out;
  }
};

// The relative poses of two trees in both directions; b is posed in a's frame.
struct Placement {
  Relative b_in_a, a_in_b;
  bool apart;  // the bounding balls do not meet

  // The pad. With S the sum of both radii (every centred coordinate is at most 2 S once the balls
  // meet), a float test of two boxes makes fewer than 60 roundings of values at most 6 S, counting
  // those behind oriented boxes' axes (12 in an entry of the relative rotation, which multiplies
  // lengths of at most 4 S): 2^-24 * 2^8 S covers them, and 2^-140 those below the normal range.
  // The doubles behind them (centres, transformed corners) err by at most 16 * 2^-53 of the largest
  // magnitude in play. R is within `skew` of orthonormal in every entry of R^T R - I, and R^T
  // stands for its inverse: 6 * skew * S covers a vector of length 2 S whose three coordinates each
  // meet three entries.
  Placement(const Tree& a, const Tree& b, const Pose& pose, double margin = 0) {
    double t[3], skew = 0, square = 0, largest = a.magnitude;
    for (int i = 0; i < 3; ++i) {
      t[i] =
          ((pose.r[i][0] * b.centre[0] + pose.r[i][1] * b.centre[1]) + pose.r[i][2] * b.centre[2]) +
          (pose.t[i] - a.centre[i]);
      square += t[i] * t[i];
      largest = std::max(largest, 2 * b.magnitude + std::fabs(pose.t[i]));
      for (int j = 0; j < 3; ++j) {
        double dot = i == j ? -1.0 : 0.0;
        for (int k = 0; k < 3; ++k) dot += pose.r[k][i] * pose.r[k][j];
        skew = std::max(skew, std::fabs(dot));
      }
    }
    const double reach = a.radius + b.radius;
    const double pad = 0x1p-16 * reach + 0x1p-140 + 6 * skew * reach + 0x1p-48 * largest + margin;
    apart = std::sqrt(square) > (reach + pad) * (1 + 4 * skew + 0x1p-40);
    for (int i = 0; i < 3; ++i) {
      b_in_a.t[i] = static_cast<float>(t[i]);
      a_in_b.t[i] =
          static_cast<float>(-(pose.r[0][i] * t[0] + pose.r[1][i] * t[1] + pose.r[2][i] * t[2]));
      for (int j = 0; j < 3; ++j) {
        b_in_a.r[i][j] = static_cast<float>(pose.r[i][j]);
        a_in_b.r[i][j] = static_cast<float>(pose.r[j][i]);
        b_in_a.abs_r[i][j] = std::fabs(b_in_a.r[i][j]);
        a_in_b.abs_r[i][j] = std::fabs(a_in_b.r[i][j]);
      }
    }
    b_in_a.pad = a_in_b.pad = std::nextafter(static_cast<float>(pad), INFINITY);
  }
};

// Sets bit s if the box of child s of `node` may meet `box`. `rel` is the pose of the frame of
// `box` in that of the node. `distance2` receives the squared distances of the centres.
unsigned overlap_mask(const Node& node, const Box& box, const Relative& rel, float* distance2);

}  // namespace tauguard::rigid
