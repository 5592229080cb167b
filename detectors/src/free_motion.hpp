// The free-motion detector: each joint's ratio of signal to bound from the samples of an arm.
//
// Samples are averaged over `interval`; an alarm needs tens of milliseconds above a bound anyway.
// The estimator gets the second of the last three means, with the median of their currents.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "estimator.hpp"
#include "regimes.hpp"

namespace tauguard::detectors {

class FreeMotion {
 public:
  static constexpr double interval = 4e-3;  // least time between two means [s]

  // Both arguments are of the same joints.
  FreeMotion(Estimator estimator, RegimeBounds bounds)
      : estimator_(std::move(estimator)),
        n_(estimator_.joints()),
        regimes_(std::move(bounds)),
        sum_(3 * n_),
        motion_(motion_numbers * n_) {
    for (auto* v : {&residual_, &left_, &spread_, &current_, &ratio_, &bound_}) v->resize(n_);
    for (Sample& s : last_) s.values.resize(3 * n_);
    reset();
  }

  std::size_t joints() const { return n_; }
  const std::vector<double>& ratio() const { return ratio_; }
  const std::vector<double>& bound() const { return bound_; }
  // Residual minus the estimated errors of the model [N m].
  const std::vector<double>& residual() const { return left_; }
  // Absolute accelerations [rad/s^2].
  const std::vector<double>& qdd() const { return estimator_.acceleration(); }
  const Regimes& regimes() const { return regimes_; }

  void reset() {
    count_ = 0;
    time_ = 0.0;
    std::fill(sum_.begin(), sum_.end(), 0.0);
    filled_ = false;
    for (auto* v : {&ratio_, &left_}) std::fill(v->begin(), v->end(), 0.0);
    std::fill(bound_.begin(), bound_.end(), 1.0);
    estimator_.reset();
    regimes_.reset();
  }

  // Processes a sample, `dt` s after the last one.
  void step(const double* q, const double* qd, const double* current, double dt) {
    for (std::size_t j = 0; j < n_; ++j) {
      sum_[j] += q[j];
      sum_[n_ + j] += qd[j];
      sum_[2 * n_ + j] += current[j];
    }
    ++count_;
    time_ += dt;
    if (!(time_ > interval - 0.5 * dt)) return;
    std::rotate(last_.begin(), last_.begin() + 1, last_.end());
    Sample& mean = last_.back();
    std::copy(sum_.begin(), sum_.end(), mean.values.begin());
    mean.dt = time_;
    for (double& x : mean.values) x /= count_;
    if (!filled_) last_[0] = last_[1] = mean;  // no allocation: sizes are equal
    filled_ = true;
    count_ = 0;
    time_ = 0.0;
    std::fill(sum_.begin(), sum_.end(), 0.0);
    take();
  }

 private:
  struct Sample {
    std::vector<double> values;  // q, qd, current
    double dt = 0.0;
  };

  void take() {
    const double *q = last_[1].values.data(), *qd = q + n_, dt = last_[1].dt;
    for (std::size_t j = 0; j < n_; ++j) {
      const std::size_t at = 2 * n_ + j;
      const double a = last_[0].values[at], b = last_[1].values[at], c = last_[2].values[at];
      current_[j] = std::max(std::min(a, b), std::min(std::max(a, b), c));
    }
    estimator_.step(q, qd, current_.data(), dt, residual_.data(), left_.data(), motion_.data());
    for (std::size_t j = 0; j < n_; ++j) spread_[j] = estimator_.spread(j);
    regimes_.motion(q, qd, dt);
    regimes_.judge(residual_.data(), left_.data(), spread_.data(), qd, qdd().data(), dt,
                   ratio_.data(), bound_.data());
  }

  Estimator estimator_;
  std::size_t n_;
  Regimes regimes_;
  std::vector<double> sum_, motion_, residual_, left_, spread_, current_, ratio_, bound_;
  std::array<Sample, 3> last_;
  std::size_t count_ = 0;
  double time_ = 0.0;
  bool filled_ = false;
};

}  // namespace tauguard::detectors
