// From an arm's samples to each joint's ratio of signal to bound: the free-motion detector.
//
// Samples that come faster than `interval` are averaged: a bound is about tens of milliseconds. The
// sample that is judged is the one before the last, with the median of three currents.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "bias_filter.hpp"
#include "chain.hpp"
#include "friction.hpp"
#include "observer.hpp"
#include "regimes.hpp"

namespace tauguard::detectors {

struct FreeSettings {
  std::vector<double> drive_gain;   // N m/A, n
  std::vector<double> weights;      // friction, n x columns
  std::vector<double> level;        // of each joint's friction [N m], n
  double mass = 0.0, moment = 0.0;  // deviations of the load that is carried [kg], [kg m]
  RegimeBounds bounds;
};

class FreeMotion {
 public:
  static constexpr double gain = 30.0;          // of the observer [1/s]
  static constexpr double acceleration = 20.0;  // rate of the differentiated velocity [1/s]
  static constexpr double interval = 4e-3;      // [s]

  FreeMotion(Chain chain, FrictionBasis basis, FreeSettings settings)
      : chain_(std::move(chain)),
        basis_(std::move(basis)),
        set_(std::move(settings)),
        n_(chain_.joints.size()),
        work_(n_),
        memory_(n_ * basis_.memory()),
        column_(basis_.columns()),
        slow_(set_.level, set_.mass, set_.moment),
        regimes_(set_.bounds),
        sum_(3 * n_) {
    for (auto* v : {&p_, &beta_, &p_before_, &beta_before_, &tau_, &tau_before_, &friction_,
                    &friction_before_, &residual_, &own_, &qd_before_, &qdd_, &left_, &spread_,
                    &ratio_, &bound_})
      v->resize(n_);
    for (auto* v : {&load_p_, &load_beta_, &load_p_before_, &load_beta_before_, &load_, &design_})
      v->resize(BiasFilter::load * n_);
    for (Sample& s : last_) s.values.resize(3 * n_);
    reset();
  }

  std::size_t joints() const { return n_; }
  bool started() const { return count_ > 0 || started_; }
  const std::vector<double>& ratio() const { return ratio_; }
  const std::vector<double>& bound() const { return bound_; }
  const std::vector<double>& residual() const { return left_; }  // without biases
  const std::vector<double>& qdd() const { return qdd_; }
  bool rest(std::size_t j) const { return regimes_.rest(j); }

  void reset() {
    started_ = false;
    count_ = 0;
    time_ = 0.0;
    std::fill(sum_.begin(), sum_.end(), 0.0);
    filled_ = false;
    for (auto* v : {&residual_, &own_, &qdd_, &load_, &ratio_, &left_})
      std::fill(v->begin(), v->end(), 0.0);
    std::fill(bound_.begin(), bound_.end(), 1.0);
    slow_.reset();
    regimes_.reset();
  }

  // One sample, `dt` s after the last.
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
    if (!filled_) last_[0] = last_[1] = mean;  // of one size: nothing is allocated
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
    if (!started_)
      for (std::size_t j = 0; j < n_; ++j) basis_.reset(q[j], &memory_[j * basis_.memory()]);
    chain_.momentum(q, qd, p_.data(), beta_.data(), work_);
    chain_.load_columns(static_cast<int>(n_) - 1, load_p_.data(), load_beta_.data(), work_);
    drive(q, qd);
    if (started_) filter(qd, dt);
    started_ = true;
    p_.swap(p_before_);
    beta_.swap(beta_before_);
    load_p_.swap(load_p_before_);
    load_beta_.swap(load_beta_before_);
    tau_.swap(tau_before_);
    friction_.swap(friction_before_);
    std::copy(qd, qd + n_, qd_before_.begin());
    regimes_.motion(qd, dt);
    for (std::size_t a = 0; a < design_.size(); ++a) design_[a] = -load_[a];
    slow_.step(residual_.data(), design_.data(), own_.data(), regimes_.moved(), dt, left_.data(),
               spread_.data());
    regimes_.judge(residual_.data(), left_.data(), spread_.data(), qd, qdd_.data(), dt,
                   ratio_.data(), bound_.data());
  }

  // Drive torques less friction, and the friction.
  void drive(const double* q, const double* qd) {
    const std::size_t columns = basis_.columns(), at = 2 * n_;
    for (std::size_t j = 0; j < n_; ++j) {
      const double a = last_[0].values[at + j], b = last_[1].values[at + j],
                   c = last_[2].values[at + j];
      const double median = std::max(std::min(a, b), std::min(std::max(a, b), c));
      const double tau = set_.drive_gain[j] * median;
      basis_.evaluate(j, q[j], qd[j], tau, basis_.modelled ? beta_[j] : tau,
                      &memory_[j * basis_.memory()], column_.data());
      double friction = 0.0;
      for (std::size_t c2 = 0; c2 < columns; ++c2)
        friction += set_.weights[j * columns + c2] * column_[c2];
      friction_[j] = friction;
      tau_[j] = tau - friction;
    }
  }

  void filter(const double* qd, double dt) {
    const double decay = observer_decay(gain, dt), quick = observer_decay(acceleration, dt);
    for (std::size_t j = 0; j < n_; ++j) {
      residual_[j] = observer_step(residual_[j], decay, dt, p_[j], p_before_[j], beta_[j],
                                   beta_before_[j], tau_before_[j]);
      own_[j] += decay * (-friction_before_[j] - own_[j]);
      qdd_[j] += quick * ((qd[j] - qd_before_[j]) / dt - qdd_[j]);
    }
    for (std::size_t a = 0; a < load_.size(); ++a)
      load_[a] = observer_step(load_[a], decay, dt, load_p_[a], load_p_before_[a], load_beta_[a],
                               load_beta_before_[a], 0.0);
  }

  Chain chain_;
  FrictionBasis basis_;
  FreeSettings set_;
  std::size_t n_;
  Workspace work_;
  std::vector<double> memory_, column_;
  BiasFilter slow_;
  Regimes regimes_;
  std::vector<double> sum_;
  std::vector<double> p_, beta_, p_before_, beta_before_, tau_, tau_before_, friction_,
      friction_before_, residual_, own_, qd_before_, qdd_, left_, spread_, ratio_, bound_;
  std::vector<double> load_p_, load_beta_, load_p_before_, load_beta_before_, load_, design_;
  std::array<Sample, 3> last_;
  std::size_t count_ = 0;
  double time_ = 0.0;
  bool started_ = false, filled_ = false;
};

}  // namespace tauguard::detectors
