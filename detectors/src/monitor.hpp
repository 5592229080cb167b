// The state free, collision or fault, from a detector and checks of its samples. A step allocates
// nothing, and its work is bounded: gaps are interpolated up to `span` [s], or up to `bridged`
// samples if that is more.
#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include "alarm.hpp"
#include "faults.hpp"
#include "torques.hpp"

namespace tauguard::detectors {

enum class State : int { free, collision, fault };

struct Thought {
  State state = State::free;
  bool alarm = false;  // during a fault: whether it was on when the fault began
  double score = 0;    // the last known score
  Verdict why;         // the current or the last fault
  bool settling = false;
};

struct MonitorSettings {
  double dt = 0;       // sample interval [s]
  double settle = 0;   // settling time of the detector [s]
  double span = 0;     // an alarm within this time before a fault is attributed to the fault [s]
  double window = 0;   // time after an interpolated gap in which no alarm starts [s]
  double bridged = 0;  // number of successive samples that are always interpolated
};

class Monitor {
 public:
  // `torques` checks the residual of `observer`; all are of one arm.
  Monitor(FaultCheck check, Alarm alarm, Estimator observer, TorqueCheck torques,
          MonitorSettings settings)
      : check_(std::move(check)),
        alarm_(std::move(alarm)),
        observer_(std::move(observer)),
        torques_(std::move(torques)),
        set_(settings),
        n_(observer_.joints()),
        last_(3 * n_),
        between_(3 * n_),
        out_((2 + motion_numbers) * n_) {
    if (estimator()) observer_.compare(*estimator());
  }

  std::size_t joints() const { return n_; }
  // The estimator of the detector; null if the detector has none.
  const Estimator* estimator() const { return alarm_.estimator(); }
  bool settled() const { return time_ >= ready_; }
  // A monitor in the same state that steps by itself.
  Monitor copy() const {
    Monitor out(*this);
    out.alarm_ = alarm_.copy();
    return out;
  }
  // The detector's estimator; null if the last sample had a fault and was therefore not used.
  const Estimator* fed() const { return bad_ ? nullptr : estimator(); }

  const Thought& step(double t, const double* q, const double* qd, const double* current) {
    const Verdict verdict = check_.step(t, q, qd, current);
    said_ = verdict.fault != Fault::none ? fault(verdict) : sound(t, q, qd, current);
    return said_;
  }

 private:
  Thought fault(const Verdict& verdict) {
    bad_ = true;
    reason_ = verdict;
    const bool held = said_.alarm && time_ - raised_ > set_.span;
    return {held ? State::collision : State::fault, held, said_.score, verdict, false};
  }

  Thought sound(double t, const double* q, const double* qd, const double* current) {
    const double missing = bridge(t, q, qd, current), passed = t - time_;
    const double ratio = passed / set_.dt;
    const bool usual = missing == 0 && 0.8 < ratio && ratio < 1.25;
    std::copy_n(q, n_, last_.data());
    std::copy_n(qd, n_, last_.data() + n_);
    std::copy_n(current, n_, last_.data() + 2 * n_);
    known_ = true;
    time_ = t;
    const bool up = alarm_.step(q, qd, current, usual ? passed : alarm_.dt());
    // When an alarm ends, the torque check starts again, so that the contact is not a fault.
    if (said_.alarm && !up) torques_.reset();
    const Verdict torques = judge_torques(q, qd, current, usual ? passed : set_.dt);
    if (t < ready_ && reason_.fault != Fault::none)
      return {said_.alarm ? State::collision : State::fault, said_.alarm, alarm_.score(), reason_,
              true};
    reason_ = Verdict{};
    raised_ = up ? std::min(raised_, t) : infinite;
    const State state = up                             ? State::collision
                        : torques.fault != Fault::none ? State::fault
                                                       : State::free;
    return {state, up, alarm_.score(), torques, false};
  }

  Verdict judge_torques(const double* q, const double* qd, const double* current, double dt) {
    observer_.step(q, qd, current, dt, out_.data(), out_.data() + n_, out_.data() + 2 * n_,
                   estimator());
    return torques_.step(out_.data(), current, dt);
  }

  // Interpolates the missing samples before this one and returns their number. If there are too
  // many, the detector is reset.
  double bridge(double t, const double* q, const double* qd, const double* current) {
    if (!known_) {
      ready_ = t + set_.settle;
      bad_ = false;
      return 0;
    }
    // Rounds half to even, as the batch form does.
    const double missing = std::max(0.0, std::nearbyint((t - time_) / set_.dt) - 1);
    if (t < time_ || missing > std::max(set_.bridged, set_.span / set_.dt)) {
      alarm_.reset();
      observer_.reset();
      torques_.reset();
      ready_ = t + set_.settle;
    } else {
      for (double k = 1; k <= missing; ++k) interpolate(k / (missing + 1), q, qd, current);
      if (bad_) ready_ = std::max(ready_, t + set_.window);
    }
    bad_ = false;
    return missing;
  }

  void interpolate(double fraction, const double* q, const double* qd, const double* current) {
    const double* now[3] = {q, qd, current};
    for (std::size_t part = 0; part < 3; ++part)
      for (std::size_t j = 0; j < n_; ++j) {
        const double before = last_[part * n_ + j];
        between_[part * n_ + j] = before + fraction * (now[part][j] - before);
      }
    const double *a = between_.data(), *b = a + n_, *c = b + n_;
    alarm_.step(a, b, c, alarm_.dt());
    judge_torques(a, b, c, set_.dt);
  }

  static constexpr double infinite = std::numeric_limits<double>::infinity();

  FaultCheck check_;
  Alarm alarm_;
  Estimator observer_;
  TorqueCheck torques_;
  MonitorSettings set_;
  std::size_t n_;
  std::vector<double> last_, between_, out_;
  bool known_ = false, bad_ = false;
  double time_ = -infinite, ready_ = -infinite, raised_ = infinite;
  Verdict reason_;
  Thought said_;
};

}  // namespace tauguard::detectors
