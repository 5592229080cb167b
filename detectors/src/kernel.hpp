// Scaling of residuals, windows of scaled residuals, and sums of the squared rational quadratic
// (SRQ) kernel 1 / (1 + |x - z|^2 / sigma^2)^2. Nothing is allocated after construction.
//
// Each lane evaluates one support vector, with the same arithmetic at any vector width, so all code
// paths give the same bits. A result depends only on its row, so any number of threads and the
// evaluation of single rows give the same bits, too.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "tauguard/geometry/lanes.hpp"

namespace tauguard::detectors {

// Four lanes; the compiler maps them to one or two machine vectors.
typedef double Four __attribute__((vector_size(32)));
constexpr std::size_t fours = 4, lanes = 4 * fours;

inline Four load_four(const double* p) {
  Four v;
  std::memcpy(&v, p, sizeof v);
  return v;
}

// sum_i coef_i / (1 + |x - z_i|^2 inv)^2 for each row x of d numbers. The z_i are stored as
// (blocks, d, lanes).
void weighted_sums(const double* x, std::size_t rows, const double* vectors, const double* coef,
                   std::size_t blocks, std::size_t d, double inv, double* out);

// A weighted sum of kernels: support vectors packed for weighted_sums, padded with zero
// coefficients.
class KernelSum {
 public:
  // `vectors`: one row of d numbers per coefficient; sigma > 0.
  KernelSum(const double* vectors, const double* coef, std::size_t count, std::size_t d,
            double intercept, double sigma)
      : d_(d),
        blocks_((count + lanes - 1) / lanes),
        intercept_(intercept),
        inv_(1.0 / (sigma * sigma)) {
    vectors_.assign(blocks_ * d_ * lanes, 0.0);
    coef_.assign(blocks_ * lanes, 0.0);
    for (std::size_t i = 0; i < count; ++i) {
      coef_[i] = coef[i];
      for (std::size_t k = 0; k < d_; ++k)
        vectors_[((i / lanes) * d_ + k) * lanes + i % lanes] = vectors[i * d_ + k];
    }
  }

  std::size_t dimension() const { return d_; }
  double at(const double* x) const {
    double value;
    rows(x, 1, &value);
    return value;
  }
  // The values at `count` rows.
  void rows(const double* x, std::size_t count, double* out) const {
    weighted_sums(x, count, vectors_.data(), coef_.data(), blocks_, d_, inv_, out);
    for (std::size_t i = 0; i < count; ++i) out[i] += intercept_;
  }

 private:
  std::size_t d_, blocks_;
  double intercept_, inv_;
  std::vector<double> vectors_, coef_;
};

// Terms of the noise model for each joint: 1, speed, and the estimator's motion rows.
constexpr std::size_t motion_rows = 4, noise_terms = 2 + motion_rows;

// Residuals of the chosen joints in units of their noise, one row at a time.
class Scaling {
 public:
  // weights: of the noise model, a row of noise_terms per joint. Without weights the result is the
  // residual [N m] times `factor`.
  Scaling(std::vector<std::int64_t> joints, std::vector<double> weights, double units,
          double factor, bool compress)
      : joints_(std::move(joints)),
        weights_(std::move(weights)),
        units_(units),
        factor_(factor),
        compress_(compress) {}

  std::size_t columns() const { return joints_.size(); }
  // Whether all chosen joints are below n.
  bool fits(std::size_t n) const {
    for (const auto j : joints_)
      if (j < 0 || static_cast<std::size_t>(j) >= n) return false;
    return weights_.empty() || weights_.size() == noise_terms * n;
  }

  // motion: motion_rows x n.
  void row(const double* left, const double* qd, const double* motion, std::size_t n,
           double* out) const {
    for (std::size_t k = 0; k < joints_.size(); ++k) {
      const auto j = static_cast<std::size_t>(joints_[k]);
      if (weights_.empty()) {
        out[k] = left[j] * factor_;
        continue;
      }
      const double* w = weights_.data() + noise_terms * j;
      double noise = w[0] + w[1] * std::abs(qd[j]);
      for (std::size_t r = 0; r < motion_rows; ++r) noise += w[2 + r] * motion[r * n + j];
      const double ratio = left[j] / (units_ * noise);
      out[k] = factor_ * (compress_ ? std::asinh(ratio) : ratio);
    }
  }

 private:
  std::vector<std::int64_t> joints_;
  std::vector<double> weights_;
  double units_, factor_;
  bool compress_;
};

// The window that ends with the latest row of a signal: `count` rows, `lag` apart, oldest first,
// stored column by column. The first row replaces rows before it.
class Window {
 public:
  Window(std::size_t columns, std::size_t lag, std::size_t count)
      : columns_(columns), lag_(lag), count_(count), rows_((lag * (count - 1) + 1) * columns) {}

  std::size_t size() const { return columns_ * count_; }
  void reset() { filled_ = false; }

  void step(const double* row, double* out) {
    const std::size_t length = rows_.size() / columns_;
    at_ = filled_ ? (at_ + 1) % length : 0;
    for (std::size_t r = at_; r < (filled_ ? at_ + 1 : length); ++r)
      std::copy(row, row + columns_, rows_.data() + r * columns_);
    filled_ = true;
    for (std::size_t i = 0; i < count_; ++i) {
      const double* past =
          rows_.data() + ((at_ + length - (count_ - 1 - i) * lag_) % length) * columns_;
      for (std::size_t k = 0; k < columns_; ++k) out[k * count_ + i] = past[k];
    }
  }

 private:
  std::size_t columns_, lag_, count_, at_ = 0;
  bool filled_ = false;
  std::vector<double> rows_;
};

}  // namespace tauguard::detectors
