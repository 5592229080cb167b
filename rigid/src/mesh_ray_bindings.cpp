// Queries of points, rays and distances on meshes, for Python.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "bodies_binding.hpp"
#include "contact_arrays.hpp"
#include "mesh_distance.hpp"
#include "mesh_rays.hpp"
#include "tauguard/geometry/interrupt_binding.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace tauguard::rigid;
using tauguard::geometry::interruptible_for;
using tauguard::geometry::load;
using tauguard::geometry::LongCall;

namespace {

using Numbers = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Lengths = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Rows = nb::ndarray<std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Pairs = nb::ndarray<std::int32_t, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using Corners = nb::ndarray<const std::int32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

void write(double* to, const Vec3& x) { std::copy(x.begin(), x.end(), to); }

}  // namespace

void bind_rays(nb::class_<Mesh>& mesh) {
  mesh.def(
          "nearest",  // a row of `out`: distance, point
          [](const Mesh& m, Vectors points, Numbers out, Rows faces, int threads) {
            const LongCall call;
            interruptible_for(points.shape(0), threads, 64, [&](auto begin, auto end, auto) {
              for (auto i = begin; i < end; ++i) {
                const NearestPoint near = nearest_point(m, load(points.data() + 3 * i));
                out.data()[4 * i] = near.distance;
                write(out.data() + 4 * i + 1, near.point);
                faces.data()[i] = near.face;
              }
            });
          },
          "points"_a, "out"_a, "faces"_a, "threads"_a)
      .def(
          "windings",  // 2^30 for points on the surface
          [](const Mesh& m, Vectors points, Rows out, int threads) {
            const LongCall call;
            interruptible_for(points.shape(0), threads, 64, [&](auto begin, auto end, auto) {
              for (auto i = begin; i < end; ++i) {
                const Vec3 p = load(points.data() + 3 * i);
                out.data()[i] = on_surface(m, p) ? 1 << 30 : winding(m, p);
              }
            });
          },
          "points"_a, "out"_a, "threads"_a)
      .def(
          "cast",
          [](const Mesh& m, Vectors origins, Vectors directions, Lengths distance, Rows faces,
             int threads) {
            const LongCall call;
            interruptible_for(distance.shape(0), threads, 64, [&](auto begin, auto end, auto) {
              for (auto i = begin; i < end; ++i) {
                const auto row = [&](const Vectors& v) {
                  return load(v.data() + (v.shape(0) == 1 ? 0 : 3 * i));
                };
                const RayHit hit = cast_ray(m, row(origins), row(directions));
                distance.data()[i] = hit.distance, faces.data()[i] = hit.face;
              }
            });
          },
          "origins"_a, "directions"_a, "distance"_a, "faces"_a, "threads"_a)
      .def(
          "distance",  // a row of `out`: distance, point of a, point of b, normal
          [](const Mesh& a, const Mesh& b, Poses poses, Numbers out, Pairs faces, int threads) {
            const LongCall call;
            interruptible_for(poses.shape(0), threads, 1, [&](auto begin, auto end, auto) {
              Scratch scratch;
              for (auto i = begin; i < end; ++i) {
                const MeshGap gap = mesh_distance(a, b, Pose(poses.data() + 16 * i), scratch);
                double* row = out.data() + 10 * i;
                row[0] = gap.distance;
                write(row + 1, gap.point_a), write(row + 4, gap.point_b),
                    write(row + 7, gap.normal);
                faces.data()[2 * i] = gap.faces.a, faces.data()[2 * i + 1] = gap.faces.b;
              }
            });
          },
          "other"_a, "poses"_a, "out"_a, "faces"_a, "threads"_a)
      .def(
          "self_contacts",
          [](const Mesh& m, Corners ids, std::size_t limit) {
            std::vector<std::vector<Contact>> found(1);
            {
              const LongCall call;
              ContactBudget budget(limit);
              Scratch scratch;
              self_contacts(m, ids.data(), scratch, budget, found[0]);
            }
            return contact_arrays(found);
          },
          "ids"_a, "limit"_a);
}
