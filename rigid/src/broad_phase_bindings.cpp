// Broad phase of many bodies, for Python.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "bodies_binding.hpp"
#include "broad_phase.hpp"
#include "contact_arrays.hpp"
#include "tauguard/geometry/interrupt_binding.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace tauguard::rigid;
using tauguard::geometry::LongCall;

namespace {

using Boxes6 = nb::ndarray<double, nb::shape<-1, 2, 3>, nb::c_contig, nb::device::cpu>;
using Pairs2 = nb::ndarray<nb::numpy, std::int32_t, nb::shape<-1, 2>>;

}  // namespace

void bind_broad_phase(nb::module_& m) {
  m.def(
      "bounds",
      [](const Batch& batch, Boxes6 out, int threads) {
        const LongCall call;
        tauguard::geometry::interruptible_for(
            out.shape(0), threads, 256, [&](auto begin, auto end, auto) {
              Posed bodies(batch);
              for (auto i = begin; i < end; ++i) {
                const Range3 box = bounds_of(bodies.at(i), i, batch.radius(i));
                std::copy_n(box.low, 3, out.data() + 6 * i);
                std::copy_n(box.high, 3, out.data() + 6 * i + 3);
              }
            });
      },
      "batch"_a, "out"_a, "threads"_a);
  m.def(
      "overlapping_boxes",
      [](Boxes6 boxes, double by, int threads) {
        std::vector<std::int32_t> pairs;
        {
          const LongCall call;
          pairs = overlapping_boxes(reinterpret_cast<const Range3*>(boxes.data()), boxes.shape(0),
                                    by, threads);
        }
        const std::size_t n = pairs.size() / 2;
        return Pairs2(owned(std::move(pairs), std::array<std::size_t, 2>{n, 2}));
      },
      "boxes"_a, "by"_a, "threads"_a);
}
