// Estimates errors of a calibrated model that change slowly: an unknown load, and friction that
// changes with temperature.
//
// The estimator is a Kalman filter on the observer's residual. Its state holds the load's mass and
// first moment in the last link's frame and, for each joint, a relative error of the friction and a
// torque offset. The state decays to zero, which stands for the calibrated model. Only joints in
// motion correct the state: static friction may hold any torque, so the residual of a joint at rest
// does not depend on the load. A collision must not change the state: an innovation of z > c
// standard deviations, with c = `clip`, is reduced to c^2 / z standard deviations.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace tauguard::detectors {

class BiasFilter {
 public:
  static constexpr std::size_t load = 4;  // mass [kg] and first moment [kg m]
  // Standard deviations: of the relative friction error, and of the offset per friction level.
  static constexpr double friction_error = 0.3, offset = 0.1;
  // Time constant of the decay [s]; gears warm up within minutes.
  static constexpr double forget = 300.0;
  static constexpr double every = 0.05;  // time between two corrections [s]
  // Measurement variance of one correction, per squared friction level. Model errors of 0.3
  // friction levels last for about six corrections, so six corrections together count as one
  // measurement.
  static constexpr double variance = 0.3 * 0.3 * 6;
  static constexpr double clip = 3.0;
  static constexpr double started = 0.3;  // motion of a joint before its first correction [s]

  // `level` is each joint's friction level [N m]; `mass` [kg] and `moment` [kg m] are the standard
  // deviations of the load's mass and first moment.
  BiasFilter(const std::vector<double>& level, double mass, double moment)
      : n_(level.size()), m_(load + 2 * n_), deviation_(m_), noise_(n_), gain_(m_) {
    for (std::size_t a = 0; a < load; ++a) deviation_[a] = a ? moment : mass;
    for (std::size_t j = 0; j < n_; ++j) {
      deviation_[load + j] = friction_error;
      deviation_[load + n_ + j] = offset * level[j];
      noise_[j] = variance * level[j] * level[j];
    }
    reset();
  }

  void reset() {
    state_.assign(m_, 0.0);
    covariance_.assign(m_ * m_, 0.0);
    for (std::size_t a = 0; a < m_; ++a) covariance_[a * m_ + a] = deviation_[a] * deviation_[a];
    since_ = 0.0;
  }

  // Writes the residual minus the estimated biases to `left`, and the standard deviation of
  // this estimate to `spread`. `loads` (n x 4) is the derivative of the residual by the load;
  // `friction` is its derivative by the relative friction error of each joint; `moved` is the time
  // for which each joint has been in motion [s].
  void step(const double* residual, const double* loads, const double* friction,
            const double* moved, double dt, double* left, double* spread) {
    for (std::size_t j = 0; j < n_; ++j) {
      const double own = row(j, loads, friction);
      left[j] = residual[j] - own;
      spread[j] = std::sqrt(std::max(gather(), 0.0));
    }
    since_ += dt;
    if (since_ < every - 0.5 * dt) return;
    fade(since_);
    since_ = 0.0;
    for (std::size_t j = 0; j < n_; ++j)
      if (moved[j] > started) correct(j, residual[j], row(j, loads, friction));
  }

 private:
  // Sets the six entries of a joint's row of the measurement matrix that are not zero. Returns the
  // residual that the state predicts.
  double row(std::size_t j, const double* loads, const double* friction) {
    double sum = 0.0;
    for (std::size_t a = 0; a < load; ++a) {
      at_[a] = a;
      entry_[a] = loads[load * j + a];
    }
    at_[load] = load + j;
    entry_[load] = friction[j];
    at_[load + 1] = load + n_ + j;
    entry_[load + 1] = 1.0;
    for (std::size_t a = 0; a < load + 2; ++a) sum += entry_[a] * state_[at_[a]];
    return sum;
  }

  // Writes covariance times row to gain_. Returns the variance of the predicted residual.
  double gather() {
    for (std::size_t b = 0; b < m_; ++b) {
      double sum = 0.0;
      for (std::size_t a = 0; a < load + 2; ++a) sum += covariance_[b * m_ + at_[a]] * entry_[a];
      gain_[b] = sum;
    }
    double sum = 0.0;
    for (std::size_t a = 0; a < load + 2; ++a) sum += entry_[a] * gain_[at_[a]];
    return sum;
  }

  void fade(double dt) {
    const double keep = std::exp(-dt / forget);
    for (double& x : state_) x *= keep;
    for (double& x : covariance_) x *= keep * keep;
    for (std::size_t a = 0; a < m_; ++a)
      covariance_[a * m_ + a] += (1 - keep * keep) * deviation_[a] * deviation_[a];
  }

  void correct(std::size_t j, double residual, double predicted) {
    const double total = gather() + noise_[j], innovation = residual - predicted;
    const double z = std::fabs(innovation) / std::sqrt(total);
    const double counted = z > clip ? innovation * (clip / z) * (clip / z) : innovation;
    for (std::size_t a = 0; a < m_; ++a) state_[a] += gain_[a] * counted / total;
    for (std::size_t a = 0; a < m_; ++a)
      for (std::size_t b = 0; b < m_; ++b) covariance_[a * m_ + b] -= gain_[a] * gain_[b] / total;
  }

  std::size_t n_, m_;
  std::vector<double> deviation_, noise_, gain_, state_, covariance_;
  std::size_t at_[load + 2] = {};
  double entry_[load + 2] = {};
  double since_ = 0.0;
};

}  // namespace tauguard::detectors
