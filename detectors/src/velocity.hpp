// Joint velocity from measured position and velocity: a steady-state Kalman filter on position,
// velocity and acceleration. The model of the acceleration is a random walk.
#pragma once

#include <cstddef>
#include <vector>

namespace tauguard::detectors {

class VelocityFusion {
 public:
  // Gains of a joint: corrections of position, velocity and acceleration per unit of the two
  // innovations (position and velocity).
  static constexpr std::size_t gain_numbers = 6;

  VelocityFusion() = default;
  VelocityFusion(std::vector<double> gains, std::size_t joints)
      : gains_(std::move(gains)), state_(3 * joints), velocity_(gains_.empty() ? 0 : joints) {}

  bool active() const { return !gains_.empty(); }

  void reset(const double* q, const double* qd) {
    for (std::size_t j = 0; j < velocity_.size(); ++j) {
      state_[3 * j] = q[j];
      state_[3 * j + 1] = velocity_[j] = qd[j];
      state_[3 * j + 2] = 0.0;
    }
  }

  // Processes a sample and returns the fused velocities.
  const double* step(const double* q, const double* qd, double dt) {
    for (std::size_t j = 0; j < velocity_.size(); ++j) {
      double* x = &state_[3 * j];
      const double* g = &gains_[gain_numbers * j];
      x[0] += dt * (x[1] + 0.5 * dt * x[2]);
      x[1] += dt * x[2];
      const double place = q[j] - x[0], speed = qd[j] - x[1];
      for (std::size_t i = 0; i < 3; ++i) x[i] += g[2 * i] * place + g[2 * i + 1] * speed;
      velocity_[j] = x[1];
    }
    return velocity_.data();
  }

  const double* last() const { return velocity_.data(); }
  const std::vector<double>& all() const { return velocity_; }

 private:
  std::vector<double> gains_, state_, velocity_;
};

}  // namespace tauguard::detectors
