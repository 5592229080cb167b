// Checks whether the drives' torques fit the arm's motion: signs, exchanged joints, gains, load.
//
// `given` is the drives' torque by the measured currents. `needed` = r + given is the torque of the
// motion by the model. Both pass the observer's filter. The ratio E[given needed] / E[needed^2] of
// a joint is 1 without errors and contacts, and -1 if the sign is wrong. E is an exponential
// average. A fast average finds torques of the wrong sign, a slow one torques of the wrong size.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "faults.hpp"

namespace tauguard::detectors {

struct TorqueBounds {
  double rate = 20;             // rate of the observer [1/s]
  double fast = 0.5;            // time constant of the fast average [s]
  double slow = 4.0;            // time constant of the slow average [s]
  double least_snr = 8.0;       // least RMS of `needed` to judge a ratio, in units of the noise
  std::vector<double> opposed;  // least allowed fast ratio of each joint
  std::vector<double> least;    // least allowed slow ratio of each joint
  std::vector<double> most;     // largest allowed slow ratio of each joint
};

class TorqueCheck {
 public:
  TorqueCheck(std::vector<double> gain, std::vector<double> noise, TorqueBounds bounds)
      : gain_(std::move(gain)), noise_(std::move(noise)), set_(bounds), n_(gain_.size()) {
    for (auto* v : {&given_, &fast_square_, &fast_product_, &slow_square_, &slow_product_})
      v->resize(n_);
    for (auto* v : {&fast_least_, &slow_least_, &slow_most_}) v->resize(n_);
    reset();
  }

  std::size_t joints() const { return n_; }

  // Forgets the samples so far.
  void reset() {
    time_ = 0;
    for (auto* v : {&given_, &fast_square_, &fast_product_, &slow_square_, &slow_product_})
      std::fill(v->begin(), v->end(), 0.0);
    for (auto* v : {&fast_least_, &slow_least_, &slow_most_}) std::fill(v->begin(), v->end(), 1.0);
  }

  // Least fast, least slow and largest slow ratio until now, initially 1; n each.
  std::vector<double> extremes() const {
    std::vector<double> all(fast_least_);
    all.insert(all.end(), slow_least_.begin(), slow_least_.end());
    all.insert(all.end(), slow_most_.begin(), slow_most_.end());
    return all;
  }

  // Processes a sample: r, the residual without Kalman filter [N m], currents [A], time step [s].
  Verdict step(const double* residual, const double* current, double dt) {
    const bool first = time_ == 0;
    const double low = first ? 1.0 : 1 - std::exp(-set_.rate * dt);
    const double fast = 1 - std::exp(-dt / set_.fast), slow = 1 - std::exp(-dt / set_.slow);
    time_ += dt;
    Verdict found;
    for (std::size_t j = 0; j < n_; ++j) {
      given_[j] += low * (gain_[j] * current[j] - given_[j]);
      const double needed = given_[j] + residual[j];
      const double square = needed * needed, product = needed * given_[j];
      if (first) fast_square_[j] = fast_product_[j] = slow_square_[j] = slow_product_[j] = square;
      fast_square_[j] += fast * (square - fast_square_[j]);
      fast_product_[j] += fast * (product - fast_product_[j]);
      slow_square_[j] += slow * (square - slow_square_[j]);
      slow_product_[j] += slow * (product - slow_product_[j]);
      const double loud = set_.least_snr * noise_[j] * (set_.least_snr * noise_[j]);
      const auto joint = static_cast<std::int32_t>(j);
      if (time_ > set_.fast && fast_square_[j] > loud) {
        const double ratio = fast_product_[j] / fast_square_[j];
        fast_least_[j] = std::min(fast_least_[j], ratio);
        if (found.fault == Fault::none && ratio < set_.opposed[j])
          found = {Fault::torque_opposed, joint, ratio};
      }
      if (time_ > set_.slow && slow_square_[j] > loud) {
        const double size = slow_product_[j] / slow_square_[j];
        slow_least_[j] = std::min(slow_least_[j], size);
        slow_most_[j] = std::max(slow_most_[j], size);
        if (found.fault == Fault::none && (size < set_.least[j] || size > set_.most[j]))
          found = {Fault::torque_size, joint, size};
      }
    }
    return found;
  }

 private:
  std::vector<double> gain_, noise_;
  TorqueBounds set_;
  std::size_t n_;
  double time_ = 0;
  std::vector<double> given_, fast_square_, fast_product_, slow_square_, slow_product_;
  std::vector<double> fast_least_, slow_least_, slow_most_;
};

}  // namespace tauguard::detectors
