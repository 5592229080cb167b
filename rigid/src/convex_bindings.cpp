// Bindings of tauguard.rigid._rigid: overlap and sweeps of convex bodies.
#include <nanobind/stl/pair.h>

#include "bodies_binding.hpp"
#include "convex_lanes.hpp"
#include "convex_overlap.hpp"
#include "tauguard/geometry/interrupt_binding.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace tauguard::rigid;
using tauguard::geometry::LongCall;
namespace geometry = tauguard::geometry;

namespace {

using Hits = nb::ndarray<std::uint8_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Rows = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

}  // namespace

void bind_convex(nb::module_& m) {
  nb::class_<HullIndex>(m, "HullIndex")
      .def(
          "__init__", [](HullIndex* self, Packed v) { new (self) HullIndex(v.data(), v.shape(0)); },
          "vertices"_a, nb::keep_alive<1, 2>());
  nb::class_<Batch>(m, "Batch")
      .def(nb::init<int, Packed, Offsets, Radii, std::optional<Poses>, const HullIndex*>(),
           "kind"_a, "packed"_a, "offsets"_a, "radii"_a, "poses"_a = nb::none(),
           "index"_a = nb::none(), nb::keep_alive<1, 7>())
      .def_prop_ro("largest", &Batch::largest)
      .def_prop_ro("curved", [](const Batch& b) { return !is_polytope(b.kind); });
  m.def(
      "first_negative",
      [](Packed values) {
        const double *p = values.data(), *end = p + values.size();
        return std::find_if(p, end, [](double x) { return x < 0; }) - p;
      },
      "values"_a);
  m.def("has_avx2", [] { return use_avx2(); });
  m.def("allow_vectors", [](bool allowed) { vectors_allowed = allowed; }, "allowed"_a);
  m.def(
      "overlap",
      [](const Batch& a, const Batch& b, int method, int threads, Hits hit) {
        const LongCall call;
        return overlap(a, b, hit.shape(0), static_cast<Method>(method), threads, hit.data());
      },
      "a"_a, "b"_a, "method"_a, "threads"_a, "hit"_a);
  m.def(
      "overlap_posed",
      [](const Batch& a, const Batch& b, int method, int threads, Hits hit) {
        const LongCall call;
        const RowMethod decide = row_method(a.kind, b.kind, static_cast<Method>(method));
        each_pair(a, b, hit.shape(0), threads, 256, [&](auto i, Posed& x, Posed& y) {
          if (const auto known = posed_meet(x.row(i), y.row(i), 0, 0))
            hit.data()[i] = *known;
          else
            decide(x.at(i), y.at(i), i, hit.data());
        });
      },
      "a"_a, "b"_a, "method"_a, "threads"_a, "hit"_a);
  m.def(
      "sweep_posed",
      [](const Batch& a, const Batch& b, Packed displacement, int method, int threads, Hits hit,
         Rows out) {
        const LongCall call;
        each_pair(a, b, hit.shape(0), threads, 256, [&](auto i, Posed& x, Posed& y) {
          std::int64_t ox[2], oy[2];
          sweep(row_of(x.at(i), i, ox), row_of(y.at(i), i, oy), displacement.data() + 3 * i, 1,
                static_cast<Method>(method), 1, true, hit.data() + i, out.data() + 7 * i);
        });
      },
      "a"_a, "b"_a, "displacement"_a, "method"_a, "threads"_a, "hit"_a, "out"_a);
  m.def(
      "overlap_boxes",
      [](const Batch& a, Packed blocks_a, const Batch& b, Packed blocks_b, double skew, int threads,
         Hits hit) {
        const LongCall call;
        return overlap_boxes(a, blocks_a.data(), b, blocks_b.data(), skew, hit.shape(0), threads,
                             hit.data());
      },
      "a"_a, "blocks_a"_a, "b"_a, "blocks_b"_a, "skew"_a, "threads"_a, "hit"_a);
  m.def(
      "box_skew",
      [](Packed rotation, double tolerance) {
        const LongCall call;
        const Skew skew = box_skew(rotation.data(), rotation.shape(0), tolerance);
        return std::pair(skew.largest, skew.first_beyond);
      },
      "rotation"_a, "tolerance"_a);
  m.def(
      "first_bad_pose",
      [](Poses poses, double tolerance) {
        const std::size_t n = poses.shape(0);
        for (std::size_t i = 0; i < n; ++i) {
          const double* p = poses.data() + 16 * i;
          double r[9];
          for (int k = 0; k < 9; ++k) r[k] = p[4 * (k / 3) + k % 3];
          const bool bottom = p[12] == 0 && p[13] == 0 && p[14] == 0 && p[15] == 1;
          const bool turns =
              box_skew(r, 1, tolerance).first_beyond == 1 &&
              dot(geometry::load(r), cross(geometry::load(r + 3), geometry::load(r + 6))) > 0;
          if (!bottom || !turns) return i;
        }
        return n;
      },
      "poses"_a, "tolerance"_a);
  m.def(
      "pack_boxes",
      [](Packed packed, Rows blocks) {
        const LongCall call;
        pack_boxes(packed.data(), packed.shape(0), blocks.data());
      },
      "packed"_a, "blocks"_a);
  m.def(
      "sweep",
      [](const Batch& a, const Batch& b, Packed displacement, int method, int threads, bool points,
         Hits hit, Rows out) {
        const LongCall call;
        return sweep(a, b, displacement.data(), hit.shape(0), static_cast<Method>(method), threads,
                     points, hit.data(), out.data());
      },
      "a"_a, "b"_a, "displacement"_a, "method"_a, "threads"_a, "points"_a, "hit"_a, "out"_a);
  m.def(
      "overlap_cached",
      [](const Batch& a, const Batch& b, int threads, Rows normals, Hits hit) {
        const LongCall call;
        return overlap_cached(a, b, hit.shape(0), threads, normals.data(), hit.data());
      },
      "a"_a, "b"_a, "threads"_a, "normals"_a, "hit"_a);
  m.def(
      "witnesses",
      [](const Batch& a, const Batch& b, int threads, Hits hit, Rows out) {
        const LongCall call;
        each_pair(a, b, out.shape(0), threads, 64, [&](auto i, Posed& x, Posed& y) {
          witness(x.at(i), y.at(i), i, hit.data()[i], out.data() + 7 * i);
        });
      },
      "a"_a, "b"_a, "threads"_a, "hit"_a, "out"_a);
}
