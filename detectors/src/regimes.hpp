// The regime of each joint of a real arm (at rest, starting, in motion, in a contact), and for each
// regime the signal that is judged and its largest value without a contact, the bound. The ratio of
// a joint is the magnitude of its signal divided by its bound.
//
// At rest, static friction can hold any torque. The signal is therefore the residual minus a
// baseline that follows the residual. Motion of one joint changes the torques of the joints at
// rest, by the integral action of their controllers and by changing loads. Motion therefore raises
// the bound at rest, fully from `full_speed` on. This addition decays within about a second.
//
// A contact with a standing arm begins when a ratio above 1 of a joint at rest is confirmed. Until
// the contact is released, the signal of all joints that stood is the residual minus its level
// before the contact. The contact is released when the ratio of the joint with the largest ratio
// falls below half of that largest ratio. It is also released when nothing has changed for a second
// and the remaining signal is within what static friction can keep. For a second after the release
// only a change away from the former level counts, so that the release is not a new contact. Joints
// that the contact turned get a higher bound, because their controllers act.
//
// While the signal at rest is above half of its bound, the baseline follows more slowly, so that a
// push that grows slowly is found. During a contact, soon after it, and while a joint moves, the
// baseline follows at its normal rate; in a contact it helps to detect the release.
//
// In motion the signal is the residual without slow errors. The bound is linear in speed,
// accelerations and exp(-speed / `creep`), which covers the change from static to sliding friction.
// A joint that starts gets a higher bound. So does a joint that is faster, or accelerates more,
// than in the training logs, because friction and inertia are extrapolated there. The parts due to
// acceleration decay with the time constant of the observer, as the errors that they cover do.
//
// A joint that moves in no training log has `low` and `high`, the positions at which it stood.
// While it moves, and soon after, nothing is judged. While it stands elsewhere, moving joints are
// not judged.
//
// A ratio above 1 is reported as 1 until it is confirmed by its duration. In motion and soon after
// it, the required duration is longer, because ripple and jerks exceed a bound for longer than
// noise at rest. Time at a ratio of 3 or more counts twice, and time at ratios from 2 to 3 counts
// between once and twice, so that an impact of some tens of ms is confirmed. A gap between samples
// counts as one sample.
//
// A robot's protective stop ends a contact within 30 to 80 ms, before the duration is reached. So
// if the arm brakes to standstill at once, a joint is confirmed whose signal was near its bound for
// three samples before the arm began to brake. Later signals may be due to the braking.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "estimator.hpp"

namespace tauguard::detectors {

struct RegimeBounds {
  static constexpr std::size_t terms = 5;  // number of terms of the bound in motion
  std::vector<double> rest;        // bound of a joint that has been at rest for long [N m], n
  std::vector<double> stop;        // added by present or recent motion of any joint [N m], n
  std::vector<double> least;       // least bound in motion [N m], n
  std::vector<double> moving;      // factors of 1, |qd|, |qdd|, largest |qdd|, exp(-|qd| / creep)
  std::vector<double> start;       // added at a start [N m], n
  std::vector<double> turned;      // added after a contact has turned the joint [N m], n
  std::vector<double> fast, hard;  // largest speed, acceleration in logs [rad/s, rad/s^2], n
  std::vector<double> beyond;      // added at 2 `fast`; grows linearly from 0 at `fast` [N m], n
  std::vector<double> low, high;   // positions in logs of joints that move in no log [rad], n
  static constexpr double anywhere = 1e6;  // `high` of joints that move in some log [rad]
};

class Regimes {
 public:
  static constexpr double wait = 0.1;   // a joint that has been slow for this time is at rest [s]
  static constexpr double gives = 0.2;  // time for which a standing arm yields to a push [s]
  static constexpr double full_speed = 0.1;  // speed from which `stop` counts fully [rad/s]
  static constexpr double settling = 0.3;    // of the observer at the beginning [s]
  static constexpr double creep = 0.05;      // speed at which exp(-speed / creep) is 1/e [rad/s]
  static constexpr double settles = 1.0;     // time constant with which motion is forgotten [s]
  static constexpr double follow = 0.15;     // time constant of the baseline [s]
  static constexpr double slowed = 0.5;      // fraction of the bound above which `slower` applies
  static constexpr double slower = 2.0;      // factor of `follow` while no joint moves
  static constexpr double ended = 5.0;       // time after a contact without `slower` [s]: the
                                             // controllers move torque between joints for seconds
  static constexpr double after = 1.0;       // time after it in which only change away counts [s]
  static constexpr double starts = 0.15;     // time constant with which a start is forgotten [s]
  static constexpr double harder = 0.5;      // fraction of `beyond` that is added at 2 `hard`
  static constexpr double lag = 1.0 / 30.0;  // time constant of the observer [s]
  static constexpr double farthest = 3.0;    // largest addition, in units of `beyond`
  static constexpr double released = 0.5;    // a contact ends below this fraction of its peak
  static constexpr double kept = 1.0;        // time without a change that can end a contact [s]
  static constexpr double remembers = 10.0;  // replaces `after` after such an end [s]
  static constexpr double lasts_at_rest = 0.024, lasts_moving = 0.04;  // confirmation times [s]
  static constexpr double forget = 1.05;  // growth of the stored shortest interval per sample
  static constexpr int samples = 3;       // least number of samples of the confirmation
  static constexpr double near = 0.8;     // ratio from which a protective stop confirms a joint
  static constexpr double recent = 0.25;  // longest time from such a ratio to the stop [s]
  static constexpr double brakes = 0.2;   // time constant with which a speed is forgotten [s]
  static constexpr double braking = 0.9, stopped = 0.2;  // fractions of the recent speed

  explicit Regimes(RegimeBounds bounds) : of_(std::move(bounds)), joints_(of_.rest.size()) {
    reset();
  }

  void reset() {
    std::fill(joints_.begin(), joints_.end(), Joint{});
    touched_ = false;
    peak_ = still_ = 0.0;
    fastest_ = before_ = 0.0;
    near_for_ = recent;
    stirred_ = usual_ = 1.0;
    age_ = unknown_for_ = 0.0;
    elsewhere_ = moving_ = false;
  }

  bool rest(std::size_t j) const { return joints_[j].rest; }
  // Accelerations in the bound [rad/s^2]: joint j's own and the largest; 0 at rest.
  double shaken(std::size_t j) const { return joints_[j].shaken; }
  double around(std::size_t j) const { return joints_[j].around; }

  // Whether joint j is the reason why joints are not judged: it moves (or did soon before), or it
  // stands elsewhere while joints move, and no log shows its motion.
  enum Hides { nothing = 0, by_motion = 1, by_place = 2 };
  Hides hides(std::size_t j) const {
    if (unknown_for_ > 0.0) return joints_[j].unknown_for > 0.0 ? by_motion : nothing;
    return joints_[j].away && moving_ ? by_place : nothing;
  }

  // Positions [rad] and speeds [rad/s], `dt` s after the last; goes before judge().
  void motion(const double* q, const double* qd, double dt) {
    double fastest = 0.0;
    elsewhere_ = false;
    unknown_for_ = 0.0;
    const double keep = std::exp(-dt / settles), own = std::exp(-dt / after);
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      Joint& one = joints_[j];
      const double speed = std::fabs(qd[j]);
      const bool pushed = one.rest && touched_;
      one.quick_for = speed < slow ? 0.0 : one.quick_for + dt;
      const bool unknown = of_.high[j] < RegimeBounds::anywhere;
      const bool away = unknown && (q[j] < of_.low[j] || q[j] > of_.high[j]);
      const bool yields =
          speed < full_speed && ((unknown && !away) || (pushed && one.quick_for < gives));
      const bool stands = speed < slow || yields;
      if (!pushed) fastest = std::max(fastest, speed);
      one.slow_for = stands ? one.slow_for + dt : 0.0;
      one.moved = stands ? 0.0 : one.moved + dt;
      one.own *= own;
      one.unknown_for = std::max(0.0, (unknown && !stands ? settles : one.unknown_for) - dt);
      one.away = away;
      unknown_for_ = std::max(unknown_for_, one.unknown_for);
      elsewhere_ = elsewhere_ || away;
    }
    fastest_ = fastest;
    before_ = std::max(fastest, before_ * std::exp(-dt / brakes));
    near_for_ += dt;
    stirred_ = std::max(keep * stirred_, std::min(1.0, fastest / full_speed));
    usual_ = std::min(dt, forget * usual_);
    age_ += dt;
  }

  // Writes ratios of signals to bounds, at most 1 until confirmed, and the bounds [N m]. Inputs, n
  // each [N m]: `residual` of the observer, `left` without the estimated errors of the model,
  // `spread` the standard deviation due to their uncertainty.
  void judge(const double* residual, const double* left, const double* spread, const double* qd,
             const double* qdd, double dt, double* ratio, double* bound) {
    double hardest = 0.0;
    for (std::size_t j = 0; j < joints_.size(); ++j) hardest = std::max(hardest, std::fabs(qdd[j]));
    bool begins = false;
    moving_ = false;
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      Joint& one = joints_[j];
      const bool was = one.rest;
      one.since += dt;
      one.rest = one.slow_for >= wait;
      moving_ = moving_ || !one.rest;
      one.held = one.held && one.rest;
      double signal = left[j];
      if (one.rest) {
        if (!was || age_ < settling) one.base = one.before = residual[j];
        one.shaken = one.around = one.hard = 0.0;
        bound[j] = of_.rest[j] + std::max(of_.stop[j] * stirred_, of_.turned[j] * one.own);
        signal = changed(one, residual[j], bound[j], dt);
      } else {
        bound[j] = moving(j, qd[j], qdd[j], hardest, dt) + spread[j];
      }
      const bool judged = unknown_for_ <= 0.0 && (one.rest || !elsewhere_);
      ratio[j] = judged ? std::fabs(signal) / bound[j] : 0.0;
      approach(j, ratio[j]);
      ratio[j] = confirmed(one, ratio[j], dt);
      if (one.rest && !one.held && ratio[j] > 1.0) begins = true;
    }
    if (unknown_for_ > 0.0) {
      touched_ = false;
      for (Joint& one : joints_) one.held = false;
      std::fill(ratio, ratio + joints_.size(), 0.0);
      return;
    }
    if (begins) begin(bound);
    if (touched_) hold(residual, dt, ratio, bound);
    const bool stops = before_ > full_speed && fastest_ < stopped * before_;
    if (stops && near_for_ < recent && !joints_[nearest_].rest)
      ratio[nearest_] = std::max(ratio[nearest_], std::nextafter(1.0, 2.0));
  }

 private:
  struct Joint {
    // Time at rest or yielding, time above the speed `slow`, and time in motion until now [s].
    double slow_for = 10.0, quick_for = 0.0, moved = 0.0;
    double base = 0.0, before = 0.0;    // baseline of the residual, and a slower baseline [N m]
    double home = 0.0;                  // `before` at the beginning of a contact [N m]
    double most = 0.0;                  // largest change from `home` in the contact [N m]
    double bound = 1.0;                 // bound at the beginning of the contact [N m]
    double since = after;               // time since the end of a contact [s]
    double own = 0.0;                   // fraction of `turned` that is added to the bound
    double above = 0.0;                 // weighted time above the bound [s]
    int count = 0;                      // number of successive samples above the bound
    double shaken = 0.0, around = 0.0;  // accelerations that decay: own, largest [rad/s^2]
    double hard = 0.0;                  // part of the bound due to acceleration beyond the logs
    int close = 0;                      // successive samples in motion above `near` times the bound
    double unknown_for = 0.0;           // remaining time of motion that no log shows [s]
    bool rest = false, held = false;    // held: takes part in a contact
    bool away = false;                  // stands where no log shows it
  };

  double moving(std::size_t j, double qd, double qdd, double hardest, double dt) {
    const double* per = &of_.moving[RegimeBounds::terms * j];
    Joint& one = joints_[j];
    const double speed = std::fabs(qd), keep = std::exp(-dt / lag);
    one.shaken = std::max(std::fabs(qdd), keep * one.shaken);
    one.around = std::max(hardest, keep * one.around);
    one.hard = std::max(harder * (std::fabs(qdd) / of_.hard[j] - 1.0), keep * one.hard);
    const double linear = per[0] + per[1] * speed + per[2] * one.shaken + per[3] * one.around +
                          per[4] * std::exp(-speed / creep);
    const double more = std::max(speed / of_.fast[j] - 1.0, 0.0) + one.hard;
    return std::max(linear, of_.least[j]) + of_.start[j] * std::exp(-one.moved / starts) +
           of_.beyond[j] * std::min(more, farthest);
  }

  // Remembers a joint in motion that is near its bound before the arm brakes.
  void approach(std::size_t j, double ratio) {
    Joint& one = joints_[j];
    one.close = !one.rest && ratio > near ? one.close + 1 : 0;
    if (one.close < samples || fastest_ < braking * before_) return;
    if (near_for_ == 0.0 && ratio < nearest_ratio_) return;  // another joint in this sample
    near_for_ = 0.0;
    nearest_ = j;
    nearest_ratio_ = ratio;
  }

  double confirmed(Joint& one, double ratio, double dt) const {
    if (ratio <= 1.0 && one.above > 0.0 && one.rest) one.own = 1.0;
    one.above =
        ratio > 1.0 ? one.above + std::clamp(ratio - 1.0, 1.0, 2.0) * std::min(dt, usual_) : 0.0;
    one.count = ratio > 1.0 ? one.count + 1 : 0;
    const double stirred = one.rest ? stirred_ : 1.0;
    const double needs = lasts_at_rest + stirred * (lasts_moving - lasts_at_rest);
    const bool lasted = one.count >= samples && one.above > needs - 0.5 * usual_;
    return lasted ? ratio : std::min(ratio, 1.0);
  }

  // The signal of a standing joint. Soon after a contact, a change back to the former level is 0.
  double changed(Joint& one, double residual, double bound, double dt) const {
    const double side = one.most;
    if (one.since < after && (residual - one.base) * side < 0.0 &&
        (residual - one.home) * side > 0.0)
      one.base = one.before = residual;
    const double change = residual - one.base;
    const bool grows = !touched_ && one.since >= ended && std::fabs(change) > slowed * bound;
    const double factor = grows ? 1.0 + (slower - 1.0) * (1.0 - stirred_) : 1.0;
    const double keep = std::exp(-dt / (factor * follow));
    one.base = residual - change * keep;
    one.before = one.base + (one.before - one.base) * keep;
    return change;
  }

  // Begins a contact, or adds a joint to it.
  void begin(const double* bound) {
    if (!touched_) peak_ = still_ = 0.0;
    touched_ = true;
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      Joint& one = joints_[j];
      if (!one.rest || one.held) continue;
      one.held = true;
      one.home = one.before;
      one.bound = bound[j];
      one.most = 0.0;
    }
  }

  void hold(const double* residual, double dt, double* ratio, double* bound) {
    bool still = true;
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      Joint& one = joints_[j];
      if (!one.held) continue;
      const double change = residual[j] - one.home, now = std::fabs(change) / one.bound;
      if (std::fabs(change) > std::fabs(one.most)) one.most = change;
      bound[j] = one.bound;
      ratio[j] = std::min(now, 1.0);
      if (now > peak_) {
        peak_ = now;
        lead_ = j;
      }
      still = still && std::fabs(residual[j] - one.base) < 0.5 * of_.rest[j] &&
              std::fabs(change) < 2.0 * of_.turned[j];
    }
    still_ = still ? still_ + dt : 0.0;
    const Joint& lead = joints_[lead_];
    const double now = std::fabs(residual[lead_] - lead.home) / lead.bound;
    if (!lead.held || now < released * peak_ || still_ > kept)
      end(residual, ratio);
    else
      ratio[lead_] = std::max(now, std::nextafter(1.0, 2.0));
  }

  void end(const double* residual, double* ratio) {
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      Joint& one = joints_[j];
      if (!one.held) continue;
      one.held = false;
      one.base = one.before = residual[j];
      one.since = still_ > kept ? after - remembers : 0.0;
      if (std::fabs(one.most) > released * one.bound) one.own = 1.0;
      one.above = 0.0;
      one.count = 0;
      ratio[j] = 0.0;
    }
    touched_ = false;
  }

  RegimeBounds of_;
  std::vector<Joint> joints_;
  bool touched_ = false;                 // whether there is a contact with joints at rest
  std::size_t lead_ = 0;                 // joint with the largest ratio in the contact
  double peak_ = 0.0, still_ = 0.0;      // its ratio; time without a change [s]
  double fastest_ = 0.0, before_ = 0.0;  // speed of the fastest joint, now and recently [rad/s]
  double near_for_ = recent;             // time since a joint in motion was near its bound [s]
  std::size_t nearest_ = 0;              // the joint that was nearest to its bound
  double nearest_ratio_ = 0.0;           // its ratio
  double stirred_ = 1.0, usual_ = 1.0;  // recent motion in [0, 1]; sample interval without gaps [s]
  double age_ = 0.0;                    // time since the first sample [s]
  double unknown_for_ = 0.0;            // remaining time in which nothing is judged [s]
  bool elsewhere_ = false;              // a joint stands where no log shows it
  bool moving_ = false;                 // a joint is not at rest
};

}  // namespace tauguard::detectors
