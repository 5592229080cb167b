// tauguard.detectors._kernel: the SRQ kernel 1 / (1 + |x - z|^2 / sigma^2)^2 and sums of it.
//
// Lanes run over support vectors: every lane does the same arithmetic in the same order whatever
// the vector width, so that all code paths give the same bits. A result depends on its row alone,
// so that any number of threads and online evaluation give the same bits too.
#include <nanobind/nanobind.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "bindings.hpp"
#include "tauguard/geometry/lanes.hpp"
#include "tauguard/geometry/thread_pool.hpp"

namespace tauguard::detectors {

using geometry::ThreadPool;

// Four lanes at once; the compiler makes one or two machine vectors of it.
typedef double Four __attribute__((vector_size(32)));
constexpr std::size_t fours = 4, lanes = 4 * fours;

inline Four load(const double* p) {
  Four v;
  std::memcpy(&v, p, sizeof v);
  return v;
}

// sum_i coef_i / (1 + |x - z_i|^2 inv)^2 over `blocks` blocks of lanes vectors of d numbers, lane
// last.
TAUGUARD_CLONES double weighted_sum(const double* x, const double* vectors, const double* coef,
                                    std::size_t blocks, std::size_t d, double inv) {
  Four sum[fours] = {};
  for (std::size_t b = 0; b < blocks; ++b) {
    Four square[fours] = {};
    const double* z = vectors + b * d * lanes;
    for (std::size_t k = 0; k < d; ++k, z += lanes) {
      const Four at = {x[k], x[k], x[k], x[k]};
      for (std::size_t f = 0; f < fours; ++f) {
        const Four gap = at - load(z + 4 * f);
        square[f] += gap * gap;
      }
    }
    for (std::size_t f = 0; f < fours; ++f) {
      const Four one = 1.0 / (1.0 + square[f] * inv);
      sum[f] += load(coef + b * lanes + 4 * f) * (one * one);
    }
  }
  double total = 0.0;
  for (std::size_t f = 0; f < fours; ++f)
    for (std::size_t l = 0; l < 4; ++l) total += sum[f][l];
  return total;
}

// A weighted sum of kernels: support vectors packed for weighted_sum, padded with zero
// coefficients.
class KernelSum {
 public:
  KernelSum(In2 vectors, In1 coef, double intercept, double sigma)
      : d_(vectors.shape(1)),
        blocks_((vectors.shape(0) + lanes - 1) / lanes),
        intercept_(intercept) {
    require(coef.shape(0) == vectors.shape(0), "KernelSum: one coefficient a vector");
    require(sigma > 0, "KernelSum: sigma must be above 0");
    inv_ = 1.0 / (sigma * sigma);
    vectors_.assign(blocks_ * d_ * lanes, 0.0);
    coef_.assign(blocks_ * lanes, 0.0);
    for (std::size_t i = 0; i < vectors.shape(0); ++i) {
      coef_[i] = coef.data()[i];
      for (std::size_t k = 0; k < d_; ++k)
        vectors_[((i / lanes) * d_ + k) * lanes + i % lanes] = vectors.data()[i * d_ + k];
    }
  }

  std::size_t dimension() const { return d_; }
  double at(const double* x) const {
    return weighted_sum(x, vectors_.data(), coef_.data(), blocks_, d_, inv_) + intercept_;
  }

 private:
  std::size_t d_, blocks_;
  double intercept_, inv_;
  std::vector<double> vectors_, coef_;
};

namespace {

void rows(const KernelSum& kernel, In2 x, Out1 out, int threads) {
  require(x.shape(1) == kernel.dimension() && out.shape(0) == x.shape(0),
          "rows: arrays differ in shape");
  nb::gil_scoped_release release;
  ThreadPool::shared().parallel_for(x.shape(0), threads, 256, [&](auto begin, auto end, auto) {
    for (auto t = begin; t < end; ++t) out.data()[t] = kernel.at(x.data() + t * kernel.dimension());
  });
}

// The window that ends with row t of a signal of m columns: `count` rows `lag` apart, oldest first,
// one column after the other; rows before the first are the first.
void window(const double* signal, std::size_t m, std::size_t t, std::size_t lag, std::size_t count,
            double* out) {
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t back = (count - 1 - i) * lag;
    const double* row = signal + m * (back > t ? 0 : t - back);
    for (std::size_t j = 0; j < m; ++j) out[j * count + i] = row[j];
  }
}

void windows(In2 signal, Ids ends, std::size_t lag, std::size_t count, Out2 out) {
  const std::size_t m = signal.shape(1);
  require(out.shape(0) == ends.shape(0) && out.shape(1) == m * count,
          "windows: arrays differ in shape");
  for (std::size_t i = 0; i < ends.shape(0); ++i) {
    require(ends.data()[i] >= 0 && static_cast<std::size_t>(ends.data()[i]) < signal.shape(0),
            "windows: an end lies outside the signal");
    window(signal.data(), m, ends.data()[i], lag, count, out.data() + i * m * count);
  }
}

void series(const KernelSum& kernel, In2 signal, std::size_t lag, std::size_t count, Out1 out,
            int threads) {
  const std::size_t m = signal.shape(1);
  require(m * count == kernel.dimension() && out.shape(0) == signal.shape(0) && lag > 0,
          "series: arrays differ in shape");
  nb::gil_scoped_release release;
  ThreadPool::shared().parallel_for(signal.shape(0), threads, 256, [&](auto begin, auto end, auto) {
    std::vector<double> x(m * count);
    for (auto t = begin; t < end; ++t) {
      window(signal.data(), m, t, lag, count, x.data());
      out.data()[t] = kernel.at(x.data());
    }
  });
}

// Residuals of the chosen joints in units of their envelope, row by row.
class Scaling {
 public:
  // weights: of the envelope, a row of four a joint; no rows: the residual in N m times `factor`.
  Scaling(Ids joints, In2 weights, double units, double factor, bool compress)
      : joints_(joints.data(), joints.data() + joints.shape(0)),
        weights_(weights.data(), weights.data() + weights.shape(0) * weights.shape(1)),
        units_(units),
        factor_(factor),
        compress_(compress) {
    require(weights.shape(0) == 0 || weights.shape(1) == 4, "Scaling: four weights a joint");
  }

  void rows(In2 left, In2 qd, In2 acceleration, Out2 out) const {
    const std::size_t n = left.shape(1), m = joints_.size();
    require(qd.shape(0) == left.shape(0) && acceleration.shape(0) == left.shape(0) &&
                out.shape(0) == left.shape(0) && out.shape(1) == m && qd.shape(1) == n &&
                acceleration.shape(1) == n && (weights_.empty() || weights_.size() == 4 * n),
            "Scaling: expected one number a joint");
    for (const auto j : joints_)
      require(j >= 0 && static_cast<std::size_t>(j) < n, "Scaling: expected one number a joint");
    nb::gil_scoped_release release;
    for (std::size_t t = 0; t < left.shape(0); ++t)
      row(left.data() + t * n, qd.data() + t * n, acceleration.data() + t * n, n,
          out.data() + t * m);
  }

 private:
  void row(const double* left, const double* qd, const double* acceleration, std::size_t n,
           double* out) const {
    double speed = 0.0, shaken = 0.0;
    for (std::size_t j = 0; j < n; ++j) {
      speed += std::abs(qd[j]);
      shaken += std::abs(acceleration[j]);
    }
    for (std::size_t k = 0; k < joints_.size(); ++k) {
      const auto j = static_cast<std::size_t>(joints_[k]);
      out[k] = scaled(left[j], j, std::abs(qd[j]), speed, shaken);
    }
  }

  double scaled(double left, std::size_t j, double own, double speed, double shaken) const {
    if (weights_.empty()) return left * factor_;
    const double* w = weights_.data() + 4 * j;
    const double ratio = left / (units_ * (w[0] + w[1] * own + w[2] * speed + w[3] * shaken));
    return factor_ * (compress_ ? std::asinh(ratio) : ratio);
  }

  std::vector<std::int64_t> joints_;
  std::vector<double> weights_;
  double units_, factor_;
  bool compress_;
};

// The window that ends with the latest row, as `window` gives it of the whole series. All memory is
// taken in the constructor.
class Window {
 public:
  Window(std::size_t columns, std::size_t lag, std::size_t count)
      : columns_(columns), lag_(lag), count_(count), rows_((lag * (count - 1) + 1) * columns) {
    require(columns > 0 && lag > 0 && count > 0, "Window: sizes must be above 0");
  }

  void step(In2 row, Out2 out) {
    require(row.shape(0) == 1 && row.shape(1) == columns_ && out.shape(0) == 1 &&
                out.shape(1) == columns_ * count_,
            "Window: arrays differ in shape");
    const std::size_t length = rows_.size() / columns_;
    at_ = filled_ ? (at_ + 1) % length : 0;
    for (std::size_t r = at_; r < (filled_ ? at_ + 1 : length); ++r)
      std::copy(row.data(), row.data() + columns_, rows_.data() + r * columns_);
    filled_ = true;
    for (std::size_t i = 0; i < count_; ++i) {
      const double* past =
          rows_.data() + ((at_ + length - (count_ - 1 - i) * lag_) % length) * columns_;
      for (std::size_t k = 0; k < columns_; ++k) out.data()[k * count_ + i] = past[k];
    }
  }

 private:
  std::size_t columns_, lag_, count_, at_ = 0;
  bool filled_ = false;
  std::vector<double> rows_;
};

// K_ij between the rows of a and b.
void gram(In2 a, In2 b, double sigma, Out2 out, int threads) {
  const std::size_t d = a.shape(1), columns = b.shape(0);
  require(b.shape(1) == d && out.shape(0) == a.shape(0) && out.shape(1) == columns && sigma > 0,
          "gram: arrays differ in shape, or sigma is not above 0");
  nb::gil_scoped_release release;
  const double inv = 1.0 / (sigma * sigma);
  ThreadPool::shared().parallel_for(a.shape(0), threads, 16, [&](auto begin, auto end, auto) {
    for (auto i = begin; i < end; ++i)
      for (std::size_t j = 0; j < columns; ++j) {
        const double *x = a.data() + i * d, *z = b.data() + j * d;
        double square = 0.0;
        for (std::size_t k = 0; k < d; ++k) square += (x[k] - z[k]) * (x[k] - z[k]);
        const double one = 1.0 / (1.0 + square * inv);
        out.data()[i * columns + j] = one * one;
      }
  });
}

}  // namespace
}  // namespace tauguard::detectors

NB_MODULE(_kernel, m) {
  using namespace tauguard::detectors;
  nb::class_<KernelSum>(m, "KernelSum")
      .def(nb::init<In2, In1, double, double>())
      .def("rows", &rows, nb::arg(), nb::arg().noconvert(), nb::arg())
      .def("series", &series, nb::arg(), nb::arg(), nb::arg(), nb::arg().noconvert(), nb::arg());
  nb::class_<Scaling>(m, "Scaling")
      .def(nb::init<Ids, In2, double, double, bool>())
      .def("rows", &Scaling::rows, nb::arg(), nb::arg(), nb::arg(), nb::arg().noconvert());
  nb::class_<Window>(m, "Window")
      .def(nb::init<std::size_t, std::size_t, std::size_t>())
      .def("step", &Window::step, nb::arg(), nb::arg().noconvert());
  m.def("gram", &gram, nb::arg(), nb::arg(), nb::arg(), nb::arg().noconvert(), nb::arg());
  m.def("windows", &windows, nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg().noconvert());
}
