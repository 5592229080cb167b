// The pose of a person's capsules: trunk and head, arms by inverse kinematics of two links, legs.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "anatomy.hpp"

namespace tauguard::envs {

class Posture {
 public:
  Posture() = default;
  explicit Posture(const Anatomy& anatomy) : body_(anatomy) {}

  std::array<Vec3, person_segments> centre;
  std::array<std::array<double, 4>, person_segments> quat_wxyz;

 protected:
  struct Axes {
    Vec3 forward, left, hip;  // hip: between the hip joints
  };

  Anatomy body_{};
  Axes axes_{};
  std::array<Vec3, 2> grip_;       // places of the palms
  double stride_ = 0, swing_ = 0;  // phase and amplitude of the gait [rad]
  double lean_ = 0;                // forward lean of the trunk [rad]

  void place(int segment, Vec3 a, Vec3 b) {
    centre[segment] = mix(a, b, 0.5);
    const Vec3 path = b - a;
    const Vec3 d = (1.0 / norm(path)) * path;
    // The rotation that takes -z to d, undefined for d = +z. No capsule points straight up.
    std::array<double, 4>& q = quat_wxyz[segment];
    q = {1.0 - d.z, d.y, -d.x, 0.0};
    const double size = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
    for (double& c : q) c /= size;
  }

  Vec3 trunk_axis() const {
    return std::sin(lean_) * axes_.forward + std::cos(lean_) * Vec3{0, 0, 1};
  }

  void trunk_and_head() {
    const Vec3 up = trunk_axis();
    const Vec3 ahead = std::cos(lean_) * axes_.forward - std::sin(lean_) * Vec3{0, 0, 1};
    const auto across = [&](int segment, double height) {
      const Vec3 middle = axes_.hip + height * body_.trunk * up;
      place(segment, middle - 0.1 * axes_.left, middle + 0.1 * axes_.left);
    };
    across(pelvis, 0.02);
    across(abdomen, 0.42);
    across(chest, 0.78);
    const Vec3 base = axes_.hip + body_.trunk * up, chin = base + body_.neck * up;
    place(neck, chin, base);
    const Vec3 shift = 0.02 * ahead;
    place(skull, chin + body_.head * up + shift, chin + shift);
  }

  // Inverse kinematics of two links: the palm goes to `goal`, the elbow down and outwards.
  void arm(int side, Vec3 shoulder, Vec3 goal, double sign) {
    const double first = body_.upper_arm, second = body_.lower_arm + body_.grip;
    const Vec3 path = goal - shoulder;
    const double size = norm(path);
    const Vec3 direction = size > 1e-6 ? (1.0 / size) * path : axes_.forward;
    const double least = std::fabs(first - second) + 0.1 * second;
    const double r = std::min(std::max(size, least), stretch * (first + second));
    const double c = (first * first + r * r - second * second) / (2.0 * first * r);
    const Vec3 pole = 0.6 * sign * axes_.left - 0.3 * axes_.forward - Vec3{0, 0, 1};
    Vec3 bend = pole - dot(pole, direction) * direction;
    bend = norm(bend) > 1e-6 ? (1.0 / norm(bend)) * bend : axes_.left;
    const Vec3 elbow = shoulder + first * c * direction + first * std::sqrt(1.0 - c * c) * bend;
    grip_[side] = shoulder + r * direction;
    const Vec3 along = (1.0 / second) * (grip_[side] - elbow);
    const Vec3 wrist = elbow + body_.lower_arm * along;
    const int at = limbs + side * per_side;
    place(at + upper_arm, shoulder, elbow);
    place(at + lower_arm, elbow, wrist);
    place(at + hand, wrist, wrist + body_.hand * along);
  }

  void leg(int side, double sign) {
    const Vec3 joint = axes_.hip + sign * body_.hip_half * axes_.left;
    const double phase = stride_ + (side == 0 ? 0.0 : M_PI);
    const double turn = body_.seated ? M_PI / 2 : swing_ * std::sin(phase);
    const double bend = body_.seated ? M_PI / 2 : 1.2 * swing_ * std::max(0.0, std::cos(phase));
    const auto along = [&](double angle) {
      return std::sin(angle) * axes_.forward - std::cos(angle) * Vec3{0, 0, 1};
    };
    const Vec3 knee = joint + body_.thigh * along(turn);
    const int at = limbs + side * per_side;
    place(at + thigh, joint, knee);
    place(at + lower_leg, knee, knee + body_.shank * along(turn - bend));
  }
};

}  // namespace tauguard::envs
