#include "chain.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace tauguard::detectors {

using Link = Workspace::Link;

bool Chain::operator==(const Chain& other) const {
  static_assert(sizeof(Joint) == offsetof(Joint, axis) + 47 * sizeof(double), "numbers only");
  const auto same = [](const Joint& a, const Joint& b) {
    return a.parent == b.parent && a.prismatic == b.prismatic &&
           std::memcmp(&a.axis, &b.axis, sizeof a - offsetof(Joint, axis)) == 0;
  };
  return gravity == other.gravity &&
         std::equal(joints.begin(), joints.end(), other.joints.begin(), other.joints.end(), same);
}

// Computes the frame of link i in the parent's frame.
void Chain::place(int i, double q, Workspace& work) const {
  const Joint& joint = joints[i];
  Link& link = work.links[i];
  if (joint.prismatic) {
    link.rotation = joint.fixed;
    link.origin = joint.offset + q * joint.slide;
    return;
  }
  const double c = std::cos(q), s = std::sin(q);
  for (int e = 0; e < 9; ++e)
    link.rotation.m[e] = joint.fixed.m[e] + (c * joint.cosine.m[e] + s * joint.sine.m[e]);
  link.origin = joint.offset;
}

// Frames, velocities and gravity of every link, outwards.
void Chain::velocities(const double* q, const double* qd, Workspace& work) const {
  for (int i = 0; i < size(); ++i) {
    place(i, q[i], work);
    const Joint& joint = joints[i];
    Link& link = work.links[i];
    Vec3 w, v, g = gravity;
    if (joint.parent >= 0) {
      const Link& parent = work.links[joint.parent];
      w = parent.w;
      v = parent.v + cross(parent.w, link.origin);
      g = parent.gravity;
    }
    link.w = transposed(link.rotation, w);
    link.v = transposed(link.rotation, v);
    link.gravity = transposed(link.rotation, g);
    (joint.prismatic ? link.v : link.w) += qd[i] * joint.axis;
  }
}

namespace {

// Adds the sums over a link's subtree to the sums of the parent.
void hand_over(const Link& link, Link& parent) {
  const Vec3 k = link.rotation * link.k;
  parent.h += link.rotation * link.h + cross(link.origin, k);
  parent.k += k;
}

void hand_over_mass(const Link& link, Link& parent) {
  parent.mass += link.mass;
  parent.moment += link.rotation * link.moment + link.mass * link.origin;
}

// (S . H, H . (V x S) + S . gravity wrench) of joint i, from the sums over its subtree.
struct Projection {
  double p, beta;
};

Projection project(const Joint& joint, const Link& link) {
  const Vec3 a = joint.axis;
  if (joint.prismatic) {
    return {dot(a, link.k), dot(link.k, cross(link.w, a)) + link.mass * dot(a, link.gravity)};
  }
  return {dot(a, link.h), dot(link.h, cross(link.w, a)) + dot(link.k, cross(link.v, a)) +
                              dot(a, cross(link.moment, link.gravity))};
}

Mat3 identity() { return {{1, 0, 0, 0, 1, 0, 0, 0, 1}}; }

Mat3 operator*(const Mat3& a, const Mat3& b) {
  Mat3 c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      c.m[3 * i + j] =
          a.m[3 * i] * b.m[j] + a.m[3 * i + 1] * b.m[3 + j] + a.m[3 * i + 2] * b.m[6 + j];
  return c;
}

Inertial unit(int parameter) {
  Inertial one;
  double* slots[inertial_numbers] = {&one.mass, &one.moment.x, &one.moment.y, &one.moment.z,
                                     &one.xx,   &one.xy,       &one.yy,       &one.xz,
                                     &one.yz,   &one.zz};
  *slots[parameter] = 1.0;
  return one;
}

}  // namespace

void Chain::momentum(const double* q, const double* qd, double* p, double* beta,
                     Workspace& work) const {
  velocities(q, qd, work);
  for (int i = 0; i < size(); ++i) {
    const Inertial& body = joints[i].inertial;
    Link& link = work.links[i];
    link.h = body.angular_momentum(link.w, link.v);
    link.k = body.linear_momentum(link.w, link.v);
    link.mass = body.mass;
    link.moment = body.moment;
  }
  for (int i = size() - 1; i >= 0; --i) {
    const Joint& joint = joints[i];
    const Link& link = work.links[i];
    const Projection onto = project(joint, link);
    p[i] = onto.p + joint.armature * qd[i];
    beta[i] = onto.beta;
    if (joint.parent >= 0) {
      hand_over(link, work.links[joint.parent]);
      hand_over_mass(link, work.links[joint.parent]);
    }
  }
}

// One column of the regressor: effect of a unit of one parameter of `body` on the joints before it.
void Chain::column(int body, int parameter, double* p, double* beta, std::size_t stride,
                   Workspace& work) const {
  for (int i = 0; i < size(); ++i) p[i * stride] = beta[i * stride] = 0.0;
  const Inertial one = unit(parameter);
  Link carried = work.links[body];
  carried.h = one.angular_momentum(carried.w, carried.v);
  carried.k = one.linear_momentum(carried.w, carried.v);
  carried.mass = one.mass;
  carried.moment = one.moment;
  for (int i = body; i >= 0; i = joints[i].parent) {
    const Projection onto = project(joints[i], carried);
    p[i * stride] = onto.p;
    beta[i * stride] = onto.beta;
    if (joints[i].parent < 0) break;
    Link next = work.links[joints[i].parent];
    next.h = next.k = next.moment = Vec3{};
    next.mass = 0;
    hand_over(carried, next);
    hand_over_mass(carried, next);
    carried = next;
  }
}

void Chain::link_regressor(int body, int count, const double* q, const double* qd, double* p,
                           double* beta, Workspace& work) const {
  velocities(q, qd, work);
  for (int c = 0; c < count; ++c) column(body, c, p + c, beta + c, count, work);
}

void Chain::load_columns(int body, double* p, double* beta, const Workspace& work) const {
  for (int i = 0; i < 4 * size(); ++i) p[i] = beta[i] = 0.0;
  const Link& last = work.links[body];
  Mat3 turn = identity();  // the link's axes in those of link i
  Vec3 away;               // the link's origin in the frame of link i
  for (int i = body; i >= 0; i = joints[i].parent) {
    const Joint& joint = joints[i];
    const Link& link = work.links[i];
    const Vec3 a = joint.axis;
    Vec3 aw, av = a, bw, bv = cross(link.w, a);
    if (!joint.prismatic) {
      aw = transposed(turn, a);
      av = cross(a, away);
      bw = bv;
      bv = cross(link.v, a) + cross(bw, away);
      bw = transposed(turn, bw);
    }
    av = transposed(turn, av);
    bv = transposed(turn, bv);
    const Vec3 moment = cross(last.v, aw) + cross(av, last.w);
    const Vec3 change = cross(last.v, bw) + cross(bv, last.w) + cross(last.gravity, aw);
    const double own[] = {dot(av, last.v), moment.x, moment.y, moment.z};
    const double rate[] = {dot(bv, last.v) + dot(av, last.gravity), change.x, change.y, change.z};
    std::copy(own, own + 4, p + 4 * i);
    std::copy(rate, rate + 4, beta + 4 * i);
    if (joint.parent < 0) break;
    away = link.origin + link.rotation * away;
    turn = link.rotation * turn;
  }
}

void Chain::regressor(const double* q, const double* qd, double* p, double* beta,
                      Workspace& work) const {
  velocities(q, qd, work);
  const std::size_t stride = static_cast<std::size_t>(inertial_numbers) * joints.size();
  for (int body = 0; body < size(); ++body)
    for (int c = 0; c < inertial_numbers; ++c)
      column(body, c, p + inertial_numbers * body + c, beta + inertial_numbers * body + c, stride,
             work);
}

void Chain::rnea(const double* q, const double* qd, const double* qdd, double* tau,
                 Workspace& work) const {
  velocities(q, qd, work);
  for (int i = 0; i < size(); ++i) {
    const Joint& joint = joints[i];
    Link& link = work.links[i];
    Vec3 aw, av = -1.0 * gravity;  // an upward acceleration of the base represents gravity
    if (joint.parent >= 0) {
      const Link& parent = work.links[joint.parent];
      aw = parent.aw;
      av = parent.av + cross(parent.aw, link.origin);
    }
    link.aw = transposed(link.rotation, aw);
    link.av = transposed(link.rotation, av);
    if (joint.prismatic) {
      link.av += qdd[i] * joint.axis + qd[i] * cross(link.w, joint.axis);
    } else {
      link.aw += qdd[i] * joint.axis + qd[i] * cross(link.w, joint.axis);
      link.av += qd[i] * cross(link.v, joint.axis);
    }
    const Inertial& body = joint.inertial;
    const Vec3 h = body.angular_momentum(link.w, link.v), k = body.linear_momentum(link.w, link.v);
    link.h = body.angular_momentum(link.aw, link.av) + cross(link.w, h) + cross(link.v, k);
    link.k = body.linear_momentum(link.aw, link.av) + cross(link.w, k);
  }
  for (int i = size() - 1; i >= 0; --i) {
    const Joint& joint = joints[i];
    const Link& link = work.links[i];
    tau[i] = dot(joint.axis, joint.prismatic ? link.k : link.h) + joint.armature * qdd[i];
    if (joint.parent >= 0) hand_over(link, work.links[joint.parent]);
  }
}

void Chain::mass_matrix(const double* q, double* m, Workspace& work) const {
  const int n = size();
  for (int i = 0; i < n; ++i) place(i, q[i], work);
  for (int j = 0; j < n; ++j) {
    for (int i = j; i < n; ++i) {  // links before j are at rest
      const Joint& joint = joints[i];
      Link& link = work.links[i];
      const bool carried = i > j && joint.parent >= j;
      const Vec3 w = carried ? work.links[joint.parent].w : Vec3{};
      const Vec3 v = carried ? work.links[joint.parent].v + cross(w, link.origin) : Vec3{};
      link.w = transposed(link.rotation, w);
      link.v = transposed(link.rotation, v);
      if (i == j) (joint.prismatic ? link.v : link.w) += joint.axis;
      link.h = joint.inertial.angular_momentum(link.w, link.v);
      link.k = joint.inertial.linear_momentum(link.w, link.v);
    }
    for (int i = 0; i < j; ++i) work.links[i].h = work.links[i].k = Vec3{};
    for (int i = n - 1; i >= 0; --i) {
      const Joint& joint = joints[i];
      const Link& link = work.links[i];
      m[i * n + j] = dot(joint.axis, joint.prismatic ? link.k : link.h) +
                     joint.armature * static_cast<double>(i == j);
      if (joint.parent >= 0) hand_over(link, work.links[joint.parent]);
    }
  }
}

}  // namespace tauguard::detectors
