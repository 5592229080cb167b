// The estimator: friction compensation, momentum observer, and a Kalman filter for what the model
// does not know (payload, friction that has changed), so that the residual that is left is a
// collision.
//
// The residual of a wrong model is linear in what is wrong: r = Phi theta + tau_ext with Phi the
// columns of the unknowns, passed through the observer's own filter. theta holds the payload at the
// last link (mass and first moment in that link's frame) and, per joint, a torque offset and the
// relative errors of viscous and Coulomb friction. Each is an Ornstein-Uhlenbeck process with its
// own standard deviation and time constant: what no motion excites falls back to zero. A standard
// deviation of 0 removes an unknown.
//
// An innovation z of more than c = `clip` standard deviations counts as c^2 / z: the larger it is,
// the less it says about the model, and the sooner it is a collision. The deviation is that of one
// innovation; `inflation` is no part of it, or a held contact would be learned as a payload.
//
// Errors of the model last longer than the time between two corrections, each of which would take
// them for news: the noise of a correction has `inflation` times its variance, or the filter soon
// trusts a wrong payload, and friction errors many times their deviation, more than what it sees.
//
// Where friction has just changed (a joint breaks away, stops or turns) the model is wrong by a
// fraction `transition` of the change: a variance that is added to the noise's.
//
// What the unknowns do not explain counts less where payload or friction is uncertain (`weighted`):
// it is divided by the deviation of noise, payload and change of friction together, in units of the
// noise's.
//
// What the noise of the residual grows with, beside the speed (`motion_numbers` a joint), if there
// are unknowns: the torque of accelerations, sum_k |M_jk qdd_k|, since inertia is known to some
// percent; the norm of the joint's row of the mass matrix M, since the noise of velocities, times
// inertia, is most of what a joint at rest shows; and how far friction was of late from its usual
// value: a joint breaks away, stops or turns. M is that of arm and tracked payload.
//
// Torques act until the next sample, or with `sampled` are instants of a slow log: between two of
// them torque and friction count with their mean, as gravity does. Half a sample of lag would
// otherwise be, while an arm accelerates, as large as a collision.
//
// The plain residual is that of an observer of rate `plain_gain` that tracks nothing.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "chain.hpp"
#include "friction.hpp"
#include "observer.hpp"
#include "velocity.hpp"

namespace tauguard::detectors {

constexpr int payload_numbers = 4;  // mass and first moment
constexpr int per_joint = 3;        // offset, viscous, Coulomb
constexpr int coulomb_at = 2;
constexpr double acceleration_rate = 30.0;  // [1/s]
constexpr int motion_numbers = 3;           // torque of accelerations, inertia, change
constexpr double change_lasts = 0.3;        // time constant with which a change is forgotten [s]

struct EstimatorSettings {
  std::vector<double> drive_gain;   // N m/A, n
  std::vector<double> gain;         // of the observer [1/s], n
  std::vector<double> weights;      // friction, n x columns
  std::vector<double> deviation;    // of the unknowns, 4 + 3 n
  std::vector<double> persistence;  // time constants of the unknowns [s], 4 + 3 n
  std::vector<double> noise;        // standard deviation of the residual [N m], n
  double clip = 3.0;
  int every = 10;              // samples between two corrections
  double inflation = 1.0;      // corrections that an error of the model lasts for
  double transition = 0.0;     // relative error of friction that has just changed
  bool weighted = false;       // see above; false: all of the unexplained residual counts
  std::vector<double> fusion;  // of position and velocity, 6 n; empty: velocity as measured
  double plain_gain = 100.0;   // [1/s]
  bool sampled = false;        // torques are instants; false: they act until the next sample
};

class Estimator {
 public:
  Estimator(Chain chain, FrictionBasis basis, EstimatorSettings settings)
      : chain_(std::move(chain)),
        basis_(std::move(basis)),
        set_(std::move(settings)),
        n_(chain_.joints.size()),
        m_(payload_numbers + per_joint * n_),
        work_(n_),
        memory_(n_ * basis_.memory()),
        column_(basis_.columns()),
        fusion_(set_.fusion, n_),
        theta_(m_),
        covariance_(m_ * m_),
        gathered_(m_),
        row_(m_),
        carrying_(chain_),
        mass_(n_ * n_) {
    for (auto* v : {&p_, &beta_, &p_before_, &beta_before_, &tau_, &tau_before_, &residual_,
                    &decay_, &plain_, &plain_tau_, &plain_tau_before_, &smooth_, &usual_, &inertia_,
                    &change_, &acceleration_, &one_, &moved_, &unused_})
      v->resize(n_);
    for (auto* v : {&load_p_, &load_beta_, &load_p_before_, &load_beta_before_, &load_})
      v->resize(payload_numbers * n_);
    for (auto* v : {&own_now_, &own_before_, &own_}) v->resize(per_joint * n_);
    adapts_ = false;
    for (const double d : set_.deviation) adapts_ = adapts_ || d > 0;
  }

  std::size_t joints() const { return n_; }
  std::size_t unknowns() const { return m_; }
  bool started() const { return started_; }
  const std::vector<double>& theta() const { return theta_; }
  const std::vector<double>& plain() const { return plain_; }

  void reset() {
    started_ = false;
    decay_dt_ = -1.0;
  }

  // One sample: residual r of the observer, what the unknowns do not explain of it, and what its
  // noise grows with, motion_numbers rows of n. Accelerations are velocities differentiated at the
  // rate acceleration_rate.
  void step(const double* q, const double* qd, const double* current, double dt, double* residual,
            double* unexplained, double* motion) {
    if (!started_) begin(q, qd);
    if (fusion_.active()) qd = started_ ? fusion_.step(q, qd, dt) : fusion_.last();
    chain_.momentum(q, qd, p_.data(), beta_.data(), work_);
    if (adapts_)
      chain_.load_columns(static_cast<int>(n_) - 1, load_p_.data(), load_beta_.data(), work_);
    drive(q, qd, current);
    if (started_) filter(dt);
    remember();
    for (std::size_t j = 0; j < n_; ++j) {
      residual[j] = unexplained[j] = residual_[j];
      if (started_) smooth_[j] += smooth_decay_ * (qd[j] - smooth_[j]);
      acceleration_[j] = std::fabs(acceleration_rate * (qd[j] - smooth_[j]));
      motion[n_ + j] = inertia_[j];
      motion[2 * n_ + j] = change_[j];
    }
    for (std::size_t j = 0; j < n_; ++j) {
      motion[j] = 0.0;
      for (std::size_t k = 0; k < n_; ++k) motion[j] += mass_[j * n_ + k] * acceleration_[k];
    }
    if (adapts_) {
      for (std::size_t j = 0; j < n_; ++j)
        unexplained[j] = (residual_[j] - expected(j)) * certainty(j);
      if (started_ && ++since_ >= set_.every) {
        correct(dt * since_);
        weigh(q);
      }
    }
    started_ = true;
  }

 private:
  void begin(const double* q, const double* qd) {
    std::copy(qd, qd + n_, smooth_.begin());
    fusion_.reset(q, qd);
    for (std::size_t j = 0; j < n_; ++j) basis_.reset(q[j], &memory_[j * basis_.memory()]);
    for (auto* v : {&residual_, &plain_, &load_, &own_, &usual_, &mass_, &inertia_, &change_,
                    &theta_, &covariance_})
      std::fill(v->begin(), v->end(), 0.0);
    for (std::size_t a = 0; a < m_; ++a)
      covariance_[a * m_ + a] = set_.deviation[a] * set_.deviation[a];
    since_ = 0;
    if (adapts_) weigh(q);
  }

  // The mass matrix of arm and tracked payload, its entries' sizes, and the norms of its rows.
  void weigh(const double* q) {
    Inertial& held = carrying_.joints.back().inertial;
    const Inertial& empty = chain_.joints.back().inertial;
    held.mass = empty.mass - theta_[0];
    held.moment = empty.moment - Vec3{theta_[1], theta_[2], theta_[3]};
    std::fill(inertia_.begin(), inertia_.end(), 0.0);
    for (std::size_t k = 0; k < n_; ++k) {
      one_[k] = 1.0;
      carrying_.momentum(q, one_.data(), moved_.data(), unused_.data(), work_);
      one_[k] = 0.0;
      for (std::size_t j = 0; j < n_; ++j) {
        mass_[j * n_ + k] = std::fabs(moved_[j]);
        inertia_[j] += moved_[j] * moved_[j];
      }
    }
    for (double& x : inertia_) x = std::sqrt(x);
  }

  // Drive torques less friction, and what each unknown of a joint's own would add to them.
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
        double grows = 0.0;  // friction that is proportional to the load, here without the payload
        for (std::size_t c = basis_.loaded_at(); c < smooth; ++c) grows += w[c] * column_[c];
        plain_tau_[j] += grows * (1.0 - std::fabs(beta_[j] / load));
      }
      own_now_[per_joint * j] = 1.0;
      own_now_[per_joint * j + 1] = viscous;
      own_now_[per_joint * j + coulomb_at] = coulomb;
    }
  }

  // Torque that arm and tracked payload need at joint j, accelerations aside. The residual of a
  // payload that the model lacks has the sign of what is missing: theta is less than 0 for it.
  double carried(std::size_t j) const {
    double sum = beta_[j];
    if (adapts_)
      for (int a = 0; a < payload_numbers; ++a)
        sum -= load_beta_[payload_numbers * j + a] * theta_[a];
    return sum;
  }

  void filter(double dt) {
    if (dt != decay_dt_) {
      for (std::size_t j = 0; j < n_; ++j) decay_[j] = observer_decay(set_.gain[j], dt);
      smooth_decay_ = observer_decay(acceleration_rate, dt);
      plain_decay_ = observer_decay(set_.plain_gain, dt);
      change_decay_ = std::exp(-dt / change_lasts);
      decay_dt_ = dt;
    }
    const double now = set_.sampled ? 0.5 : 0.0;  // the part of this sample's torque
    const auto acting = [now](double before, double after) {
      return before + now * (after - before);
    };
    for (std::size_t j = 0; j < n_; ++j) {
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

  double expected(std::size_t j) const {
    double sum = 0.0;
    for (int a = 0; a < payload_numbers; ++a) sum += load_[payload_numbers * j + a] * theta_[a];
    for (int a = 0; a < per_joint; ++a)
      sum += own_[per_joint * j + a] * theta_[payload_numbers + per_joint * j + a];
    return sum;
  }

  double certainty(std::size_t j) const {
    if (!set_.weighted) return 1.0;
    const double* h = &load_[payload_numbers * j];
    const double noise = set_.noise[j] * set_.noise[j];
    double more = changed(j);
    for (int a = 0; a < payload_numbers; ++a)
      for (int b = 0; b < payload_numbers; ++b) more += h[a] * covariance_[a * m_ + b] * h[b];
    return more > 0 ? std::sqrt(noise / (noise + more)) : 1.0;
  }

  // Variance of the residual because friction differs from its usual value of late [(N m)^2].
  double changed(std::size_t j) const {
    const double off = set_.transition * (own_[per_joint * j + coulomb_at] - usual_[j]);
    return off * off;
  }

  // The Kalman filter: time update over `elapsed` seconds, then one scalar update per joint.
  void correct(double elapsed) {
    since_ = 0;
    for (std::size_t a = 0; a < m_; ++a) row_[a] = std::exp(-elapsed / set_.persistence[a]);
    for (std::size_t a = 0; a < m_; ++a) {
      theta_[a] *= row_[a];
      for (std::size_t b = 0; b < m_; ++b) covariance_[a * m_ + b] *= row_[a] * row_[b];
      covariance_[a * m_ + a] += (1 - row_[a] * row_[a]) * set_.deviation[a] * set_.deviation[a];
    }
    for (std::size_t j = 0; j < n_; ++j) update(j);
  }

  void update(std::size_t j) {
    const std::size_t first = payload_numbers + per_joint * j;
    std::fill(row_.begin(), row_.end(), 0.0);
    for (int a = 0; a < payload_numbers; ++a) row_[a] = load_[payload_numbers * j + a];
    for (int a = 0; a < per_joint; ++a) row_[first + a] = own_[per_joint * j + a];
    double variance = set_.inflation * (set_.noise[j] * set_.noise[j] + changed(j));
    for (std::size_t b = 0; b < m_; ++b) {
      double sum = 0.0;
      for (int a = 0; a < payload_numbers; ++a) sum += covariance_[b * m_ + a] * row_[a];
      for (int a = 0; a < per_joint; ++a) sum += covariance_[b * m_ + first + a] * row_[first + a];
      gathered_[b] = sum;
    }
    double believed = 0.0;
    for (std::size_t b = 0; b < m_; ++b) believed += row_[b] * gathered_[b];
    double innovation = residual_[j] - expected(j);
    const double limit = set_.clip * std::sqrt(variance / set_.inflation + believed);
    variance += believed;
    if (std::fabs(innovation) > limit) innovation = limit * limit / innovation;
    for (std::size_t a = 0; a < m_; ++a) {
      const double k = gathered_[a] / variance;
      theta_[a] += k * innovation;
      for (std::size_t b = 0; b <= a; ++b) {
        covariance_[a * m_ + b] -= k * gathered_[b];
        covariance_[b * m_ + a] = covariance_[a * m_ + b];
      }
    }
  }

  Chain chain_;
  FrictionBasis basis_;
  EstimatorSettings set_;
  std::size_t n_, m_;
  Workspace work_;
  std::vector<double> memory_, column_;
  VelocityFusion fusion_;
  std::vector<double> theta_, covariance_, gathered_, row_;
  std::vector<double> p_, beta_, p_before_, beta_before_, tau_, tau_before_, residual_, decay_;
  std::vector<double> load_p_, load_beta_, load_p_before_, load_beta_before_, load_;
  std::vector<double> own_now_, own_before_, own_, smooth_, usual_;
  std::vector<double> plain_, plain_tau_, plain_tau_before_;
  Chain carrying_;  // the arm with the tracked payload
  std::vector<double> mass_, inertia_, change_, acceleration_, one_, moved_, unused_;
  double decay_dt_ = -1.0, smooth_decay_ = 0.0, plain_decay_ = 0.0, change_decay_ = 0.0;
  int since_ = 0;
  bool started_ = false, adapts_ = false;
};

}  // namespace tauguard::detectors
