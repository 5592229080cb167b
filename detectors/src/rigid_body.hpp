// Recursions over a tree of revolute and prismatic joints (Featherstone 2008), in the joints' frames.
//
// A motion vector is (w, v): angular velocity and velocity of the frame's origin; a force vector is (n, f):
// moment about the origin and force. Child i stands in its parent at (R, p):
//   motion down:  w' = R^T w,  v' = R^T (v + w x p)        force up:  f' = R f,  n' = R n + p x (R f)
#pragma once

#include <cmath>
#include <vector>

namespace tauguard::detectors {

struct Vec {
  double x = 0, y = 0, z = 0;
};

inline Vec operator+(const Vec& a, const Vec& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec operator-(const Vec& a, const Vec& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec operator*(double s, const Vec& a) { return {s * a.x, s * a.y, s * a.z}; }
inline double dot(const Vec& a, const Vec& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec cross(const Vec& a, const Vec& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

struct Mat {
  Vec r[3];  // rows
};

inline Vec operator*(const Mat& m, const Vec& a) { return {dot(m.r[0], a), dot(m.r[1], a), dot(m.r[2], a)}; }
// Transpose times vector.
inline Vec down(const Mat& m, const Vec& a) { return a.x * m.r[0] + (a.y * m.r[1] + a.z * m.r[2]); }
inline Mat operator*(const Mat& a, const Mat& b) {
  Mat c;
  for (int i = 0; i < 3; ++i) c.r[i] = a.r[i].x * b.r[0] + (a.r[i].y * b.r[1] + a.r[i].z * b.r[2]);
  return c;
}

struct Joint {
  int parent = -1;         // -1: the world
  bool prismatic = false;  // else revolute
  Mat rotation;            // of the joint's frame in its parent's, at position 0
  Vec position;
  Vec axis;     // unit, in the joint's frame
  double mass = 0, armature = 0;
  Vec com;      // in the joint's frame
  Mat inertia;  // about the centre of mass
};

struct Pair {  // a motion or a force vector
  Vec a, l;    // angular (moment), linear (force)
};

// Everything that a recursion needs, allocated once.
struct Workspace {
  explicit Workspace(std::size_t n) : turn(n), shift(n), v(n), h(n), acc(n), pull(n), f(n) {}
  std::vector<Mat> turn;   // rotation to the parent at q
  std::vector<Vec> shift;  // position in the parent at q
  std::vector<Pair> v, h, acc;
  std::vector<Vec> pull;   // gravity in the joint's frame
  std::vector<Pair> f;
};

struct Robot {
  std::vector<Joint> joints;
  Vec gravity;

  std::size_t size() const { return joints.size(); }

  // Generalised momentum p = M qd and beta = dT/dq - g(q), so that dp/dt = tau + tau_ext + beta.
  // dT/dq_i is H_i . (v_i x S_i) with H_i the momentum of the subtree: only the transform of the
  // velocity of what lies before joint i depends on q_i.
  void momentum(const double* q, const double* qd, double* p, double* beta, Workspace& w) const {
    pose(q, w);
    const std::size_t n = size();
    for (std::size_t i = 0; i < n; ++i) {
      const Joint& j = joints[i];
      const bool rooted = j.parent < 0;
      w.v[i] = velocity(i, qd[i], w);
      w.pull[i] = down(w.turn[i], rooted ? gravity : w.pull[j.parent]);
      w.h[i] = momentum_of(j, w.v[i]);
      const Vec weight = -j.mass * w.pull[i];
      w.f[i] = {cross(j.com, weight), weight};
    }
    for (std::size_t i = n; i-- > 0;) {
      const Joint& j = joints[i];
      const Pair& h = w.h[i];
      const Vec& s = j.axis;
      double kinetic, weight;
      if (j.prismatic) {
        p[i] = dot(s, h.l) + j.armature * qd[i];
        kinetic = dot(h.l, cross(w.v[i].a, s));
        weight = dot(s, w.f[i].l);
      } else {
        p[i] = dot(s, h.a) + j.armature * qd[i];
        kinetic = dot(h.a, cross(w.v[i].a, s)) + dot(h.l, cross(w.v[i].l, s));
        weight = dot(s, w.f[i].a);
      }
      beta[i] = kinetic - weight;
      if (j.parent >= 0) {
        raise(i, w.h[i], w.h[j.parent], w);
        raise(i, w.f[i], w.f[j.parent], w);
      }
    }
  }

  // Inverse dynamics by the recursive Newton-Euler algorithm, armature included.
  void inverse(const double* q, const double* qd, const double* qdd, double* tau, Workspace& w) const {
    pose(q, w);
    const std::size_t n = size();
    for (std::size_t i = 0; i < n; ++i) {
      const Joint& j = joints[i];
      const Pair before = j.parent < 0 ? Pair{{}, -1.0 * gravity} : w.acc[j.parent];
      w.v[i] = velocity(i, qd[i], w);
      Pair a = lower(i, before, w);
      if (j.prismatic) {
        a.l = a.l + qdd[i] * j.axis + qd[i] * cross(w.v[i].a, j.axis);
      } else {
        a.a = a.a + qdd[i] * j.axis + qd[i] * cross(w.v[i].a, j.axis);
        a.l = a.l + qd[i] * cross(w.v[i].l, j.axis);
      }
      w.acc[i] = a;
      const Pair h = momentum_of(j, w.v[i]);
      const Pair rate = momentum_of(j, a);
      w.f[i] = {rate.a + cross(w.v[i].a, h.a) + cross(w.v[i].l, h.l), rate.l + cross(w.v[i].a, h.l)};
    }
    for (std::size_t i = n; i-- > 0;) {
      const Joint& j = joints[i];
      tau[i] = (j.prismatic ? dot(j.axis, w.f[i].l) : dot(j.axis, w.f[i].a)) + j.armature * qdd[i];
      if (j.parent >= 0) raise(i, w.f[i], w.f[j.parent], w);
    }
  }

 private:
  void pose(const double* q, Workspace& w) const {
    for (std::size_t i = 0; i < size(); ++i) {
      const Joint& j = joints[i];
      if (j.prismatic) {
        w.turn[i] = j.rotation;
        w.shift[i] = j.position + q[i] * (j.rotation * j.axis);
        continue;
      }
      const double s = std::sin(q[i]), c = std::cos(q[i]), k = 1 - c;
      const Vec& a = j.axis;
      const Mat spin{{{c + k * a.x * a.x, k * a.x * a.y - s * a.z, k * a.x * a.z + s * a.y},
                      {k * a.y * a.x + s * a.z, c + k * a.y * a.y, k * a.y * a.z - s * a.x},
                      {k * a.z * a.x - s * a.y, k * a.z * a.y + s * a.x, c + k * a.z * a.z}}};
      w.turn[i] = j.rotation * spin;
      w.shift[i] = j.position;
    }
  }

  Pair lower(std::size_t i, const Pair& m, const Workspace& w) const {
    return {down(w.turn[i], m.a), down(w.turn[i], m.l + cross(m.a, w.shift[i]))};
  }

  void raise(std::size_t i, const Pair& from, Pair& to, const Workspace& w) const {
    const Vec force = w.turn[i] * from.l;
    to.l = to.l + force;
    to.a = to.a + w.turn[i] * from.a + cross(w.shift[i], force);
  }

  Pair velocity(std::size_t i, double qd, const Workspace& w) const {
    const Joint& j = joints[i];
    Pair v = j.parent < 0 ? Pair{} : lower(i, w.v[j.parent], w);
    (j.prismatic ? v.l : v.a) = (j.prismatic ? v.l : v.a) + qd * j.axis;
    return v;
  }

  static Pair momentum_of(const Joint& j, const Pair& v) {
    const Vec l = j.mass * (v.l + cross(v.a, j.com));
    return {j.inertia * v.a + cross(j.com, l), l};
  }
};

}  // namespace tauguard::detectors
