// What each joint of a real arm does, what counts of its residual, and how large that may be
// without a contact.
//
// At rest static friction may hold any torque, so only a change counts: the residual less a
// baseline that follows it. Motion of any joint stirs the torques of all that stand: integral
// action of the controllers, changing loads. That adds to the bound, fully from `full_speed` on,
// and is forgotten within about a second. A contact stirs the joint that it turned, too: when its
// excess ends, what that joint does next may be its controller. For a second after an excess only a
// change away from what was before counts, so that letting go is no new push. Other joints go on as
// before.
//
// In motion the residual without slow errors counts. The bound is linear in speed and
// accelerations; while a joint starts, its friction is between static and sliding, and more is
// allowed.
//
// A ratio above 1 counts as 1 until it has lasted: in motion and soon after it ripple and jerks
// pass a bound for longer than noise does at rest. A gap between samples confirms no more than a
// sample.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "estimator.hpp"

namespace tauguard::detectors {

struct RegimeBounds {
  std::vector<double> rest;    // of a joint that has long been at rest [N m], n
  std::vector<double> stop;    // what motion of any joint adds to it [N m], n
  std::vector<double> least;   // in motion at least [N m], n
  std::vector<double> moving;  // per 1, |qd_j|, |qdd_j|, largest |qdd|, n x 4
  std::vector<double> start;   // what a start adds [N m], n
};

class Regimes {
 public:
  static constexpr double wait = 0.1;        // a joint that is slow for so long [s] is at rest
  static constexpr double full_speed = 0.1;  // motion from which `stop` counts fully [rad/s]
  static constexpr double settles = 1.0;     // time constant with which that is forgotten [s]
  static constexpr double follow = 0.15;     // time constant of the baseline [s]
  static constexpr double after = 1.0;       // change away only, for so long after an excess [s]
  static constexpr double starts = 0.15;     // time constant with which a start is forgotten [s]
  static constexpr double contact = 0.5;     // of `stop` that an excess leaves on its own joint
  static constexpr double lasts_at_rest = 0.024, lasts_moving = 0.04;  // confirmation [s] ...
  static constexpr double forget = 1.05;  // rate at which the shortest interval is forgotten
  static constexpr int samples = 3;       // ... and in samples at least

  explicit Regimes(RegimeBounds bounds) : of_(std::move(bounds)), n_(of_.rest.size()) { reset(); }

  void reset() {
    slow_for_.assign(n_, 10.0);
    base_.assign(n_, 0.0);
    before_.assign(n_, 0.0);
    rest_.assign(n_, 0);
    since_.assign(n_, after);
    own_.assign(n_, 0.0);
    above_.assign(n_, 0.0);
    count_.assign(n_, 0);
    stirred_ = usual_ = 1.0;
  }

  bool rest(std::size_t j) const { return rest_[j]; }

  // Speeds [rad/s], `dt` s after the last; goes before judge().
  void motion(const double* qd, double dt) {
    double fastest = 0.0;
    for (std::size_t j = 0; j < n_; ++j) {
      const double speed = std::fabs(qd[j]);
      fastest = std::max(fastest, speed);
      slow_for_[j] = speed < slow ? slow_for_[j] + dt : 0.0;
    }
    const double keep = std::exp(-dt / settles);
    stirred_ = std::max(keep * stirred_, std::min(1.0, fastest / full_speed));
    for (double& x : own_) x *= keep;
    usual_ = std::min(dt, forget * usual_);
  }

  // Ratios of what counts to its bound, at most 1 until confirmed, and the bounds [N m]. `residual`
  // is the observer's, `left` it less slow errors, `spread` the deviation that they leave, all
  // [N m]; `moved` is the time for which each joint has been in motion [s]; n numbers each.
  void judge(const double* residual, const double* left, const double* spread, const double* moved,
             const double* qd, const double* qdd, double dt, double* ratio, double* bound) {
    double hardest = 0.0;
    for (std::size_t j = 0; j < n_; ++j) hardest = std::max(hardest, std::fabs(qdd[j]));
    for (std::size_t j = 0; j < n_; ++j) {
      const bool was = rest_[j];
      since_[j] += dt;
      rest_[j] = slow_for_[j] >= wait;
      double signal = left[j];
      if (rest_[j]) {
        signal = changed(j, residual[j], !was, dt);
        bound[j] = of_.rest[j] + of_.stop[j] * std::max(stirred_, own_[j]);
      } else {
        const double* per = &of_.moving[4 * j];
        const double linear =
            per[0] + per[1] * std::fabs(qd[j]) + per[2] * std::fabs(qdd[j]) + per[3] * hardest;
        bound[j] = std::max(linear, of_.least[j]) + spread[j] +
                   of_.start[j] * std::exp(-moved[j] / starts);
      }
      ratio[j] = confirmed(j, std::fabs(signal) / bound[j], dt);
    }
  }

 private:
  double confirmed(std::size_t j, double ratio, double dt) {
    if (ratio > 1.0) {
      since_[j] = 0.0;
      above_[j] += std::min(dt, usual_);
      ++count_[j];
    } else {
      if (above_[j] > 0.0 && rest_[j]) own_[j] = contact;
      above_[j] = 0.0;
      count_[j] = 0;
    }
    const double stirred = rest_[j] ? stirred_ : 1.0;
    const double needs = lasts_at_rest + stirred * (lasts_moving - lasts_at_rest);
    const bool lasted = count_[j] >= samples && above_[j] > needs - 0.5 * usual_;
    return lasted ? ratio : std::min(ratio, 1.0);
  }

  double changed(std::size_t j, double residual, bool begins, double dt) {
    if (begins) base_[j] = before_[j] = residual;
    if (since_[j] >= after) before_[j] = base_[j];
    const double change = residual - base_[j];
    const bool back = change * (base_[j] - before_[j]) < 0.0;
    base_[j] = residual - change * std::exp(-dt / follow);
    return since_[j] < after && back ? 0.0 : change;
  }

  RegimeBounds of_;
  std::size_t n_;
  std::vector<double> slow_for_, base_, before_, since_, own_, above_;
  std::vector<int> count_;
  std::vector<char> rest_;
  double stirred_ = 1.0, usual_ = 1.0;  // interval of samples, gaps aside [s]
};

}  // namespace tauguard::detectors
