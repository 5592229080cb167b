// One body of a batch moved by a pose. The numbers of its row are transformed and rounded: a vertex
// y becomes R y + t. Queries are exact for the body of the rounded numbers.
#pragma once

#include <vector>

#include "tauguard/rigid/bodies.hpp"

namespace tauguard::rigid {

class PosedBody {
 public:
  // R x + share t
  static void point(const double* pose, const double* x, double share, double* out) {
    for (int i = 0; i < 3; ++i)
      out[i] = (pose[4 * i] * x[0] + pose[4 * i + 1] * x[1] + pose[4 * i + 2] * x[2]) +
               share * pose[4 * i + 3];
  }

  // The body of row r at `pose` (homogeneous, 16 doubles by rows), as a batch of one.
  const Bodies& place(const Bodies& bodies, std::size_t r, const double* pose) {
    const double* p = bodies.row(r);
    const std::size_t count = bodies.vertex_count(r);
    switch (bodies.kind) {
      case Kind::tetrahedra:
      case Kind::hulls:
        out_.resize(3 * count);
        for (std::size_t i = 0; i < count; ++i) point(pose, p + 3 * i, 1, &out_[3 * i]);
        break;
      case Kind::parallelepipeds:
        out_.resize(12);
        for (int i = 0; i < 4; ++i) point(pose, p + 3 * i, i == 0, &out_[3 * i]);
        break;
      case Kind::half_spaces:
        out_.resize(4);
        point(pose, p, 0, out_.data());
        out_[3] = p[3] + out_[0] * pose[3] + out_[1] * pose[7] + out_[2] * pose[11];
        break;
      default:  // centre, sizes, rotation
        out_.resize(15);
        point(pose, p, 1, out_.data());
        std::copy(p + 3, p + 6, &out_[3]);
        for (int j = 0; j < 3; ++j) {
          const double column[3] = {p[6 + j], p[9 + j], p[12 + j]};
          double turned[3];
          point(pose, column, 0, turned);
          for (int i = 0; i < 3; ++i) out_[6 + 3 * i + j] = turned[i];
        }
    }
    offsets_[1] = static_cast<std::int64_t>(count);
    view_ = {bodies.kind, out_.data(), offsets_, 1};
    return view_;
  }

 private:
  std::vector<double> out_;
  std::int64_t offsets_[2] = {0, 0};
  Bodies view_{};
};

}  // namespace tauguard::rigid
