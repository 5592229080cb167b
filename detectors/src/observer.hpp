// The momentum observer: a first-order estimate of tau_ext from positions, velocities and drive
// torques.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "chain.hpp"

namespace tauguard::detectors {

// One step of the filter dr/dt = gain (dp/dt - tau - beta - r), with decay = 1 - exp(-gain dt). It
// is exact if dp/dt - tau - beta is constant over the step, and stable for any gain x dt. beta =
// C^T qd - g is averaged over both ends of the step; tau is that at its beginning.
inline double observer_step(double r, double decay, double dt, double p, double p_before,
                            double beta, double beta_before, double tau_before) {
  return r + decay * ((p - p_before) / dt - (tau_before + (beta + beta_before) / 2) - r);
}

inline double observer_decay(double gain, double dt) { return -std::expm1(-gain * dt); }

class Observer {
 public:
  Observer(Chain chain, std::vector<double> gain)
      : chain_(std::move(chain)), gain_(std::move(gain)), work_(chain_.joints.size()) {
    const std::size_t n = chain_.joints.size();
    for (auto* v : {&p_, &beta_, &p_before_, &beta_before_, &tau_before_, &residual_, &decay_})
      v->resize(n);
  }

  const Chain& chain() const { return chain_; }
  bool started() const { return started_; }
  const std::vector<double>& residual() const { return residual_; }

  // Sets the residual to 0, and the last sample to these values.
  void reset(const double* q, const double* qd, const double* tau) {
    chain_.momentum(q, qd, p_before_.data(), beta_before_.data(), work_);
    for (std::size_t j = 0; j < gain_.size(); ++j) {
      tau_before_[j] = tau[j];
      residual_[j] = 0.0;
    }
    started_ = true;
  }

  // The residual at the sample (q, qd), `dt` s after the last one. tau is the torque from this
  // sample on: only the next step uses it.
  const double* step(const double* q, const double* qd, const double* tau, double dt) {
    chain_.momentum(q, qd, p_.data(), beta_.data(), work_);
    if (dt != decay_dt_) {
      for (std::size_t j = 0; j < gain_.size(); ++j) decay_[j] = observer_decay(gain_[j], dt);
      decay_dt_ = dt;
    }
    for (std::size_t j = 0; j < gain_.size(); ++j) {
      residual_[j] = observer_step(residual_[j], decay_[j], dt, p_[j], p_before_[j], beta_[j],
                                   beta_before_[j], tau_before_[j]);
      tau_before_[j] = tau[j];
    }
    p_.swap(p_before_);
    beta_.swap(beta_before_);
    return residual_.data();
  }

  // The state between two steps.
  std::vector<double> state() const {
    std::vector<double> out = {started_ ? 1.0 : 0.0};
    for (const auto* v : {&p_before_, &beta_before_, &tau_before_, &residual_})
      out.insert(out.end(), v->begin(), v->end());
    return out;
  }

  // Restores what state() returned; false if the length differs.
  bool restore(const std::vector<double>& saved) {
    if (saved.size() != 1 + 4 * gain_.size()) return false;
    started_ = saved[0] != 0.0;
    auto from = saved.begin() + 1;
    for (auto* v : {&p_before_, &beta_before_, &tau_before_, &residual_}) {
      std::copy(from, from + static_cast<std::ptrdiff_t>(v->size()), v->begin());
      from += static_cast<std::ptrdiff_t>(v->size());
    }
    return true;
  }

 private:
  Chain chain_;
  std::vector<double> gain_;
  Workspace work_;
  std::vector<double> p_, beta_, p_before_, beta_before_, tau_before_, residual_, decay_;
  double decay_dt_ = -1.0;
  bool started_ = false;
};

}  // namespace tauguard::detectors
