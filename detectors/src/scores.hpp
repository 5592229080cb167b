// Streams of scores: one number per sample. The work is bounded, and nothing is allocated after
// construction.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "estimator.hpp"
#include "free_motion.hpp"
#include "kernel.hpp"

namespace tauguard::detectors {

class Scores {
 public:
  virtual ~Scores() = default;
  // A stream in the same state that steps by itself.
  virtual std::shared_ptr<Scores> clone() const = 0;
  virtual std::size_t joints() const = 0;
  virtual void reset() = 0;  // the next sample is the first
  // The score of a sample, `dt` s after the last one; n numbers each.
  virtual double step(const double* q, const double* qd, const double* current, double dt) = 0;
  // The score of the detector's thresholds on the residual, if it has any, at the same sample.
  virtual double floor() const { return -std::numeric_limits<double>::infinity(); }
  // An estimator that steps with each sample as given, or null.
  virtual const Estimator* estimator() const { return nullptr; }
};

// The largest of some numbers; NaN if one is NaN.
inline double largest(const double* x, std::size_t n) {
  double most = x[0];
  for (std::size_t k = 1; k < n; ++k)
    if (x[k] > most || std::isnan(x[k])) most = std::isnan(most) ? most : x[k];
  return most;
}

// The free-motion detector: the largest ratio of a joint's signal to its bound.
class FreeScores final : public Scores {
 public:
  explicit FreeScores(FreeMotion stream) : stream_(std::move(stream)) {}
  std::shared_ptr<Scores> clone() const override { return std::make_shared<FreeScores>(*this); }
  std::size_t joints() const override { return stream_.joints(); }
  void reset() override { stream_.reset(); }
  double step(const double* q, const double* qd, const double* current, double dt) override {
    stream_.step(q, qd, current, dt);
    return largest(stream_.ratio().data(), stream_.ratio().size());
  }

 private:
  FreeMotion stream_;
};

// The residual that the estimator does not explain, in units of its noise.
class ScaledResidual {
 public:
  ScaledResidual(Estimator estimator, Scaling scaling)
      : estimator_(std::move(estimator)),
        scaling_(std::move(scaling)),
        residual_(estimator_.joints()),
        unexplained_(residual_.size()),
        motion_(motion_rows * residual_.size()),
        row_(scaling_.columns()) {}

  const Estimator& estimator() const { return estimator_; }
  std::size_t joints() const { return estimator_.joints(); }
  std::size_t columns() const { return row_.size(); }
  void reset() { estimator_.reset(); }
  const double* step(const double* q, const double* qd, const double* current, double dt) {
    estimator_.step(q, qd, current, dt, residual_.data(), unexplained_.data(), motion_.data());
    scale(scaling_, qd, row_.data());
    return row_.data();
  }
  // The unexplained residual of the last step with another scaling.
  void scale(const Scaling& scaling, const double* qd, double* out) const {
    scaling.row(unexplained_.data(), qd, motion_.data(), joints(), out);
  }

 private:
  Estimator estimator_;
  Scaling scaling_;
  std::vector<double> residual_, unexplained_, motion_, row_;
};

// The largest ratio of |x| to its limit; `x` is overwritten.
inline double largest_ratio(std::vector<double>& x, const std::vector<double>& limits) {
  for (std::size_t k = 0; k < x.size(); ++k) x[k] = std::fabs(x[k]) / limits[k];
  return largest(x.data(), x.size());
}

// The largest ratio of scaled residual to limit.
class LimitScores final : public Scores {
 public:
  // `limits`: one per column of the residual.
  LimitScores(ScaledResidual residual, std::vector<double> limits)
      : residual_(std::move(residual)), limits_(std::move(limits)), ratio_(limits_.size()) {}

  std::shared_ptr<Scores> clone() const override { return std::make_shared<LimitScores>(*this); }
  std::size_t joints() const override { return residual_.joints(); }
  const Estimator* estimator() const override { return &residual_.estimator(); }
  void reset() override { residual_.reset(); }
  double step(const double* q, const double* qd, const double* current, double dt) override {
    const double* scaled = residual_.step(q, qd, current, dt);
    std::copy_n(scaled, ratio_.size(), ratio_.begin());
    return largest_ratio(ratio_, limits_);
  }

 private:
  ScaledResidual residual_;
  std::vector<double> limits_, ratio_;
};

// The severity x of a target x / (1 + x). Targets above 0.98 count as 0.98.
inline double severity(double target) {
  const double bounded = std::min(target, 0.98);
  return bounded / (1 - bounded);
}

// Thresholds on the residual with another scaling; none if `limits` is empty.
struct Floor {
  Scaling scaling;
  std::vector<double> limits;
};

// A kernel machine on windows of the scaled residual.
class KernelScores final : public Scores {
 public:
  // `window` has one column per column of the residual; the kernel takes the whole window. The
  // score of a graded machine is the severity.
  KernelScores(ScaledResidual residual, Window window, KernelSum kernel, bool graded, Floor floor)
      : residual_(std::move(residual)),
        window_(std::move(window)),
        kernel_(std::move(kernel)),
        graded_(graded),
        floor_(std::move(floor)),
        x_(window_.size()),
        ratio_(floor_.limits.size()) {}

  std::shared_ptr<Scores> clone() const override { return std::make_shared<KernelScores>(*this); }
  std::size_t joints() const override { return residual_.joints(); }
  const Estimator* estimator() const override { return &residual_.estimator(); }
  void reset() override {
    residual_.reset();
    window_.reset();
  }
  double step(const double* q, const double* qd, const double* current, double dt) override {
    window_.step(residual_.step(q, qd, current, dt), x_.data());
    const double output = kernel_.at(x_.data());
    if (!ratio_.empty()) {
      residual_.scale(floor_.scaling, qd, ratio_.data());
      plain_ = largest_ratio(ratio_, floor_.limits);
    }
    return graded_ ? severity(output) : output;
  }
  double floor() const override { return plain_; }

 private:
  ScaledResidual residual_;
  Window window_;
  KernelSum kernel_;
  bool graded_;
  Floor floor_;
  std::vector<double> x_, ratio_;
  double plain_ = -std::numeric_limits<double>::infinity();
};

}  // namespace tauguard::detectors
