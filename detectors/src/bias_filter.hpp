// What a calibrated model gets wrong slowly: a load that is not known, warmer or colder friction.
//
// A Kalman filter on the observer's residual. The unknowns are the load's mass and first moment in
// the last link's frame, and of each joint a relative error of its friction and a torque offset;
// all are forgotten towards the calibration. Only joints in motion correct them: static friction
// may hold any torque, so a joint at rest says nothing of the load. A push is no bias: an
// innovation z of more than `clip` standard deviations c counts as c^2 / z.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace tauguard::detectors {

class BiasFilter {
 public:
  static constexpr std::size_t load = 4;  // mass [kg] and first moment [kg m]
  // Standard deviations of a joint's relative friction error, and of its offset per friction level.
  static constexpr double friction_error = 0.3, offset = 0.1;
  // Time constant with which all is forgotten [s]: gears warm up within minutes.
  static constexpr double forget = 300.0;
  static constexpr double every = 0.05;  // time between two corrections [s]
  // Variance of one correction per squared friction level: model errors of 0.3 that last some six
  // corrections.
  static constexpr double variance = 0.3 * 0.3 * 6;
  static constexpr double clip = 3.0;
  static constexpr double started = 0.3;  // a joint counts so long after its start [s]

  // `level` of each joint's friction [N m]; deviations of the load [kg] and its moment [kg m].
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

  // The residual less the biases, in `left`, and the deviation that they leave, in `spread`.
  // `loads` is the residual's change per unit of the load, n x 4; `friction` per relative error of
  // each joint's friction; `moved` how long each joint has been in motion [s].
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
  // The six entries of a joint's row that are not zero; what the state says of the residual.
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

  // Covariance times the row, in gain_; the variance of what the row predicts.
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
