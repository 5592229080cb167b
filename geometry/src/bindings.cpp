// tauguard.geometry._geometry: the shared predicates as batch functions on arrays.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cfenv>
#include <cstdint>

#include "tauguard/geometry/aabb.hpp"
#include "tauguard/geometry/argument_errors.hpp"
#include "tauguard/geometry/interrupt_binding.hpp"
#include "tauguard/geometry/rounding.hpp"
#include "tauguard/geometry/signs.hpp"
#include "tauguard/geometry/thread_pool.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace tauguard::geometry;

using Points3 = nb::ndarray<const double, nb::shape<-1, 4, 3>, nb::c_contig, nb::device::cpu>;
using Points2 = nb::ndarray<const double, nb::shape<-1, 3, 2>, nb::c_contig, nb::device::cpu>;
using Signs = nb::ndarray<std::int8_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>;

NB_MODULE(_geometry, m) {
  m.doc() = "Exact predicates on arrays, rounding mode, threads. Arguments are checked in Python.";
  bind_interrupts();
  bind_argument_errors();
  m.def(
      "orient3d",
      [](Points3 points, Signs out, int threads) {
        const LongCall call;
        const double* p = points.data();
        std::int8_t* s = out.data();
        interruptible_for(points.shape(0), threads, 4096, [&](auto begin, auto end, auto) {
          for (auto i = begin; i < end; ++i)
            s[i] = static_cast<std::int8_t>(
                orient3d(p + 12 * i, p + 12 * i + 3, p + 12 * i + 6, p + 12 * i + 9));
        });
      },
      "points"_a, "out"_a, "threads"_a);
  m.def(
      "orient2d",
      [](Points2 points, Signs out, int threads) {
        const LongCall call;
        const double* p = points.data();
        std::int8_t* s = out.data();
        interruptible_for(points.shape(0), threads, 4096, [&](auto begin, auto end, auto) {
          for (auto i = begin; i < end; ++i)
            s[i] = static_cast<std::int8_t>(orient2d(p + 6 * i, p + 6 * i + 2, p + 6 * i + 4));
        });
      },
      "points"_a, "out"_a, "threads"_a);
  // Sets the rounding mode, as a loaded library might; for tests of RoundToNearest.
  m.def(
      "set_rounding",
      [](int mode) {
        constexpr int modes[] = {FE_TONEAREST, FE_DOWNWARD, FE_UPWARD, FE_TOWARDZERO};
        std::fesetround(modes[mode & 3]);
      },
      "mode"_a);
  m.def("get_rounding", [] {
    switch (std::fegetround()) {
      case FE_DOWNWARD:
        return 1;
      case FE_UPWARD:
        return 2;
      case FE_TOWARDZERO:
        return 3;
      default:
        return 0;
    }
  });
}
