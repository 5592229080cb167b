// tauguard.rigid._rigid_mesh: meshes and their queries over batches of poses. Arguments are checked in Python.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include "mesh_query.hpp"
#include "tauguard/geometry/thread_pool.hpp"

namespace nb = nanobind;
using namespace tauguard::rigid;
using tauguard::geometry::ThreadPool;

using Points = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Faces = nb::ndarray<const std::int32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Poses = nb::ndarray<const double, nb::shape<-1, 4, 4>, nb::c_contig, nb::device::cpu>;
using Pairs = nb::ndarray<std::int32_t, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;

namespace {

VolumeKind kind_of(const std::string& name) {
  if (name == "aabb") return VolumeKind::aabb;
  if (name == "obb") return VolumeKind::obb;
  if (name == "k_dop") return VolumeKind::k_dop;
  return VolumeKind::sphere;
}

template <class T, std::size_t N>
auto owned(std::vector<T>&& values, std::array<std::size_t, N> shape) {
  auto* held = new std::vector<T>(std::move(values));
  nb::capsule owner(held, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  return nb::ndarray<nb::numpy, T>(held->data(), N, shape.data(), owner);
}

// All contacts of every pose: (pose row, face of a, face of b) and (point, normal, depth) a row.
nb::tuple contacts(const Mesh& a, const Mesh& b, Poses poses, int threads) {
  std::vector<std::int32_t> rows;
  std::vector<double> values;
  {
    nb::gil_scoped_release release;
    const std::size_t n = poses.shape(0);
    std::vector<std::vector<Contact>> found(n);
    ThreadPool::shared().parallel_for(n, threads, 4, [&](auto begin, auto end, auto) {
      Scratch scratch;
      for (auto i = begin; i < end; ++i) all_contacts(a, b, Pose(poses.data() + 16 * i), scratch, found[i]);
    });
    for (std::size_t i = 0; i < n; ++i)
      for (const Contact& c : found[i]) {
        rows.insert(rows.end(), {static_cast<std::int32_t>(i), c.a, c.b});
        values.insert(values.end(), {c.point[0], c.point[1], c.point[2], c.normal[0], c.normal[1], c.normal[2], c.depth});
      }
  }
  const std::size_t count = rows.size() / 3;
  return nb::make_tuple(owned(std::move(rows), std::array<std::size_t, 2>{count, 3}),
                        owned(std::move(values), std::array<std::size_t, 2>{count, 7}));
}

}  // namespace

NB_MODULE(_rigid_mesh, m) {
  nb::class_<Mesh>(m, "Mesh")
      .def("__init__",
           [](Mesh* self, Points vertices, Faces faces, const std::string& volume) {
             nb::gil_scoped_release release;
             new (self) Mesh(vertices.data(), faces.data(), faces.shape(0), kind_of(volume));
           })
      .def("overlap",
           [](const Mesh& a, const Mesh& b, Poses poses, Pairs out, int threads) {
             nb::gil_scoped_release release;
             ThreadPool::shared().parallel_for(poses.shape(0), threads, 8, [&](auto begin, auto end, auto) {
               Scratch scratch;
               for (auto i = begin; i < end; ++i) {
                 const FacePair p = first_overlap(a, b, Pose(poses.data() + 16 * i), scratch);
                 out.data()[2 * i] = p.a;
                 out.data()[2 * i + 1] = p.b;
               }
             });
           })
      .def("contacts", &contacts);
  // Row by row, for tests of the exact answer.
  m.def("triangles_overlap", [](nb::ndarray<const double, nb::shape<-1, 2, 3, 3>, nb::c_contig, nb::device::cpu> pairs,
                                nb::ndarray<bool, nb::shape<-1>, nb::c_contig, nb::device::cpu> out) {
    nb::gil_scoped_release release;
    const tauguard::geometry::RoundToNearest guard;
    for (std::size_t i = 0; i < pairs.shape(0); ++i) {
      const auto* t = reinterpret_cast<const Triangle*>(pairs.data() + 18 * i);
      out.data()[i] = triangles_overlap(t[0], t[1]);
    }
  });
}
