#include "mesh_obb.hpp"

#include "tauguard/geometry/lanes.hpp"

namespace tauguard::rigid {

using namespace geometry;  // lanes.hpp

FloatObb ObbNode::operator[](int s) const {
  FloatObb box;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) box.axis[i][k] = axis[i][k][s];
    box.centre[i] = centre[i][s], box.extent[i] = extent[i][s];
  }
  return box;
}

void ObbNode::set(int s, const FloatObb& box) {
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) axis[i][k][s] = box.axis[i][k];
    centre[i][s] = box.centre[i], extent[i][s] = box.extent[i];
  }
}

FloatObb placed(const FloatObb& box, const Relative& at) {
  FloatObb out;
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < 3; ++i)
      out.axis[i][k] =
          (at.r[k][0] * box.axis[i][0] + at.r[k][1] * box.axis[i][1]) + at.r[k][2] * box.axis[i][2];
    out.centre[k] =
        ((at.r[k][0] * box.centre[0] + at.r[k][1] * box.centre[1]) + at.r[k][2] * box.centre[2]) +
        at.t[k];
    out.extent[k] = box.extent[k];
  }
  return out;
}

TAUGUARD_CLONES unsigned overlap_mask(const ObbNode& node, const FloatObb& box, float pad,
                                      float* distance2) {
  const Float8* centre = reinterpret_cast<const Float8*>(node.centre);
  const Float8* e = reinterpret_cast<const Float8*>(node.extent);
  const Float8 d0 = box.centre[0] - centre[0], d1 = box.centre[1] - centre[1],
               d2 = box.centre[2] - centre[2];
  const Float8 square = d0 * d0 + d1 * d1 + d2 * d2;
  std::memcpy(distance2, &square, sizeof square);
  Float8 d[3], r[3][3], s[3][3];
  Mask8 hit = (Mask8){} - 1;
  for (int i = 0; i < 3; ++i) {
    const Float8* n = reinterpret_cast<const Float8*>(node.axis[i]);
    d[i] = (n[0] * d0 + n[1] * d1) + n[2] * d2;
    for (int j = 0; j < 3; ++j) {
      r[i][j] = (n[0] * box.axis[j][0] + n[1] * box.axis[j][1]) + n[2] * box.axis[j][2];
      s[i][j] = abs(r[i][j]);
    }
    const Float8 reach =
        (s[i][0] * box.extent[0] + s[i][1] * box.extent[1]) + (s[i][2] * box.extent[2] + pad);
    hit &= (Mask8)(abs(d[i]) <= e[i] + reach);
  }
  for (int j = 0; j < 3; ++j) {
    const Float8 along = (d[0] * r[0][j] + d[1] * r[1][j]) + d[2] * r[2][j];
    const Float8 reach = (e[0] * s[0][j] + e[1] * s[1][j]) + e[2] * s[2][j];
    hit &= (Mask8)(abs(along) <= reach + (box.extent[j] + pad));
  }
  if (bits8(hit) == 0) return 0;
  for (int i = 0; i < 3; ++i) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      const Float8 own = (s[i][j2] * box.extent[j1] + s[i][j1] * box.extent[j2]) + pad;
      const Float8 reach = (e[i1] * s[i2][j] + e[i2] * s[i1][j]) + own;
      hit &= (Mask8)(abs(d[i2] * r[i1][j] - d[i1] * r[i2][j]) <= reach);
    }
  }
  return bits8(hit);
}

}  // namespace tauguard::rigid
