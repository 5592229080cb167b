// The drives over one step: current, friction and ripple, as documented in tauguard.models.Drive.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace tauguard::envs {

// One joint: where it is in MuJoCo's arrays, its drive and its servo. A bristle stiffness of 0
// leaves friction out, an empty ripple the ripple.
struct Joint {
  int qpos = -1, dof = -1;     // addresses in qpos and qvel
  double gain = 1.0;           // N m/A, as simulated
  double nominal_gain = 1.0;   // N m/A, as the controller believes
  double current_limit = 0.0;  // A
  double gear = 1.0;
  double coulomb = 0.0, breakaway = 0.0;  // N m, at the episode's temperature
  double stribeck_velocity = 1.0;         // rad/s
  double viscous = 0.0;                   // N m s/rad, at the episode's temperature
  double bristle_stiffness = 0.0;         // N m/rad
  double load = 0.0;                      // 1/(N m)
  double kp = 0.0, kd = 0.0;              // N m/rad, N m s/rad
  // Above the rated speed the torque along the motion falls, to nothing at the no-load speed, and
  // brakes beyond [rad/s]; a no-load speed of 0 leaves this out.
  double rated_speed = 0.0, no_load_speed = 0.0;
  double known_coulomb = 0.0, known_viscous = 0.0;  // what the servo makes up for; N m, N m s/rad
  std::vector<double> cycles, amplitude, phase;     // per motor revolution; A; rad
  std::vector<double> slope, slope_velocity;        // rises of the friction level; N m, rad/s
};

struct JointState {
  double current = 0.0;  // A
  double bristle = 0.0;  // rad
};

// Bristle friction (Dahl/LuGre presliding with a Stribeck level), the bristle integrated exactly
// for a constant velocity over the step: dz/dt = v - k |v| / g(v) z. Returns the friction torque [N
// m].
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

// Fraction of the current limit that is available in the direction of a speed; the motor's back-EMF
// takes the rest of the voltage.
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

// Torque by which the servo compensates the friction that it knows at a reference speed [N m]; the
// Coulomb part rises over `smooth` [rad/s].
inline double compensation(const Joint& j, double speed) {
  constexpr double smooth = 0.02;
  return j.known_coulomb * std::tanh(speed / smooth) + j.known_viscous * speed;
}

// All drives of a scene and their state.
struct DriveTrain {
  std::vector<Joint> joints;
  std::vector<JointState> states;
  double dt = 1e-3;    // of a physics step [s]
  double decay = 0.0;  // of the current's error over a step; 0: no lag

  std::size_t size() const { return joints.size(); }
  void relax() { states.assign(joints.size(), JointState{}); }

  // The torque [N m] that joint i's drive leaves at the joint for a wanted motor torque; the
  // current is limited and lags.
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
