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
  double coulomb = 0.0, breakaway = 0.0;         // N m, at the episode's temperature
  double stribeck_velocity = 1.0;                // rad/s
  double viscous = 0.0;                          // N m s/rad, at the episode's temperature
  double bristle_stiffness = 0.0;                // N m/rad
  double load = 0.0;                             // 1/(N m)
  double kp = 0.0, kd = 0.0;                     // N m/rad, N m s/rad
  std::vector<double> cycles, amplitude, phase;  // per motor revolution; A; rad
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
  const double level = (j.coulomb + (j.breakaway - j.coulomb) * std::exp(-ratio * ratio)) *
                       (1.0 + j.load * std::fabs(tau));
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
    const double command =
        std::min(std::max(wanted / j.nominal_gain, -j.current_limit), j.current_limit);
    s.current = command + (s.current - command) * decay;
    const double tau = j.gain * s.current;
    return tau - friction(j, s, qd, tau, dt) + ripple(j, q);
  }
};

}  // namespace tauguard::envs
