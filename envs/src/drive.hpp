// The drives over one step: current, friction and ripple, as documented in tauguard.models.Drive.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "tauguard/geometry/fields.hpp"

namespace tauguard::envs {

// One joint: its addresses in MuJoCo's arrays, its drive and its servo. A bristle stiffness of 0
// leaves only viscous friction.
struct Joint {
  int qpos = -1, dof = -1;     // addresses in qpos and qvel
  double gain = 1.0;           // N m/A, as simulated
  double nominal_gain = 1.0;   // N m/A, as the controller assumes
  double current_limit = 0.0;  // A
  double gear = 1.0;
  double coulomb = 0.0, breakaway = 0.0;  // N m, at the episode's temperature
  double stribeck_velocity = 1.0;         // rad/s
  double viscous = 0.0;                   // N m s/rad, at the episode's temperature
  double bristle_stiffness = 0.0;         // N m/rad
  double load = 0.0;                      // relative rise of friction per motor torque, 1/(N m)
  double kp = 0.0, kd = 0.0;              // N m/rad, N m s/rad
  // Speeds [rad/s]. Above the rated speed the largest torque along the motion falls linearly. It is
  // 0 at the no-load speed and negative beyond. A no-load speed of 0 disables this limit.
  double rated_speed = 0.0, no_load_speed = 0.0;
  double known_coulomb = 0.0, known_viscous = 0.0;  // compensated by the servo; N m, N m s/rad
  std::vector<double> cycles, amplitude, phase;     // ripple: per motor revolution; A; rad
  std::vector<double> slope,
      slope_velocity;  // rises of the friction level [N m], their speed scales
  TAUGUARD_FIELDS(qpos, dof, gain, nominal_gain, current_limit, gear, coulomb, breakaway,
                  stribeck_velocity, viscous, bristle_stiffness, load, kp, kd, rated_speed,
                  no_load_speed, known_coulomb, known_viscous, cycles, amplitude, phase, slope,
                  slope_velocity)
};

struct JointState {
  double current = 0.0;  // A
  double bristle = 0.0;  // rad
};

// Torque of bristle friction (Dahl/LuGre presliding with a Stribeck level) [N m]. The bristle's
// equation dz/dt = v - k |v| / g(v) z is solved exactly for a constant velocity over the step.
inline double friction(const Joint& j, JointState& s, double v, double tau, double dt) {
  if (j.bristle_stiffness <= 0.0) return j.viscous * v;
  const double ratio = v / j.stribeck_velocity;
  double level = j.coulomb + (j.breakaway - j.coulomb) * std::exp(-ratio * ratio);
  for (std::size_t k = 0; k < j.slope.size(); ++k)
    level += j.slope[k] * std::tanh(std::fabs(v) / j.slope_velocity[k]);
  level *= 1.0 + j.load * std::fabs(tau);
  if (level > 0.0) {
    const double decay = std::exp(-j.bristle_stiffness * std::fabs(v) / level * dt);
    const double settled = (v > 0 ? level : -level) / j.bristle_stiffness;
    s.bristle = v == 0.0 ? s.bristle : settled + (s.bristle - settled) * decay;
  } else {
    s.bristle = 0.0;
  }
  return j.bristle_stiffness * s.bristle + j.viscous * v;
}

// Torque ripple at position q [N m].
inline double ripple(const Joint& j, double q) {
  double sum = 0.0;
  for (std::size_t h = 0; h < j.cycles.size(); ++h)
    sum += j.amplitude[h] * std::sin(j.cycles[h] * j.gear * q + j.phase[h]);
  return j.gain * sum;
}

// Fraction of the current limit that the motor can supply along a motion at this speed. It falls,
// because back-EMF leaves less voltage.
inline double reserve(const Joint& j, double speed) {
  const double fraction = (j.no_load_speed - speed) / (j.no_load_speed - j.rated_speed);
  return std::min(std::max(fraction, -1.0), 1.0);
}

// `current` [A], limited to what the drive can supply at a joint speed.
inline double possible(const Joint& j, double current, double qd) {
  double low = -j.current_limit, high = j.current_limit;
  if (j.no_load_speed > 0.0) {
    const double speed = j.gain < 0 ? -qd : qd;
    high *= reserve(j, speed), low *= reserve(j, -speed);
  }
  return std::min(std::max(current, low), high);
}

// Torque with which the servo compensates known friction at a reference speed [N m]. The sign of
// the Coulomb part is tanh of the speed over `smooth` [rad/s].
inline double compensation(const Joint& j, double speed) {
  constexpr double smooth = 0.02;
  return j.known_coulomb * std::tanh(speed / smooth) + j.known_viscous * speed;
}

// All drives of a scene and their state.
struct DriveTrain {
  std::vector<Joint> joints;
  std::vector<JointState> states;
  double dt = 1e-3;    // of a physics step [s]
  double decay = 0.0;  // factor of the current's error per step; 0: no lag

  std::size_t size() const { return joints.size(); }
  void relax() { states.assign(joints.size(), JointState{}); }

  // Joint i's torque from the drive, less friction, for a wanted motor torque [N m]. The current is
  // limited and lags.
  double apply(std::size_t i, double wanted, double q, double qd) {
    const Joint& j = joints[i];
    JointState& s = states[i];
    const double command = possible(j, wanted / j.nominal_gain, qd);
    s.current = command + (s.current - command) * decay;
    const double tau = j.gain * s.current;
    return tau - friction(j, s, qd, tau, dt) + ripple(j, q);
  }
};

}  // namespace tauguard::envs
