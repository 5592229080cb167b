// Streams of scores: one number a sample, bounded work, nothing allocated after construction.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "estimator.hpp"
#include "free_motion.hpp"
#include "kernel.hpp"

namespace tauguard::detectors {

class Scores {
 public:
  virtual ~Scores() = default;
  virtual std::size_t joints() const = 0;
  virtual void reset() = 0;  // the next sample is the first
  // The score of a sample, `dt` s after the last; n numbers each.
  virtual double step(const double* q, const double* qd, const double* current, double dt) = 0;
};

// The largest of some numbers; NaN where one is.
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
  std::size_t joints() const override { return stream_.joints(); }
  void reset() override { stream_.reset(); }
  double step(const double* q, const double* qd, const double* current, double dt) override {
    stream_.step(q, qd, current, dt);
    return largest(stream_.ratio().data(), stream_.ratio().size());
  }

 private:
  FreeMotion stream_;
};

// What the estimator cannot explain, in units of its noise.
class ScaledResidual {
 public:
  ScaledResidual(Estimator estimator, Scaling scaling)
      : estimator_(std::move(estimator)),
        scaling_(std::move(scaling)),
        residual_(estimator_.joints()),
        unexplained_(residual_.size()),
        motion_(motion_rows * residual_.size()),
        row_(scaling_.columns()) {}

  std::size_t joints() const { return estimator_.joints(); }
  std::size_t columns() const { return row_.size(); }
  void reset() { estimator_.reset(); }
  const double* step(const double* q, const double* qd, const double* current, double dt) {
    estimator_.step(q, qd, current, dt, residual_.data(), unexplained_.data(), motion_.data());
    scaling_.row(unexplained_.data(), qd, motion_.data(), joints(), row_.data());
    return row_.data();
  }

 private:
  Estimator estimator_;
  Scaling scaling_;
  std::vector<double> residual_, unexplained_, motion_, row_;
};

// The largest ratio of scaled residual to limit.
class LimitScores final : public Scores {
 public:
  // `limits`: one a column of the residual.
  LimitScores(ScaledResidual residual, std::vector<double> limits)
      : residual_(std::move(residual)), limits_(std::move(limits)), ratio_(limits_.size()) {}

  std::size_t joints() const override { return residual_.joints(); }
  void reset() override { residual_.reset(); }
  double step(const double* q, const double* qd, const double* current, double dt) override {
    const double* scaled = residual_.step(q, qd, current, dt);
    for (std::size_t k = 0; k < ratio_.size(); ++k) ratio_[k] = std::fabs(scaled[k]) / limits_[k];
    return largest(ratio_.data(), ratio_.size());
  }

 private:
  ScaledResidual residual_;
  std::vector<double> limits_, ratio_;
};

// A severity x of a target x / (1 + x); no target counts more than 0.98.
inline double severity(double target) {
  const double bounded = std::min(target, 0.98);
  return bounded / (1 - bounded);
}

// A kernel machine on windows of the scaled residual.
class KernelScores final : public Scores {
 public:
  // The window has a column a column of the residual, the kernel the window's size. Of a graded
  // machine the score is the severity.
  KernelScores(ScaledResidual residual, Window window, KernelSum kernel, bool graded)
      : residual_(std::move(residual)),
        window_(std::move(window)),
        kernel_(std::move(kernel)),
        graded_(graded),
        x_(window_.size()) {}

  std::size_t joints() const override { return residual_.joints(); }
  void reset() override {
    residual_.reset();
    window_.reset();
  }
  double step(const double* q, const double* qd, const double* current, double dt) override {
    window_.step(residual_.step(q, qd, current, dt), x_.data());
    const double output = kernel_.at(x_.data());
    return graded_ ? severity(output) : output;
  }

 private:
  ScaledResidual residual_;
  Window window_;
  KernelSum kernel_;
  bool graded_;
  std::vector<double> x_;
};

}  // namespace tauguard::detectors
