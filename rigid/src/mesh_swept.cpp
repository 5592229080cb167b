#include "mesh_swept.hpp"

#include "tauguard/geometry/lanes.hpp"

namespace tauguard::rigid {

using namespace geometry;  // lanes.hpp

Place place_at(const RigidMotion& m, double t) {
  const double c = std::cos(m.speed * t), s = std::sin(m.speed * t);
  Vec3 column[3];
  for (int k = 0; k < 3; ++k)
    column[k] = Swing(m, Vec3{m.r0[0][k], m.r0[1][k], m.r0[2][k]}).at(c, s);
  Place out;
  for (int i = 0; i < 3; ++i) out.r[i] = {column[0][i], column[1][i], column[2][i]};
  out.t = m.x0 + t * m.linear;
  return out;
}

// The box with the rotation at the middle of the piece. The pad covers rotations by at most
// `chord.turn` in either direction, and the sagitta.
MovingObb moving(const FloatObb& box, const Chord& chord) {
  MovingObb out;
  const Vec3 c = {box.centre[0], box.centre[1], box.centre[2]};
  const Vec3 from = chord.start(c), to = chord.end(c);
  double square = 0;
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < 3; ++i) {
      const Vec3 axis = {box.axis[i][0], box.axis[i][1], box.axis[i][2]};
      out.box.axis[i][k] = static_cast<float>(dot(chord.middle.r[k], axis));
    }
    out.box.centre[k] = static_cast<float>(from[k]);
    out.move[k] = static_cast<float>(to[k] - from[k]);
    out.box.extent[k] = box.extent[k];
    square += double(box.extent[k]) * box.extent[k];
  }
  out.pad = static_cast<float>((std::sqrt(square) * chord.turn + chord.sagitta) * (1 + 0x1p-20)) +
            chord.float_rounding;
  out.pad = std::max(out.pad, 0x1p-120f);  // the reciprocal of a smaller one would be infinite
  return out;
}

// The test of overlap_mask (mesh_obb.cpp), with the fractions of the chord at which each axis stops
// and starts separating. If the motion along an axis is smaller than the pad, the pad is the
// divisor, so that the fractions stay bounded. A second pad covers this change.
TAUGUARD_CLONES unsigned swept_mask(const ObbNode& node, const MovingObb& m, float leave,
                                    float* enter) {
  const FloatObb& box = m.box;
  const Float8* centre = reinterpret_cast<const Float8*>(node.centre);
  const Float8* e = reinterpret_cast<const Float8*>(node.extent);
  const Float8 d0 = box.centre[0] - centre[0], d1 = box.centre[1] - centre[1],
               d2 = box.centre[2] - centre[2];
  const Float8 pad = (Float8){} + m.pad;
  Float8 d[3], v[3], r[3][3], s[3][3], first = (Float8){}, last = (Float8){} + leave;
  const auto axis = [&](const Float8& at, const Float8& speed,
                        const Float8& reach) __attribute__((always_inline)) {
    const Float8 size = abs(speed), inverse = 1.0f / (size < pad ? pad : size);
    const Float8 toward = speed < 0.0f ? -at : at, bound = reach + 2.0f * pad;
    const Float8 in = (-bound - toward) * inverse, out = (bound - toward) * inverse;
    first = in > first ? in : first;
    last = out < last ? out : last;
  };
  for (int i = 0; i < 3; ++i) {
    const Float8* n = reinterpret_cast<const Float8*>(node.axis[i]);
    d[i] = (n[0] * d0 + n[1] * d1) + n[2] * d2;
    v[i] = (n[0] * m.move[0] + n[1] * m.move[1]) + n[2] * m.move[2];
    for (int j = 0; j < 3; ++j) {
      r[i][j] = (n[0] * box.axis[j][0] + n[1] * box.axis[j][1]) + n[2] * box.axis[j][2];
      s[i][j] = abs(r[i][j]);
    }
    axis(d[i], v[i],
         e[i] + ((s[i][0] * box.extent[0] + s[i][1] * box.extent[1]) + s[i][2] * box.extent[2]));
  }
  for (int j = 0; j < 3; ++j)
    axis((d[0] * r[0][j] + d[1] * r[1][j]) + d[2] * r[2][j],
         (v[0] * r[0][j] + v[1] * r[1][j]) + v[2] * r[2][j],
         ((e[0] * s[0][j] + e[1] * s[1][j]) + e[2] * s[2][j]) + box.extent[j]);
  if (bits8((Mask8)(first <= last)) == 0) return 0;
  for (int i = 0; i < 3; ++i) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      axis(d[i2] * r[i1][j] - d[i1] * r[i2][j], v[i2] * r[i1][j] - v[i1] * r[i2][j],
           (e[i1] * s[i2][j] + e[i2] * s[i1][j]) +
               (s[i][j2] * box.extent[j1] + s[i][j1] * box.extent[j2]));
    }
  }
  const unsigned lanes = bits8((Mask8)(first <= last));
  std::memcpy(enter, &first, sizeof first);
  return lanes;
}

namespace {

// The fraction of the chord up to which the axis n separates the corners of b from those of a. The
// projection of every corner is linear in the fraction, so the first contact is one of three roots.
double separated_until(const Vec3& n, const Vec3* a, const Vec3* b0, const Vec3* b1, double pad) {
  const double slack = pad * norm(n) * (1 + 0x1p-40);
  double lo = INFINITY, hi = -INFINITY, p[3], q[3], p_lo = INFINITY, p_hi = -INFINITY;
  for (int i = 0; i < 3; ++i) {
    const double x = dot(n, a[i]);
    lo = std::min(lo, x), hi = std::max(hi, x);
    p[i] = dot(n, b0[i]), q[i] = dot(n, b1[i]) - p[i];
    p_lo = std::min(p_lo, p[i]), p_hi = std::max(p_hi, p[i]);
  }
  lo -= slack, hi += slack;
  const bool above = p_lo > hi;
  if (!above && !(p_hi < lo)) return 0;
  double until = INFINITY;
  for (int i = 0; i < 3; ++i) {
    const double gap = above ? p[i] - hi : lo - p[i], closing = above ? -q[i] : q[i];
    if (closing >= gap) until = std::min(until, gap / closing);
  }
  return until * (1 - 0x1p-40);
}

}  // namespace

double certainly_apart(const Vec3* a, const Vec3* b0, const Vec3* b1, double pad) {
  Vec3 ea[3], eb[3];
  for (int i = 0; i < 3; ++i) ea[i] = a[(i + 1) % 3] - a[i], eb[i] = b0[(i + 1) % 3] - b0[i];
  double until = std::max(separated_until(cross(ea[0], ea[1]), a, b0, b1, pad),
                          separated_until(cross(eb[0], eb[1]), a, b0, b1, pad));
  for (int i = 0; i < 3 && until < INFINITY; ++i)
    for (int j = 0; j < 3 && until < INFINITY; ++j)
      until = std::max(until, separated_until(cross(ea[i], eb[j]), a, b0, b1, pad));
  return until;
}

const ObbNode& oriented(const Mesh& mesh, std::int32_t node, ObbNode& scratch) {
  if (mesh.kind == VolumeKind::obb) return mesh.obbs.nodes[node];
  const Node& n = mesh.tree.nodes[node];
  std::memcpy(scratch.centre, n.centre, sizeof n.centre);
  std::memcpy(scratch.extent, n.extent, sizeof n.extent);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) std::fill_n(scratch.axis[i][k], width, i == k ? 1.0f : 0.0f);
  return scratch;
}

FloatObb oriented_box(const Mesh& mesh, const Slot& slot) {
  if (mesh.kind == VolumeKind::obb) return mesh.obbs.box(slot);
  const Box b = slot.box(mesh.tree);
  FloatObb out = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {}, {}};
  for (int k = 0; k < 3; ++k) out.centre[k] = b.centre[k], out.extent[k] = b.extent[k];
  return out;
}

}  // namespace tauguard::rigid
