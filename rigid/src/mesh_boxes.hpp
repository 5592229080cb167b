// Separating-axis test of eight boxes of one tree against a box of another, under a pose
// (Gottschalk, Lin and Manocha 1996). All boxes of a tree have the same axes. Boxes that overlap
// are never reported as apart.
#pragma once

#include "mesh_tree.hpp"

namespace tauguard::rigid {

// The pose of one tree in another (both relative to their centres), in float; a pad for rounding.
struct Relative {
  float r[3][3], abs_r[3][3], t[3], pad;
};

// A pose x -> R x + t. By definition the corners of a posed triangle are the values in doubles,
// with sums from left to right. Exact answers are exact for these corners.
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

  // The pad covers the errors of a test of two boxes. Let S be the sum of the radii of both trees'
  // bounding balls. If the balls meet, centred coordinates are at most 2 S.
  // * Float: a test has fewer than 60 roundings of values of at most 6 S. This includes 12 in an
  //   entry of the relative rotation of oriented boxes, which multiplies lengths of at most 4 S.
  //   2^-24 * 2^8 S covers them, and 2^-140 covers roundings of subnormal numbers.
  // * Double: centres and transformed corners have errors of at most 16 * 2^-53 times the largest
  //   magnitude that enters them.
  // * Rotation: R^T is used as the inverse of R. If entries of R^T R - I are at most `skew`, the
  //   error in a vector of length 2 S is at most 6 * skew * S.
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
// `box` in the frame of `node`. `distance2` receives the squared distances of the centres.
unsigned overlap_mask(const Node& node, const Box& box, const Relative& rel, float* distance2);

}  // namespace tauguard::rigid
