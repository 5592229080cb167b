// The command of every drive. It comes from an action in [-1, 1] for one control period, or from a
// row of a table of references for one physics step.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <type_traits>
#include <vector>

#include "drive.hpp"
#include "kinematics.hpp"

namespace tauguard::envs {

enum class Mode { current = 0, torque = 1, velocity = 2, position = 3, cartesian = 4, table = 5 };
// Reactions that replace the action: follow velocities, no power, no power with brakes on.
enum class Override { none = 0, velocity = 1, limp = 2, brake = 3 };

// A brake is a spring and a damper, and slips at the torque limit.
constexpr double brake_stiffness = 10.0;  // as a multiple of the servo's kp
constexpr double brake_damping = 3.0;     // as a multiple of the servo's kd
// Damping of the Cartesian mode's least squares; it bounds the joint step near a singular pose.
constexpr double cartesian_damping = 0.02;

// References of a run, row-major (rows x joints): position [rad], velocity [rad/s], torque [N m].
struct Table {
  const double *q = nullptr, *qd = nullptr, *feed = nullptr;
  std::size_t width = 0;  // joints
};

constexpr double end_margin = 0.01;  // distance of references from the ends of joint ranges [rad]
constexpr double end_rate = 6.0;     // largest speed towards that limit per distance from it [1/s]

struct Command {
  std::vector<double> origin, speed, feed;  // reference [rad], its velocity [rad/s], torque [N m]
  bool servo = false, powered = true, brake = false;
};

struct Controls {
  Mode mode = Mode::table;
  double period = 0.01;              // control period [s]
  std::vector<double> scale;         // scale of each entry of the action
  std::vector<double> centre;        // centre of the position mode [rad]
  std::vector<double> max_speed;     // [rad/s]
  std::vector<double> torque_limit;  // [N m]
  std::vector<double> low, high;     // ends of the joints' ranges [rad]
  // The largest possible contact force F [N] satisfies F^2 = moving s^2 + driven, where s is the
  // largest ratio of a joint's speed to its max_speed.
  double moving = INFINITY, driven = 0;
  Override override = Override::none;
  std::vector<double> override_speed;  // [rad/s]
  Command command;
  Table table;
  TAUGUARD_FIELDS(mode, period, scale, centre, max_speed, torque_limit, low, high, moving, driven)

  // Removes an override; the joint positions q become the reference.
  void reset(const std::vector<double>& q) {
    override = Override::none;
    command.origin = q;
    command.speed.assign(q.size(), 0.0);
    command.feed.assign(q.size(), 0.0);
  }

  // Maps the action at the state (q, the arms' kinematics) to the command.
  void take(const Kinematics& arms, const std::vector<Joint>& joints,
            const std::vector<Tool>& tools, const double* q, const double* action) {
    const std::size_t n = arms.size();
    std::vector<double>& v = command.speed;
    std::fill(v.begin(), v.end(), 0.0);
    command.servo = true;
    command.powered = true;
    command.brake = false;
    if (override == Override::none && mode == Mode::current) {
      command.servo = false;
      for (std::size_t i = 0; i < n; ++i)
        command.feed[i] = bounded(action[i]) * scale[i] * joints[i].nominal_gain;
      follow(joints, q);
      return;
    }
    arms.hold(command.feed.data());
    if (override != Override::none) {
      command.powered = override == Override::velocity;
      command.servo = command.powered;
      command.brake = override == Override::brake;
      if (command.powered) v = override_speed;
    } else if (mode == Mode::torque) {
      command.servo = false;
      for (std::size_t i = 0; i < n; ++i) command.feed[i] += bounded(action[i]) * scale[i];
    } else if (mode == Mode::velocity) {
      for (std::size_t i = 0; i < n; ++i) v[i] = bounded(action[i]) * scale[i];
    } else if (mode == Mode::position) {
      for (std::size_t i = 0; i < n; ++i)
        v[i] = (centre[i] + bounded(action[i]) * scale[i] - command.origin[i]) / period;
    } else {
      cartesian(arms, tools, action);
    }
    for (std::size_t i = 0; i < n; ++i) {
      v[i] = std::min(std::max(v[i], -max_speed[i]), max_speed[i]);
      if (command.servo) v[i] = clear_of_ends(i, v[i]);
    }
    follow(joints, q);
  }

  // The wanted motor torque [N m] of joint i in physics step `row` of the action or table,
  // `elapsed` [s] after the beginning of the action.
  double wanted(const Joint& j, std::size_t i, std::size_t row, double elapsed, double q,
                double qd) const {
    if (mode == Mode::table) {
      const std::size_t at = row * table.width + i;
      return table.feed[at] + j.kp * (table.q[at] - q) + j.kd * (table.qd[at] - qd);
    }
    if (!command.powered) return 0.0;
    double torque = command.feed[i];
    if (command.servo)
      torque += j.kp * (command.origin[i] + command.speed[i] * elapsed - q) +
                j.kd * (command.speed[i] - qd) + compensation(j, command.speed[i]);
    return torque;
  }

  // The torque [N m] of joint i's brake.
  double brake(const Joint& j, std::size_t i, double q, double qd) {
    if (!command.brake) return 0.0;
    const double stiffness = brake_stiffness * j.kp, slip = torque_limit[i] / stiffness;
    command.origin[i] = std::min(std::max(command.origin[i], q - slip), q + slip);
    const double torque = stiffness * (command.origin[i] - q) - brake_damping * j.kd * qd;
    return std::min(std::max(torque, -torque_limit[i]), torque_limit[i]);
  }

  void advance() {
    if (!command.servo) return;
    for (std::size_t i = 0; i < command.origin.size(); ++i)
      command.origin[i] += command.speed[i] * period;
  }

 private:
  static double bounded(double a) { return std::min(std::max(a, -1.0), 1.0); }

  double clear_of_ends(std::size_t i, double speed) const {
    const double up = end_rate * (high[i] - end_margin - command.origin[i]);
    const double down = end_rate * (low[i] + end_margin - command.origin[i]);
    return speed > 0 ? std::min(speed, std::max(up, 0.0)) : std::max(speed, std::min(down, 0.0));
  }

  void cartesian(const Kinematics& arms, const std::vector<Tool>& tools, const double* action) {
    for (std::size_t a = 0; a < tools.size(); ++a) {
      const std::size_t begin = static_cast<std::size_t>(tools[a].first);
      const std::size_t end =
          a + 1 < tools.size() ? static_cast<std::size_t>(tools[a + 1].first) : arms.size();
      double dx[6];
      for (int r = 0; r < 6; ++r) dx[r] = bounded(action[6 * a + r]) * scale[6 * a + r];
      arms.resolve(begin, end, arms.tool(tools[a]), dx, cartesian_damping, command.speed.data());
      double factor = 1.0;  // one factor for all joints keeps the direction of the motion
      for (std::size_t i = begin; i < end; ++i)
        factor =
            std::min(factor, max_speed[i] * period / std::max(std::fabs(command.speed[i]), 1e-300));
      for (std::size_t i = begin; i < end; ++i) command.speed[i] *= factor / period;
    }
  }

  // Keeps the reference so near to the arm that the servo's stiffness gives at most the torque
  // limit. So a blocked arm does not wind up. Without a servo the reference follows the arm.
  void follow(const std::vector<Joint>& joints, const double* q) {
    for (std::size_t i = 0; i < command.origin.size(); ++i) {
      const double window = command.servo || command.brake ? torque_limit[i] / joints[i].kp : 0.0;
      command.origin[i] = std::min(std::max(command.origin[i], q[i] - window), q[i] + window);
    }
  }
};

// Whether a number can be a value of type T; counts, flags and enums are whole numbers.
template <class T>
inline bool holds(const T&, double number) {
  if constexpr (std::is_same_v<T, double>) return true;
  const double most = std::is_same_v<T, bool>   ? 1
                      : std::is_enum_v<T>       ? static_cast<double>(Override::brake)
                      : sizeof(T) > sizeof(int) ? 0x1p53
                                                : 0x1p31 - 1;
  const bool below_zero = std::is_integral_v<T> && !std::is_same_v<T, bool>;
  return number == std::floor(number) && number <= most && number >= (below_zero ? -most : 0);
}

}  // namespace tauguard::envs
