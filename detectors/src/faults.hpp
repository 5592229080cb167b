// Faults of a stream of samples that are found without a model of the arm.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace tauguard::detectors {

enum class Fault : std::int32_t {
  none,
  position_not_finite,
  velocity_not_finite,
  current_not_finite,
  time_not_finite,
  time_stands_still,
  time_goes_back,
  gap,
  rate,
  velocity_absurd,
  current_absurd,
  frozen,
  position_against_velocity,
  current_stuck,
  torque_opposed,
  torque_size,
};

// Usual values of one arm's samples; all arrays have one entry per joint.
struct Usual {
  double dt = 0;         // sample interval [s]
  double longest = 0;    // longest interval that is not a gap [s]
  std::int64_t odd = 0;  // allowed number of successive intervals that differ from dt by a quarter
  double speed = 0;      // highest speed of any joint [rad/s]
  std::int64_t repeats = 0;     // allowed number of successive samples without any change
  std::int64_t window = 0;      // samples over which velocities are summed
  std::vector<double> current;  // largest |current| [A]
  double fraction = 0;          // allowed |dq - sum qd dt| of a window, relative to |sum qd dt|
  double step_fraction = 0;     // allowed |dq - qd dt| of one sample, relative to |qd dt|
  std::vector<double> step;     // allowed in addition to `step_fraction` [rad]
  std::vector<double> drift;    // allowed in addition to `fraction` [rad]
  std::vector<std::int64_t>
      stuck;  // allowed number of successive samples without a change of the current
};

struct Verdict {
  Fault fault = Fault::none;
  std::int32_t joint = -1;  // 0-based, -1 for the sample as a whole
  double value = 0;         // value that is at fault; the unit depends on the fault
};

// Checks one sample after another. The work is bounded, and nothing is allocated after
// construction.
class FaultCheck {
 public:
  explicit FaultCheck(Usual usual)
      : usual_(std::move(usual)),
        n_(usual_.current.size()),
        last_(3 * n_),
        errors_(static_cast<std::size_t>(usual_.window) * n_),
        travels_(errors_.size()),
        bends_(errors_.size()),
        sums_(n_),
        travelled_(n_),
        bent_(n_),
        unchanged_(n_) {}

  std::size_t joints() const { return n_; }

  void reset() {
    begun_ = false;
    repeats_ = filled_ = odd_ = 0;
    for (auto* v : {&errors_, &travels_, &bends_, &sums_, &travelled_, &bent_})
      std::fill(v->begin(), v->end(), 0.0);
    std::fill(unchanged_.begin(), unchanged_.end(), 0);
  }

  Verdict step(double t, const double* q, const double* qd, const double* current) {
    if (const Verdict bad = values(t, q, qd, current); bad.fault != Fault::none) return bad;
    if (!begun_) {
      remember(t, q, qd, current);
      begun_ = true;
      return {};
    }
    const double dt = t - time_;
    if (dt < 0) {
      // A packet came late or the clock was reset: earlier samples are not used any more.
      reset();
      remember(t, q, qd, current);
      begun_ = true;
      return {Fault::time_goes_back, -1, dt};
    }
    if (dt == 0) return {Fault::time_stands_still, -1, 0};
    const Verdict found = differences(dt, q, qd, current);
    remember(t, q, qd, current);
    return found;
  }

 private:
  // Faults of a single sample.
  Verdict values(double t, const double* q, const double* qd, const double* current) const {
    if (!std::isfinite(t)) return {Fault::time_not_finite, -1, t};
    for (std::size_t j = 0; j < n_; ++j) {
      const auto joint = static_cast<std::int32_t>(j);
      if (!std::isfinite(q[j])) return {Fault::position_not_finite, joint, q[j]};
      if (!std::isfinite(qd[j])) return {Fault::velocity_not_finite, joint, qd[j]};
      if (!std::isfinite(current[j])) return {Fault::current_not_finite, joint, current[j]};
      if (std::fabs(qd[j]) > usual_.speed) return {Fault::velocity_absurd, joint, qd[j]};
      if (std::fabs(current[j]) > usual_.current[j])
        return {Fault::current_absurd, joint, current[j]};
    }
    return {};
  }

  // Faults in comparison with earlier samples.
  Verdict differences(double dt, const double* q, const double* qd, const double* current) {
    Verdict found;
    const auto say = [&](Fault fault, std::int32_t joint, double value) {
      if (found.fault == Fault::none) found = {fault, joint, value};
    };
    if (dt > usual_.longest) {
      // Sums over a gap mean nothing, so they start again.
      reset();
      begun_ = true;
      return {Fault::gap, -1, dt};
    }
    // Many successive intervals unlike those in training: the sample rate is wrong.
    const double ratio = dt / usual_.dt, late = std::fabs(dt - usual_.dt);
    odd_ = ratio > 0.8 && ratio < 1.25 ? 0 : odd_ + 1;
    if (odd_ > usual_.odd) say(Fault::rate, -1, dt);
    const double* lq = last_.data();
    const double* lqd = lq + n_;
    const double* lc = lqd + n_;
    const bool same = std::equal(q, q + n_, lq) && std::equal(qd, qd + n_, lqd) &&
                      std::equal(current, current + n_, lc);
    repeats_ = same ? repeats_ + 1 : 0;
    if (repeats_ > usual_.repeats) say(Fault::frozen, -1, static_cast<double>(repeats_));
    const std::size_t row = static_cast<std::size_t>(filled_ % usual_.window) * n_;
    for (std::size_t j = 0; j < n_; ++j) {
      const auto joint = static_cast<std::int32_t>(j);
      const double travel = dt * (qd[j] + lqd[j]) / 2, error = q[j] - lq[j] - travel;
      // Difference due to a velocity or a time stamp that is one sample late.
      const double bend =
          usual_.dt * std::fabs(qd[j] - lqd[j]) + std::min(late, usual_.dt) * std::fabs(qd[j]);
      sums_[j] += error - errors_[row + j];
      travelled_[j] += travel - travels_[row + j];
      bent_[j] += bend - bends_[row + j];
      errors_[row + j] = error;
      travels_[row + j] = travel;
      bends_[row + j] = bend;
      if (std::fabs(error) > usual_.step[j] + usual_.step_fraction * std::fabs(travel) + bend)
        say(Fault::position_against_velocity, joint, error);
      if (std::fabs(sums_[j]) >
          usual_.drift[j] + usual_.fraction * std::fabs(travelled_[j]) + bent_[j])
        say(Fault::position_against_velocity, joint, sums_[j]);
      unchanged_[j] = current[j] == lc[j] ? unchanged_[j] + 1 : 0;
      if (unchanged_[j] > usual_.stuck[j]) say(Fault::current_stuck, joint, current[j]);
    }
    // Rounding errors accumulate in running sums, so they are computed anew once per window.
    if (++filled_ % usual_.window == 0) sum_anew();
    return found;
  }

  void sum_anew() {
    for (std::size_t j = 0; j < n_; ++j) {
      sums_[j] = travelled_[j] = bent_[j] = 0;
      for (std::size_t k = j; k < errors_.size(); k += n_) {
        sums_[j] += errors_[k];
        travelled_[j] += travels_[k];
        bent_[j] += bends_[k];
      }
    }
  }

  void remember(double t, const double* q, const double* qd, const double* current) {
    time_ = t;
    std::copy(q, q + n_, last_.begin());
    std::copy(qd, qd + n_, last_.begin() + static_cast<std::ptrdiff_t>(n_));
    std::copy(current, current + n_, last_.begin() + static_cast<std::ptrdiff_t>(2 * n_));
  }

  Usual usual_;
  std::size_t n_;
  bool begun_ = false;
  double time_ = 0;
  std::int64_t repeats_ = 0, filled_ = 0, odd_ = 0;
  std::vector<double> last_, errors_, travels_, bends_, sums_, travelled_, bent_;
  std::vector<std::int64_t> unchanged_;
};

}  // namespace tauguard::detectors
