// tauguard.rigid._rigid: queries of convex bodies and of meshes. Python checks arguments.
#include <nanobind/stl/string.h>

#include "bodies_binding.hpp"
#include "contact_arrays.hpp"
#include "mesh_impact.hpp"
#include "mesh_query.hpp"
#include "tauguard/geometry/argument_errors.hpp"
#include "tauguard/geometry/interrupt_binding.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace tauguard::rigid;
using tauguard::geometry::interruptible_for;
using tauguard::geometry::LongCall;

using Vertices = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Faces = nb::ndarray<const std::int32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Pairs = nb::ndarray<std::int32_t, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;

namespace {

ContactRows contacts(const Mesh& a, const Mesh& b, Poses poses, std::size_t limit, int threads) {
  const std::size_t n = poses.shape(0);
  std::vector<std::vector<Contact>> found(n);
  {
    const LongCall call;
    ContactBudget budget(limit);
    interruptible_for(n, threads, 4, [&](auto begin, auto end, auto) {
      Scratch scratch;
      for (auto i = begin; i < end; ++i)
        all_contacts(a, b, Pose(poses.data() + 16 * i), scratch, budget, found[i]);
    });
  }
  return contact_arrays(found);
}

void impact_of_meshes(const Mesh& a, const Mesh& b, Poses pose_a, Vectors linear_a,
                      Vectors angular_a, Poses pose_b, Vectors linear_b, Vectors angular_b,
                      Touches out, Pairs faces, int threads) {
  const LongCall call;
  const Motions mx{pose_a, linear_a, angular_a}, my{pose_b, linear_b, angular_b};
  interruptible_for(out.shape(0), threads, 1, [&](auto begin, auto end, auto) {
    for (auto i = begin; i < end; ++i) {
      FacePair pair;
      store(meshes_impact(a, b, mx[i], my[i], &pair), out.data() + 7 * i);
      faces.data()[2 * i] = pair.a, faces.data()[2 * i + 1] = pair.b;
    }
  });
}

}  // namespace

void bind_convex(nb::module_& m);
void bind_distances(nb::module_& m);
void bind_bodies(nb::class_<Mesh>& mesh);
void bind_rays(nb::class_<Mesh>& mesh);
void bind_volumes(nb::module_& m);
void bind_broad_phase(nb::module_& m);

NB_MODULE(_rigid, m) {
  m.doc() = "Queries of convex bodies and meshes on arrays. Arguments are checked in Python.";
  tauguard::geometry::bind_interrupts();
  tauguard::geometry::bind_argument_errors();
  bind_convex(m);
  bind_distances(m);
  bind_volumes(m);
  bind_broad_phase(m);
  nb::class_<Mesh> mesh(m, "Mesh");
  bind_bodies(mesh);
  bind_rays(mesh);
  mesh.def(
          "__init__",
          [](Mesh* self, Vertices vertices, Faces faces, const std::string& volume) {
            const LongCall call;
            new (self) Mesh(vertices.data(), faces.data(), faces.shape(0), kind_of(volume));
          },
          "vertices"_a, "faces"_a, "volume"_a)
      .def(
          "overlap",
          [](const Mesh& a, const Mesh& b, Poses poses, Pairs out, int threads) {
            const LongCall call;
            interruptible_for(poses.shape(0), threads, 8, [&](auto begin, auto end, auto) {
              Scratch scratch;
              for (auto i = begin; i < end; ++i) {
                const FacePair p = first_overlap(a, b, Pose(poses.data() + 16 * i), scratch);
                out.data()[2 * i] = p.a;
                out.data()[2 * i + 1] = p.b;
              }
            });
          },
          "other"_a, "poses"_a, "out"_a, "threads"_a)
      .def("contacts", &contacts, "other"_a, "poses"_a, "limit"_a, "threads"_a)
      .def("time_of_impact", &impact_of_meshes, "other"_a, "pose_a"_a, "linear_a"_a, "angular_a"_a,
           "pose_b"_a, "linear_b"_a, "angular_b"_a, "out"_a, "faces"_a, "threads"_a);
  // Exact overlap of pairs of triangles, for tests.
  m.def(
      "triangles_overlap",
      [](nb::ndarray<const double, nb::shape<-1, 2, 3, 3>, nb::c_contig, nb::device::cpu> pairs,
         nb::ndarray<bool, nb::shape<-1>, nb::c_contig, nb::device::cpu> out) {
        const LongCall call;
        const tauguard::geometry::RoundToNearest guard;
        for (std::size_t i = 0; i < pairs.shape(0); ++i) {
          const auto* t = reinterpret_cast<const Triangle*>(pairs.data() + 18 * i);
          out.data()[i] = triangles_overlap(t[0], t[1]);
        }
      },
      "pairs"_a, "out"_a);
}
