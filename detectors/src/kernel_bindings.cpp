// tauguard.detectors._kernel: kernel machines, scalings and windows on arrays.
#include <nanobind/stl/vector.h>

#include "bindings.hpp"
#include "kernel.hpp"
#include "tauguard/geometry/argument_errors.hpp"
#include "tauguard/geometry/thread_pool.hpp"

namespace tauguard::detectors {

using geometry::ThreadPool;

namespace {

void rows(const KernelSum& kernel, In2 x, Out1 out, int threads) {
  require(x.shape(1) == kernel.dimension() && out.shape(0) == x.shape(0),
          "rows: arrays differ in shape");
  nb::gil_scoped_release release;
  ThreadPool::shared().parallel_for(x.shape(0), threads, 256, [&](auto begin, auto end, auto) {
    kernel.rows(x.data() + begin * kernel.dimension(), end - begin, out.data() + begin);
  });
}

// The window that ends with row t of a signal of m columns: `count` rows `lag` apart, oldest first,
// one column after the other; the first row replaces rows before it.
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

KernelSum* make_kernel(In2 vectors, In1 coef, double intercept, double sigma) {
  require(coef.shape(0) == vectors.shape(0), "KernelSum: one coefficient per vector");
  require(sigma > 0, "KernelSum: sigma must be above 0");
  return new KernelSum(vectors.data(), coef.data(), coef.shape(0), vectors.shape(1), intercept,
                       sigma);
}

void scale(const Scaling& scaling, In2 left, In2 qd, In3 motion, Out2 out) {
  const std::size_t n = left.shape(1), m = scaling.columns();
  require(qd.shape(0) == left.shape(0) && motion.shape(0) == left.shape(0) &&
              out.shape(0) == left.shape(0) && out.shape(1) == m && qd.shape(1) == n &&
              motion.shape(1) == motion_rows && motion.shape(2) == n && scaling.fits(n),
          "Scaling: expected one number per joint");
  nb::gil_scoped_release release;
  for (std::size_t t = 0; t < left.shape(0); ++t)
    scaling.row(left.data() + t * n, qd.data() + t * n, motion.data() + t * motion_rows * n, n,
                out.data() + t * m);
}

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
  tauguard::geometry::bind_argument_errors();
  m.doc() = "Kernel machines, scalings and windows on arrays.";
  using namespace tauguard::detectors;
  nb::class_<KernelSum>(m, "KernelSum")
      .def(nb::new_(&make_kernel), "vectors"_a, "coef"_a, "intercept"_a, "sigma"_a)
      .def("rows", &rows, "x"_a, "out"_a.noconvert(), "threads"_a);
  nb::class_<Scaling>(m, "Scaling")
      .def(nb::init<std::vector<std::int64_t>, std::vector<double>, double, double, bool>(),
           "joints"_a, "weights"_a, "units"_a, "factor"_a, "compress"_a)
      .def("rows", &scale, "left"_a, "qd"_a, "motion"_a, "out"_a.noconvert());
  m.def("gram", &gram, "a"_a, "b"_a, "sigma"_a, "out"_a.noconvert(), "threads"_a);
  m.def("windows", &windows, "signal"_a, "ends"_a, "lag"_a, "count"_a, "out"_a.noconvert());
}
