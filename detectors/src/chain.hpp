// Rigid-body terms of a momentum observer, by O(n) recursions over a tree of joints with one degree
// of freedom.
//
// Notation: link i moves with joint i. The frame of joint i is fixed to link i. All quantities of a
// link are in this frame, about its origin. w, v: angular and linear velocity; h, k: angular and
// linear momentum; V_i = (w, v). With S_i the joint's motion axis and H_i = (h, k) the momentum of
// the whole subtree of joint i,
//
//   p_i      = S_i . H_i + armature_i qd_i                    (generalised momentum M(q) qd)
//   dT/dq_i  = H_i . (V_i x S_i)                              (= (C(q, qd)^T qd)_i)
//   g_i      = dU/dq_i = -S_i . (first moment x gravity, mass gravity)  of the subtree
//
// Reason for the second line: if joint i turns by d, the velocity of its link and of the whole
// subtree changes by V_i x S_i d (x: motion cross product). The kinetic energy then changes by
// H_i . (V_i x S_i) d.
#pragma once

#include <cstddef>
#include <vector>

#include "tauguard/geometry/vec3.hpp"

namespace tauguard::detectors {

using geometry::Mat3;
using geometry::Vec3;

constexpr int inertial_numbers = 10;  // m, m c (3), Ixx Ixy Iyy Ixz Iyz Izz about the link's origin

struct Inertial {
  double mass = 0;
  Vec3 moment;  // mass times centre of mass
  double xx = 0, xy = 0, yy = 0, xz = 0, yz = 0, zz = 0;

  Vec3 angular_momentum(Vec3 w, Vec3 v) const {
    const Vec3 iw = {xx * w.x + xy * w.y + xz * w.z, xy * w.x + yy * w.y + yz * w.z,
                     xz * w.x + yz * w.y + zz * w.z};
    return iw + cross(moment, v);
  }
  Vec3 linear_momentum(Vec3 w, Vec3 v) const { return mass * v + cross(w, moment); }
};

struct Joint {
  int parent = -1;           // -1: the base
  bool prismatic = false;    // false: revolute
  Vec3 axis;                 // unit, in the link's frame
  Vec3 offset;               // origin of the joint in the parent's frame
  Vec3 slide;                // prismatic: the axis in the parent's frame
  Mat3 fixed, cosine, sine;  // rotation to the parent = fixed + cos(q) cosine + sin(q) sine
  Inertial inertial;
  double armature = 0;
};

// Scratch space of one evaluation; each thread has its own.
struct Workspace {
  struct Link {
    Mat3 rotation;  // link axes to parent axes
    Vec3 origin;    // of the link in the parent's frame
    Vec3 w, v, gravity;
    Vec3 aw, av;      // acceleration (spatial)
    Vec3 h, k;        // momentum or force of the subtree
    double mass = 0;  // of the subtree
    Vec3 moment;      // first mass moment of the subtree
  };
  std::vector<Link> links;
  explicit Workspace(std::size_t n = 0) : links(n) {}
};

class Chain {
 public:
  std::vector<Joint> joints;
  Vec3 gravity;

  bool operator==(const Chain& other) const;
  int size() const { return static_cast<int>(joints.size()); }

  // p = M(q) qd and beta = C(q, qd)^T qd - g(q), so that dp/dt = tau + beta + tau_ext; n doubles
  // each.
  void momentum(const double* q, const double* qd, double* p, double* beta, Workspace& work) const;

  // Derivatives of p and beta by every inertial parameter of every link: both are n x (10 n),
  // row-major.
  void regressor(const double* q, const double* qd, double* p, double* beta, Workspace& work) const;

  // Derivatives of p and beta by the first `count` inertial parameters of link `link`; both are
  // n x count.
  void link_regressor(int link, int count, const double* q, const double* qd, double* p,
                      double* beta, Workspace& work) const;
  // Derivatives of p and beta by the mass and first moment of link `link`; both are n x 4. `work`
  // has to contain the link velocities of a previous call.
  void load_columns(int link, double* p, double* beta, const Workspace& work) const;

  // Inverse dynamics: tau = M qdd + C qd + g.
  void rnea(const double* q, const double* qd, const double* qdd, double* tau,
            Workspace& work) const;

  // M(q), n x n, armature on its diagonal; column j is the momentum of a unit velocity of joint j.
  void mass_matrix(const double* q, double* m, Workspace& work) const;

 private:
  void place(int i, double q, Workspace& work) const;
  void velocities(const double* q, const double* qd, Workspace& work) const;
  void column(int link, int parameter, double* p, double* beta, std::size_t stride,
              Workspace& work) const;
};

}  // namespace tauguard::detectors
