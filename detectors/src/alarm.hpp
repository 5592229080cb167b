// The alarm on a stream of scores. Scores are normalised by speed. The alarm is on while the score
// has exceeded the threshold for at least the confirmation time, and off until the detector has
// settled. Results are bit-equal to those of the batch form in Python.
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <vector>

#include "scores.hpp"

namespace tauguard::detectors {

// The sum of |x|, bit-equal to NumPy's for up to 128 numbers, because the order is the same.
inline double sum_of_sizes(const double* x, std::size_t n) {
  double sum = 0.0;
  std::size_t k = 0;
  if (n >= 8) {
    double part[8];
    for (; k < 8; ++k) part[k] = std::fabs(x[k]);
    for (; k + 8 <= n; k += 8)
      for (std::size_t i = 0; i < 8; ++i) part[i] += std::fabs(x[k + i]);
    sum = ((part[0] + part[1]) + (part[2] + part[3])) + ((part[4] + part[5]) + (part[6] + part[7]));
  }
  for (; k < n; ++k) sum += std::fabs(x[k]);
  return sum;
}

// The largest sum of |qd| within a sliding window of samples (a monotonic queue).
class RecentSpeed {
 public:
  explicit RecentSpeed(std::int64_t samples)
      : samples_(samples), kept_(static_cast<std::size_t>(samples)) {}

  void reset() { first_ = count_ = 0, at_ = 0; }

  double step(const double* qd, std::size_t n) {
    const double total = sum_of_sizes(qd, n);
    if (count_ > 0 && kept_[first_].at <= at_ - samples_) {
      first_ = (first_ + 1) % kept_.size();
      --count_;
    }
    while (count_ > 0 && kept_[place(count_ - 1)].total <= total) --count_;
    kept_[place(count_++)] = {at_++, total};
    return kept_[first_].total;
  }

 private:
  struct Candidate {
    std::int64_t at;
    double total;
  };
  std::size_t place(std::size_t k) const { return (first_ + k) % kept_.size(); }

  std::int64_t samples_, at_ = 0;
  std::size_t first_ = 0, count_ = 0;
  std::vector<Candidate> kept_;
};

// Speed normalisation at K increasing speeds; with K = 0 scores are not normalised.
struct Levels {
  std::vector<double> speed, base, unit;

  double normalised(double score, double now) const {
    return (score - at(now, base)) / at(now, unit);
  }

 private:
  // y at the speed `now`: linear between speeds, constant beyond, bit-equal to NumPy's interp.
  double at(double now, const std::vector<double>& y) const {
    const std::size_t last = speed.size() - 1;
    if (std::isnan(now)) return now;
    if (now < speed[0]) return y[0];
    if (now > speed[last]) return y[last];
    const auto after = std::upper_bound(speed.begin(), speed.end(), now);
    const std::size_t k = static_cast<std::size_t>(after - speed.begin()) - 1;
    if (k == last || speed[k] == now) return y[k];
    return (y[k + 1] - y[k]) / (speed[k + 1] - speed[k]) * (now - speed[k]) + y[k];
  }
};

struct AlarmSettings {
  double dt = 0;             // default sample interval [s]
  double settle = 0;         // least time before an alarm [s]
  double threshold = 0;      // of the normalised score
  std::int64_t samples = 1;  // successive samples above the threshold for an alarm
  std::int64_t memory = 1;   // window of the largest speed, in samples
  Levels levels;
  Levels floor;  // normalisation of the thresholds on the residual; K = 0: not used
};

class Alarm {
 public:
  Alarm(std::shared_ptr<Scores> scores, AlarmSettings settings)
      : scores_(std::move(scores)), set_(std::move(settings)), speed_(set_.memory) {}

  std::size_t joints() const { return scores_->joints(); }
  double dt() const { return set_.dt; }
  const Estimator* estimator() const { return scores_->estimator(); }
  double score() const { return score_; }
  // An alarm in the same state that steps by itself.
  Alarm copy() const {
    Alarm out(*this);
    out.scores_ = scores_->clone();
    return out;
  }

  void reset() {
    scores_->reset();
    speed_.reset();
    run_ = 0, time_ = -1.0, score_ = 0.0;
  }

  // Whether the alarm is on at this sample, `dt` s after the last one.
  bool step(const double* q, const double* qd, const double* current, double dt) {
    double score = scores_->step(q, qd, current, dt);
    const bool floored = !set_.floor.speed.empty();
    const double plain = floored ? scores_->floor() : 0.0;
    if (!std::isfinite(score) || !std::isfinite(plain))
      throw std::invalid_argument(
          "the score is not a number, because a sample was beyond any arm's range; start a new "
          "stream and leave it out");
    time_ = time_ < 0 ? 0.0 : time_ + dt;
    if (!set_.levels.speed.empty()) {
      const double now = speed_.step(qd, joints());
      score = set_.levels.normalised(score, now);
      if (floored) score = std::max(score, set_.floor.normalised(plain, now));
    }
    score_ = score;
    run_ = score > set_.threshold && time_ > set_.settle ? run_ + 1 : 0;
    return run_ >= set_.samples;
  }

 private:
  std::shared_ptr<Scores> scores_;
  AlarmSettings set_;
  RecentSpeed speed_;
  std::int64_t run_ = 0;
  double time_ = -1.0, score_ = 0.0;
};

}  // namespace tauguard::detectors
