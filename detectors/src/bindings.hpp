// Array types and checks that all binding files use.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>

namespace tauguard::detectors {

namespace nb = nanobind;
using namespace nb::literals;

using In1 = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using In2 = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using In3 = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Ids = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Out1 = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Out2 = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Out3 = nb::ndarray<double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

inline void require(bool fits, const char* message) {
  if (!fits) throw std::invalid_argument(message);
}

inline bool finite(const double* v, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i)
    if (!std::isfinite(v[i])) return false;
  return true;
}

// Checks a sample of n joints. `name`: name of the third signal, for error messages.
inline void check_sample(std::size_t n, const In1& q, const In1& qd, const In1& drive,
                         const char* name) {
  const std::pair<const char*, const In1*> signals[] = {{"q", &q}, {"qd", &qd}, {name, &drive}};
  for (const auto& [what, signal] : signals) {
    if (signal->shape(0) != n)
      throw std::invalid_argument(std::string(what) + ": expected one entry per joint");
    if (!finite(signal->data(), n))
      throw std::invalid_argument(std::string(what) + ": every entry must be finite");
  }
}

void bind_estimator(nb::module_& m);
void bind_free_motion(nb::module_& m);
void bind_faults(nb::module_& m);
void bind_monitor(nb::module_& m);

}  // namespace tauguard::detectors
