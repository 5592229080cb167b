#include "mesh_boxes.hpp"

#include "tauguard/geometry/lanes.hpp"

namespace tauguard::rigid {

using namespace geometry;  // lanes.hpp

TAUGUARD_CLONES unsigned overlap_mask(const Node& node, const Box& box, const Relative& rel,
                                      float* distance2) {
  const Float8* centre = reinterpret_cast<const Float8*>(node.centre);
  const Float8* e = reinterpret_cast<const Float8*>(node.extent);
  Float8 d[3];
  Mask8 hit = (Mask8){} - 1;
  for (int i = 0; i < 3; ++i) {
    const float c = ((rel.r[i][0] * box.centre[0] + rel.r[i][1] * box.centre[1]) +
                     rel.r[i][2] * box.centre[2]) +
                    rel.t[i];
    const float reach = ((rel.abs_r[i][0] * box.extent[0] + rel.abs_r[i][1] * box.extent[1]) +
                         rel.abs_r[i][2] * box.extent[2]) +
                        rel.pad;
    d[i] = c - centre[i];
    hit &= (Mask8)(abs(d[i]) <= e[i] + reach);
  }
  const Float8 square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
  std::memcpy(distance2, &square, sizeof square);
  for (int j = 0; j < 3; ++j) {
    const Float8 along = (d[0] * rel.r[0][j] + d[1] * rel.r[1][j]) + d[2] * rel.r[2][j];
    const Float8 reach = (e[0] * rel.abs_r[0][j] + e[1] * rel.abs_r[1][j]) + e[2] * rel.abs_r[2][j];
    hit &= (Mask8)(abs(along) <= reach + (box.extent[j] + rel.pad));
  }
  if (bits8(hit) == 0) return 0;
  for (int i = 0; i < 3; ++i) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      const float own =
          (box.extent[j1] * rel.abs_r[i][j2] + box.extent[j2] * rel.abs_r[i][j1]) + rel.pad;
      const Float8 reach = (e[i1] * rel.abs_r[i2][j] + e[i2] * rel.abs_r[i1][j]) + own;
      hit &= (Mask8)(abs(d[i2] * rel.r[i1][j] - d[i1] * rel.r[i2][j]) <= reach);
    }
  }
  return bits8(hit);
}

}  // namespace tauguard::rigid
