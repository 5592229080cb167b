// The estimator: friction compensation, the momentum observer, and a Kalman filter of errors of the
// model (payload, friction). A residual that these errors do not explain indicates a collision.
//
// The residual is linear in the unknowns: r = Phi theta + tau_ext. The columns of Phi have passed
// the observer's filter. theta consists of the payload at the last link (mass and first moment in
// that link's frame) and, per joint, a torque offset and the relative errors of viscous and Coulomb
// friction; slow_errors.hpp estimates them.
//
// Errors of the model last for many samples, so successive corrections are not independent. The
// variance of their noise is therefore multiplied by `inflation`. Otherwise the filter would soon
// be too certain to correct a wrong payload or wrong friction. The clipping of innovations does not
// use `inflation`, because with it the filter would explain a long contact by a payload.
//
// The friction of a joint at rest can hold an unknown torque. If `started` is above 0, a joint
// corrects the unknowns only after it has moved for that time.
//
// If friction has just changed (a joint breaks away, stops or reverses), the model is assumed to
// err by `transition` times the change. Corrections add the square of this to the noise variance.
//
// With `weighted`, the unexplained residual is multiplied by s / S. s is the standard deviation of
// its noise, S that of noise and payload error together.
//
// The noise of a joint's residual grows with the joint's speed and with `motion_numbers` other
// quantities. M is the mass matrix of arm and estimated payload. Without unknowns the first three
// quantities are 0.
// * the torque of accelerations, sum_k |M_jk qdd_k|, because inertia is uncertain;
// * the norm of the joint's row of M, because at rest most of the noise is velocity noise times
//   inertia;
// * the recent change of friction (a joint breaks away, stops or reverses);
// * with `sampled`, half the change of torque since the last sample.
//
// Without `sampled`, a measured torque acts until the next sample. With `sampled`, for low sample
// rates, the mean of two samples acts between them. This avoids a lag of half a sample. While an
// arm accelerates, such a lag would cause residuals as large as those of a collision. The error of
// the mean is at most half the difference of the samples, and reaches this if a brake acts just
// after the first of them.
//
// The plain residual is that of an observer of rate `plain_gain` without a Kalman filter.
//
// An estimator without unknowns copies momentum and drive torques, if possible, from another
// estimator of the same arm that has processed the same sample.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <vector>

#include "chain.hpp"
#include "friction.hpp"
#include "observer.hpp"
#include "slow_errors.hpp"
#include "velocity.hpp"

namespace tauguard::detectors {

constexpr int coulomb_at = 2;
constexpr double acceleration_rate = 30.0;  // [1/s]
constexpr int motion_numbers = 4;           // number of the quantities listed above
constexpr double change_lasts = 0.3;        // time constant with which a change is forgotten [s]
constexpr double slow = 0.02;               // largest speed of a joint at rest [rad/s]

struct EstimatorSettings {
  std::vector<double> drive_gain;   // N m/A, n
  std::vector<double> gain;         // of the observer [1/s], n
  std::vector<double> weights;      // friction, n x columns
  std::vector<double> deviation;    // standard deviations of the unknowns, 4 + 3 n
  std::vector<double> persistence;  // time constants of the unknowns [s], 4 + 3 n
  std::vector<double> noise;        // standard deviation of the residual [N m], n
  double clip = 3.0;
  double every = 0.01;         // time between two corrections [s]
  double inflation = 1.0;      // number of corrections with the same error of the model
  double transition = 0.0;     // error just after a change of friction, relative to the change
  double started = 0.0;        // time that a joint has to move before its first correction [s]
  bool weighted = false;       // see above
  std::vector<double> fusion;  // gains (velocity.hpp), 6 n; empty: velocity as measured
  double plain_gain = 100.0;   // [1/s]
  bool sampled = false;        // the mean of two samples' torques acts between them, see above
};

class Estimator {
 public:
  Estimator(Chain chain, FrictionBasis basis, EstimatorSettings settings)
      : chain_(std::move(chain)),
        basis_(std::move(basis)),
        set_(std::move(settings)),
        n_(chain_.joints.size()),
        work_(n_),
        memory_(n_ * basis_.memory()),
        column_(basis_.columns()),
        fusion_(set_.fusion, n_),
        errors_(set_.deviation, set_.persistence, set_.clip),
        adapts_(errors_.any()),
        carrying_(chain_),
        mass_(n_ * n_) {
    for (auto* v : {&p_, &beta_, &p_before_, &beta_before_, &tau_, &tau_before_, &residual_,
                    &decay_, &plain_, &plain_tau_, &plain_tau_before_, &smooth_, &usual_, &inertia_,
                    &change_, &acceleration_, &moved_, &half_step_})
      v->resize(n_);
    for (auto* v : {&load_p_, &load_beta_, &load_p_before_, &load_beta_before_, &load_})
      v->resize(payload_numbers * n_);
    for (auto* v : {&own_now_, &own_before_, &own_}) v->resize(per_joint * n_);
    memory_before_ = memory_;
  }

  std::size_t joints() const { return n_; }
  std::size_t unknowns() const { return theta().size(); }
  bool started() const { return started_; }
  const std::vector<double>& theta() const { return errors_.state(); }
  const std::vector<double>& plain() const { return plain_; }
  double moved(std::size_t j) const { return moved_[j]; }  // time for which joint j has moved [s]
  const std::vector<double>& acceleration() const { return acceleration_; }  // absolute [rad/s^2]
  // Standard deviation of joint j's residual due to the unknowns [N m].
  double spread(std::size_t j) {
    return adapts_ ? std::sqrt(std::max(errors_.variance(j, load(j), own(j)), 0.0)) : 0.0;
  }

  void reset() {
    started_ = false;
    decay_dt_ = -1.0;
  }

  // Checks whether `other` is of the same arm, so that steps can copy from it.
  void compare(const Estimator& other) {
    if (arm_ != other.arm_ && chain_ == other.chain_ && basis_ == other.basis_ &&
        set_.drive_gain == other.set_.drive_gain && set_.weights == other.set_.weights)
      arm_ = other.arm_;
  }

  // Processes a sample. Outputs: the observer's residual r, the part that the unknowns do not
  // explain, and the quantities of the noise (motion_numbers rows of n). Accelerations are
  // velocities differentiated at acceleration_rate. `other` is null, or an estimator whose last
  // step was with the same q, qd and current.
  void step(const double* q, const double* qd, const double* current, double dt, double* residual,
            double* unexplained, double* motion, const Estimator* other = nullptr) {
    if (!started_) begin(q, qd);
    if (fusion_.active()) qd = started_ ? fusion_.step(q, qd, dt) : fusion_.last();
    if (other && !(!adapts_ && arm_ == other->arm_ && same_speeds(*other))) other = nullptr;
    if (other) {
      p_ = other->p_before_;
      beta_ = other->beta_before_;
    } else {
      chain_.momentum(q, qd, p_.data(), beta_.data(), work_);
    }
    if (adapts_)
      chain_.load_columns(static_cast<int>(n_) - 1, load_p_.data(), load_beta_.data(), work_);
    if (other && !basis_.modelled && same(memory_, other->memory_before_)) {
      memory_before_.swap(memory_);
      memory_ = other->memory_;
      plain_tau_ = tau_ = other->tau_before_;
    } else {
      memory_before_ = memory_;
      drive(q, qd, current);
    }
    if (started_) filter(dt);
    remember();
    for (std::size_t j = 0; j < n_; ++j) {
      residual[j] = unexplained[j] = residual_[j];
      if (started_) smooth_[j] += smooth_decay_ * (qd[j] - smooth_[j]);
      moved_[j] = std::fabs(qd[j]) < slow || !started_ ? 0.0 : moved_[j] + dt;
      acceleration_[j] = std::fabs(acceleration_rate * (qd[j] - smooth_[j]));
      motion[n_ + j] = inertia_[j];
      motion[2 * n_ + j] = change_[j];
      motion[3 * n_ + j] = half_step_[j];
    }
    for (std::size_t j = 0; j < n_; ++j) {
      motion[j] = 0.0;
      for (std::size_t k = 0; k < n_; ++k) motion[j] += mass_[j * n_ + k] * acceleration_[k];
    }
    if (adapts_) {
      for (std::size_t j = 0; j < n_; ++j)
        unexplained[j] = (residual_[j] - errors_.predicted(j, load(j), own(j))) * certainty(j);
      if (started_) since_ += dt;
      if (since_ > 0 && !(since_ < set_.every - 0.5 * dt)) {
        correct();
        weigh(q);
      }
    }
    started_ = true;
  }

 private:
  static bool same(const std::vector<double>& a, const std::vector<double>& b) {
    return a.size() == b.size() &&
           (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0);
  }
  bool same_speeds(const Estimator& other) const {
    return fusion_.active() == other.fusion_.active() && same(fusion_.all(), other.fusion_.all());
  }

  void begin(const double* q, const double* qd) {
    std::copy(qd, qd + n_, smooth_.begin());
    fusion_.reset(q, qd);
    for (std::size_t j = 0; j < n_; ++j) basis_.reset(q[j], &memory_[j * basis_.memory()]);
    for (auto* v : {&residual_, &plain_, &load_, &own_, &usual_, &mass_, &inertia_, &change_,
                    &moved_, &half_step_})
      std::fill(v->begin(), v->end(), 0.0);
    errors_.reset();
    since_ = 0.0;
    if (adapts_) weigh(q);
  }

  // Computes |M_jk| of arm and estimated payload, and the norms of the rows of M.
  void weigh(const double* q) {
    Inertial& held = carrying_.joints.back().inertial;
    const Inertial& empty = chain_.joints.back().inertial;
    held.mass = empty.mass - theta()[0];
    held.moment = empty.moment - Vec3{theta()[1], theta()[2], theta()[3]};
    std::fill(inertia_.begin(), inertia_.end(), 0.0);
    carrying_.mass_matrix(q, mass_.data(), work_);
    for (std::size_t j = 0; j < n_; ++j)
      for (std::size_t k = 0; k < n_; ++k) {
        double& entry = mass_[j * n_ + k];
        inertia_[j] += entry * entry;
        entry = std::fabs(entry);
      }
    for (double& x : inertia_) x = std::sqrt(x);
  }

  // Drive torques minus friction, and their decrease per unit of each of the joint's own unknowns.
  void drive(const double* q, const double* qd, const double* current) {
    const std::size_t columns = basis_.columns(), smooth = basis_.smooth();
    for (std::size_t j = 0; j < n_; ++j) {
      const double tau = set_.drive_gain[j] * current[j];
      const double load = basis_.modelled ? carried(j) : tau;
      basis_.evaluate(j, q[j], qd[j], tau, load, &memory_[j * basis_.memory()], column_.data());
      const double* w = &set_.weights[j * columns];
      const double viscous = w[FrictionBasis::viscous_at] * column_[FrictionBasis::viscous_at];
      double coulomb = 0.0, other = w[FrictionBasis::offset_at];
      for (std::size_t c = FrictionBasis::first_at; c < smooth; ++c) coulomb += w[c] * column_[c];
      for (std::size_t c = smooth; c < columns; ++c) other += w[c] * column_[c];
      tau_[j] = tau - (viscous + coulomb + other);
      plain_tau_[j] = tau_[j];
      if (basis_.modelled && load != 0.0) {
        double grows = 0.0;  // load-dependent friction; without the payload in plain_tau_
        for (std::size_t c = basis_.loaded_at(); c < smooth; ++c) grows += w[c] * column_[c];
        plain_tau_[j] += grows * (1.0 - std::fabs(beta_[j] / load));
      }
      own_now_[per_joint * j] = 1.0;
      own_now_[per_joint * j + 1] = viscous;
      own_now_[per_joint * j + coulomb_at] = coulomb;
    }
  }

  // Torque of arm and estimated payload at joint j without accelerations. A payload that the model
  // does not contain causes a negative residual, so theta is minus the payload.
  double carried(std::size_t j) const {
    double sum = beta_[j];
    if (adapts_)
      for (int a = 0; a < payload_numbers; ++a)
        sum -= load_beta_[payload_numbers * j + a] * theta()[a];
    return sum;
  }

  void filter(double dt) {
    if (dt != decay_dt_) {
      for (std::size_t j = 0; j < n_; ++j)
        decay_[j] = j > 0 && set_.gain[j] == set_.gain[j - 1] ? decay_[j - 1]
                                                              : observer_decay(set_.gain[j], dt);
      smooth_decay_ = observer_decay(acceleration_rate, dt);
      plain_decay_ = observer_decay(set_.plain_gain, dt);
      change_decay_ = std::exp(-dt / change_lasts);
      decay_dt_ = dt;
    }
    const double now = set_.sampled ? 0.5 : 0.0;  // weight of this sample's torque
    const auto acting = [now](double before, double after) {
      return before + now * (after - before);
    };
    for (std::size_t j = 0; j < n_; ++j) {
      half_step_[j] = now * std::fabs(tau_[j] - tau_before_[j]);
      residual_[j] = observer_step(residual_[j], decay_[j], dt, p_[j], p_before_[j], beta_[j],
                                   beta_before_[j], acting(tau_before_[j], tau_[j]));
      plain_[j] = observer_step(plain_[j], plain_decay_, dt, p_[j], p_before_[j], beta_[j],
                                beta_before_[j], acting(plain_tau_before_[j], plain_tau_[j]));
      if (!adapts_) continue;
      for (std::size_t a = j * payload_numbers; a < (j + 1) * payload_numbers; ++a)
        load_[a] = observer_step(load_[a], decay_[j], dt, load_p_[a], load_p_before_[a],
                                 load_beta_[a], load_beta_before_[a], 0.0);
      for (std::size_t a = j * per_joint; a < (j + 1) * per_joint; ++a)
        own_[a] += decay_[j] * (-acting(own_before_[a], own_now_[a]) - own_[a]);
      usual_[j] += smooth_decay_ * (own_[per_joint * j + coulomb_at] - usual_[j]);
      const double off = std::fabs(own_[per_joint * j + coulomb_at] - usual_[j]);
      change_[j] = std::max(off, change_[j] * change_decay_);
    }
  }

  void remember() {
    p_.swap(p_before_);
    beta_.swap(beta_before_);
    load_p_.swap(load_p_before_);
    load_beta_.swap(load_beta_before_);
    tau_before_ = tau_;
    plain_tau_before_ = plain_tau_;
    own_before_ = own_now_;
  }

  const double* load(std::size_t j) const { return &load_[payload_numbers * j]; }
  const double* own(std::size_t j) const { return &own_[per_joint * j]; }

  double certainty(std::size_t j) const {
    if (!set_.weighted) return 1.0;
    const double noise = set_.noise[j] * set_.noise[j];
    const double more = errors_.payload_variance(load(j));
    return more > 0 ? std::sqrt(noise / (noise + more)) : 1.0;
  }

  // Variance of the residual due to the recent change of friction [(N m)^2].
  double changed(std::size_t j) const {
    const double off = set_.transition * (own_[per_joint * j + coulomb_at] - usual_[j]);
    return off * off;
  }

  void correct() {
    errors_.fade(since_);
    since_ = 0.0;
    for (std::size_t j = 0; j < n_; ++j)
      if (set_.started == 0.0 || moved_[j] > set_.started)
        errors_.correct(j, residual_[j], load(j), own(j),
                        set_.noise[j] * set_.noise[j] + changed(j), set_.inflation);
  }

  Chain chain_;
  FrictionBasis basis_;
  EstimatorSettings set_;
  std::size_t n_;
  Workspace work_;
  std::vector<double> memory_, memory_before_, column_;
  VelocityFusion fusion_;
  SlowErrors errors_;
  bool adapts_;
  std::vector<double> p_, beta_, p_before_, beta_before_, tau_, tau_before_, residual_, decay_;
  std::vector<double> load_p_, load_beta_, load_p_before_, load_beta_before_, load_;
  std::vector<double> own_now_, own_before_, own_, smooth_, usual_, moved_, half_step_;
  std::vector<double> plain_, plain_tau_, plain_tau_before_;
  std::shared_ptr<int> arm_ = std::make_shared<int>();  // one for all estimators of one arm
  Chain carrying_;                                      // the arm with the estimated payload
  std::vector<double> mass_, inertia_, change_, acceleration_;
  double decay_dt_ = -1.0, smooth_decay_ = 0.0, plain_decay_ = 0.0, change_decay_ = 0.0;
  double since_ = 0.0;  // time since the last correction [s]
  bool started_ = false;
};

}  // namespace tauguard::detectors
