#include "mocap.hpp"

#include <algorithm>
#include <cmath>

namespace tauguard::contacts {
namespace {

void multiply(const double* a, const double* b, double* out) {
  out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
  out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
  out[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
  out[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
}

// Scales to unit length. As in MuJoCo, a quaternion of length zero means no rotation.
void normalize(const double* quat, double* out) {
  double sum = 0;
  for (int k = 0; k < 4; ++k) sum += quat[k] * quat[k];
  const double length = std::sqrt(sum);
  for (int k = 0; k < 4; ++k) out[k] = length < 1e-15 ? (k == 0) : quat[k] / length;
}

// The shortest rotation vector from one orientation to the other [rad].
Vec3 turn_between(const double* from, const double* to) {
  double a[4], b[4], d[4];
  normalize(from, a), normalize(to, b);
  const double back[4] = {a[0], -a[1], -a[2], -a[3]};
  multiply(b, back, d);
  const double sign = d[0] < 0 ? -1 : 1;
  const Vec3 axis = {sign * d[1], sign * d[2], sign * d[3]};
  const double sine = norm(axis);
  return sine > 0 ? (2 * std::atan2(sine, sign * d[0]) / sine) * axis : Vec3{};
}

void turn_by(const Vec3& turn, const double* quat, double* out) {
  const double angle = norm(turn), half = angle > 0 ? std::sin(angle / 2) / angle : 0.5;
  const double d[4] = {std::cos(angle / 2), half * turn[0], half * turn[1], half * turn[2]};
  double unit[4];
  normalize(quat, unit);
  multiply(d, unit, out);
}

// A vector turned by a rotation vector (Rodrigues).
Vec3 turned(const Vec3& turn, const Vec3& v) {
  const double angle = norm(turn);
  if (angle == 0) return v;
  const Vec3 axis = (1 / angle) * turn;
  return std::cos(angle) * v + std::sin(angle) * cross(axis, v) +
         ((1 - std::cos(angle)) * dot(axis, v)) * axis;
}

}  // namespace

Mocap::Mocap(const Engine& engine, std::vector<char> pulled)
    : e_(engine), pulled_(std::move(pulled)), start_(engine.nmocap), commanded_(engine.nmocap) {
  remember();
}

void Mocap::read(Poses* poses) const {
  for (int m = 0; m < e_.nmocap; ++m) {
    std::copy_n(e_.mocap_pos + 3 * m, 3, (*poses)[m].pos);
    std::copy_n(e_.mocap_quat + 4 * m, 4, (*poses)[m].quat);
  }
}

void Mocap::write(const Poses& poses) {
  for (std::size_t m = 0; moves_ && m < poses.size(); ++m) {
    std::copy_n(poses[m].pos, 3, e_.mocap_pos + 3 * m);
    std::copy_n(poses[m].quat, 4, e_.mocap_quat + 4 * m);
  }
}

// Computes the kinematics of `other` for its joint positions and the given mocap poses.
void Mocap::place_other(const Poses& poses) {
  for (std::size_t m = 0; m < poses.size(); ++m) {
    std::copy_n(poses[m].pos, 3, e_.other_mocap_pos + 3 * m);
    std::copy_n(poses[m].quat, 4, e_.other_mocap_quat + 4 * m);
  }
  e_.kinematics(e_.model, e_.other), e_.com_pos(e_.model, e_.other);
  if (e_.nflex) e_.flex(e_.model, e_.other);
}

bool Mocap::finite() const {
  double sum = 0;
  for (int i = 0; i < 3 * e_.nmocap; ++i) sum += e_.mocap_pos[i] - e_.mocap_pos[i];
  for (int i = 0; i < 4 * e_.nmocap; ++i) sum += e_.mocap_quat[i] - e_.mocap_quat[i];
  return sum == 0;
}

void Mocap::remember() {
  read(&start_);
  time_ = *e_.time;
}

bool Mocap::begin() {
  const bool continued = *e_.time == time_;
  if (!continued) read(&start_);
  moves_ = false;
  for (int m = 0; m < e_.nmocap; ++m)
    moves_ = moves_ || !std::equal(start_[m].pos, start_[m].pos + 3, e_.mocap_pos + 3 * m) ||
             !std::equal(start_[m].quat, start_[m].quat + 4, e_.mocap_quat + 4 * m);
  jumps_ = true;
  if (!moves_) return continued;
  read(&commanded_);
  from_ = start_, to_ = commanded_;
  e_.copy_state(e_.model, e_.data, e_.other, e_.signature.pose);
  place_other(start_);
  return continued;
}

void Mocap::sub_step(double from, double to) {
  if (!moves_) return;
  jumps_ = false;
  const auto at = [&](double share, std::size_t m) {
    if (share >= 1) return commanded_[m];
    Pose out = start_[m];
    for (int k = 0; k < 3; ++k) out.pos[k] += share * (commanded_[m].pos[k] - start_[m].pos[k]);
    turn_by(share * turn_between(start_[m].quat, commanded_[m].quat), start_[m].quat, out.quat);
    return out;
  };
  for (std::size_t m = 0; m < commanded_.size(); ++m) from_[m] = at(from, m), to_[m] = at(to, m);
}

void Mocap::add_turns(double* turn) const {
  if (!moves_) return;
  for (int b = 1; b < e_.nbody; ++b) {
    const Vec3 own = this->turn(b);
    for (int k = 0; k < 3; ++k) turn[3 * b + k] += own[k];
  }
}

bool Mocap::shifted() {
  if (!moves_ || jumps_) return false;
  place_other(to_);
  if (e_.ntendon) e_.tendon(e_.model, e_.other);
  e_.energy_pos(e_.model, e_.other);
  return true;
}

Vec3 Mocap::displacement(int body, const double* point) const {
  const int m = e_.body_mocapid[e_.body_rootid[body]];
  if (m < 0 || !moves_) return {};
  const Pose &from = from_[m], &to = to_[m], &at = jumps_ ? to : from;
  Vec3 arm, shift;
  for (int k = 0; k < 3; ++k) arm[k] = point[k] - at.pos[k], shift[k] = to.pos[k] - from.pos[k];
  const Vec3 own = turn(body);
  return jumps_ ? shift + arm - turned(-1.0 * own, arm) : shift + turned(own, arm) - arm;
}

Vec3 Mocap::turn(int body) const {
  const int m = e_.body_mocapid[e_.body_rootid[body]];
  return m < 0 || !moves_ ? Vec3{} : turn_between(from_[m].quat, to_[m].quat);
}

bool Mocap::carries(const Partners& pair) const {
  const auto hangs = [&](const Place& p) {
    return p.kind == Place::geom && e_.body_mocapid[e_.body_rootid[e_.geom_bodyid[p.number]]] >= 0;
  };
  return moves_ && (hangs(pair.first) || hangs(pair.second));
}

double Mocap::separation(const Contact& contact) const {
  if (!moves_) return 0;
  double sum = 0;
  for (int i = 0; i < 2; ++i) {
    if (contact.geom[i] < 0) continue;
    const Vec3 w = displacement(e_.geom_bodyid[contact.geom[i]], contact.at);
    for (int k = 0; k < 3; ++k) sum += (i ? 1 : -1) * contact.normal[k] * w[k];
  }
  return sum;
}

double Mocap::work(const double* velocity, double length) {
  if (!e_.nmocap || !*e_.nefc) return 0;
  double sum = 0;
  for (int k = 0; moves_ && k < *e_.ncon; ++k) {
    const Contact contact = e_.contact_at(k);
    if (contact.row < 0) continue;
    double force = 0;
    for (int row = contact.row; row < contact.row + e_.normal_rows(contact); ++row)
      force += (*e_.efc_force)[row];
    sum -= force * separation(contact);
  }
  if (std::none_of(pulled_.begin(), pulled_.end(), [](char p) { return p; })) return sum;
  speed_.resize(*e_.nefc);
  e_.mul_jac(e_.model, e_.data, speed_.data(), velocity);
  for (int row = 0; row < *e_.nefc; ++row)
    if ((*e_.efc_type)[row] == e_.equality && pulled_[(*e_.efc_id)[row]])
      sum += length * (*e_.efc_force)[row] * speed_[row];
  return sum;
}

}  // namespace tauguard::contacts
