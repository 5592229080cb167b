// Bindings of tauguard.rigid._rigid_mesh: distance, overlap and first contact of convex bodies with
// convex bodies or meshes. Arguments are checked in Python.
#include "bodies_binding.hpp"
#include "mesh_body.hpp"
#include "tauguard/geometry/interrupt_binding.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace tauguard::rigid;
using tauguard::geometry::interruptible_for;
using tauguard::geometry::LongCall;

namespace {

using DistanceRows = nb::ndarray<double, nb::shape<-1, 10>, nb::c_contig, nb::device::cpu>;
using Hits = nb::ndarray<std::uint8_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using FaceRows = nb::ndarray<std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// Writes a row of distance, point of a, point of b, and normal.
void store(const SignedDistance& g, double* row) {
  row[0] = g.distance;
  for (int k = 0; k < 3; ++k)
    row[1 + k] = g.point_a[k], row[4 + k] = g.point_b[k], row[7 + k] = g.normal[k];
}

void distances(int kind_a, Packed a, Offsets offsets_a, Radii radius_a, int kind_b, Packed b,
               Offsets offsets_b, Radii radius_b, DistanceRows out, int threads) {
  const LongCall call;
  const Bodies x = view(kind_a, a, offsets_a), y = view(kind_b, b, offsets_b);
  interruptible_for(out.shape(0), threads, 64, [&](auto begin, auto end, auto) {
    for (auto i = begin; i < end; ++i)
      store(signed_distance(x, y, i, at(radius_a, i), at(radius_b, i)), out.data() + 10 * i);
  });
}

void meets(int kind_a, Packed a, Offsets offsets_a, Radii radius_a, int kind_b, Packed b,
           Offsets offsets_b, Radii radius_b, Hits hit, int threads) {
  const LongCall call;
  const Bodies x = view(kind_a, a, offsets_a), y = view(kind_b, b, offsets_b);
  interruptible_for(hit.shape(0), threads, 64, [&](auto begin, auto end, auto) {
    for (auto i = begin; i < end; ++i)
      hit.data()[i] = meet(x, y, i, at(radius_a, i), at(radius_b, i));
  });
}

void impacts(int kind_a, Packed a, Offsets offsets_a, Radii radius_a, int kind_b, Packed b,
             Offsets offsets_b, Radii radius_b, Poses pose_a, Vectors linear_a, Vectors angular_a,
             Poses pose_b, Vectors linear_b, Vectors angular_b, Touches out, int threads) {
  const LongCall call;
  const Bodies x = view(kind_a, a, offsets_a), y = view(kind_b, b, offsets_b);
  const Motions mx{pose_a, linear_a, angular_a}, my{pose_b, linear_b, angular_b};
  interruptible_for(out.shape(0), threads, 16, [&](auto begin, auto end, auto) {
    for (auto i = begin; i < end; ++i)
      store(bodies_impact(x, y, i, at(radius_a, i), at(radius_b, i), mx[i], my[i]),
            out.data() + 7 * i);
  });
}

// Calls body(row) for every row of the batch.
template <class Body>
void each_body(const Bodies& bodies, const Radii& radius, std::size_t rows, int threads,
               Body body) {
  const LongCall call;
  interruptible_for(rows, threads, 1, [&](auto begin, auto end, auto) {
    for (auto i = begin; i < end; ++i) body(i, RoundedBody(bodies, i, at(radius, i)));
  });
}

void mesh_meets(const Mesh& mesh, int kind, Packed data, Offsets offsets, Radii radius,
                FaceRows faces, int threads) {
  each_body(view(kind, data, offsets), radius, faces.shape(0), threads,
            [&](auto i, const RoundedBody& body) { faces.data()[i] = first_overlap(mesh, body); });
}

void mesh_distances(const Mesh& mesh, int kind, Packed data, Offsets offsets, Radii radius,
                    DistanceRows out, FaceRows faces, int threads) {
  each_body(view(kind, data, offsets), radius, faces.shape(0), threads,
            [&](auto i, const RoundedBody& body) {
              const FaceDistance nearest = nearest_face(mesh, body);
              store(nearest.at, out.data() + 10 * i), faces.data()[i] = nearest.face;
            });
}

void mesh_impacts(const Mesh& mesh, int kind, Packed data, Offsets offsets, Radii radius,
                  Poses pose_a, Vectors linear_a, Vectors angular_a, Poses pose_b, Vectors linear_b,
                  Vectors angular_b, Touches out, FaceRows faces, int threads) {
  const Motions of_mesh{pose_a, linear_a, angular_a}, of_body{pose_b, linear_b, angular_b};
  each_body(view(kind, data, offsets), radius, faces.shape(0), threads,
            [&](auto i, const RoundedBody& body) {
              store(mesh_body_impact(mesh, body, of_mesh[i], of_body[i], faces.data() + i),
                    out.data() + 7 * i);
            });
}

}  // namespace

void bind_distances(nb::module_& m) {
  m.def("distances", &distances, "kind_a"_a, "a"_a, "offsets_a"_a, "radius_a"_a, "kind_b"_a, "b"_a,
        "offsets_b"_a, "radius_b"_a, "out"_a, "threads"_a);
  m.def("meets", &meets, "kind_a"_a, "a"_a, "offsets_a"_a, "radius_a"_a, "kind_b"_a, "b"_a,
        "offsets_b"_a, "radius_b"_a, "hit"_a, "threads"_a);
  m.def("time_of_impact", &impacts, "kind_a"_a, "a"_a, "offsets_a"_a, "radius_a"_a, "kind_b"_a,
        "b"_a, "offsets_b"_a, "radius_b"_a, "pose_a"_a, "linear_a"_a, "angular_a"_a, "pose_b"_a,
        "linear_b"_a, "angular_b"_a, "out"_a, "threads"_a);
}

void bind_bodies(nb::class_<Mesh>& mesh) {
  mesh.def("meets", &mesh_meets, "kind"_a, "bodies"_a, "offsets"_a, "radius"_a, "faces"_a,
           "threads"_a);
  mesh.def("distances", &mesh_distances, "kind"_a, "bodies"_a, "offsets"_a, "radius"_a, "out"_a,
           "faces"_a, "threads"_a);
  mesh.def("time_of_impact_of_bodies", &mesh_impacts, "kind"_a, "bodies"_a, "offsets"_a, "radius"_a,
           "pose_mesh"_a, "linear_mesh"_a, "angular_mesh"_a, "pose_body"_a, "linear_body"_a,
           "angular_body"_a, "out"_a, "faces"_a, "threads"_a);
}
