// Distances in tauguard.rigid._rigid_mesh. Arguments are checked in Python.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "gap.hpp"
#include "tauguard/geometry/interrupt_binding.hpp"

namespace nb = nanobind;
using namespace tauguard::rigid;

namespace {

using Packed = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Offsets = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Radii = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Gaps = nb::ndarray<double, nb::shape<-1, 10>, nb::c_contig, nb::device::cpu>;

Bodies view(int kind, const Packed& data, const Offsets& offsets) {
  const bool cloud = is_cloud(static_cast<Kind>(kind));
  return {static_cast<Kind>(kind), data.data(), offsets.data(),
          cloud ? offsets.shape(0) - 1 : data.shape(0)};
}

double at(const Radii& radii, std::size_t i) { return radii.data()[radii.shape(0) == 1 ? 0 : i]; }

// Rows of distance, point of a, point of b, normal.
void gaps(int kind_a, Packed a, Offsets offsets_a, Radii radius_a, int kind_b, Packed b,
          Offsets offsets_b, Radii radius_b, Gaps out, int threads) {
  const tauguard::geometry::LongCall call;
  const Bodies x = view(kind_a, a, offsets_a), y = view(kind_b, b, offsets_b);
  tauguard::geometry::interruptible_for(out.shape(0), threads, 64, [&](auto begin, auto end, auto) {
    for (auto i = begin; i < end; ++i) {
      const Gap g = gap_of(x, y, i, at(radius_a, i), at(radius_b, i));
      double* row = out.data() + 10 * i;
      row[0] = g.distance;
      for (int k = 0; k < 3; ++k)
        row[1 + k] = g.point_a[k], row[4 + k] = g.point_b[k], row[7 + k] = g.normal[k];
    }
  });
}

}  // namespace

void bind_gaps(nb::module_& m) { m.def("gaps", &gaps); }
