// Bindings of tauguard.rigid._rigid: distance, overlap and first contact of convex bodies with
// convex bodies or meshes. Arguments are checked in Python.
#include <memory>

#include "bodies_binding.hpp"
#include "convex_overlap.hpp"
#include "manifold.hpp"
#include "mesh_body.hpp"
#include "support_distance.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace tauguard::rigid;
using tauguard::geometry::interruptible_for;
using tauguard::geometry::LongCall;
namespace geometry = tauguard::geometry;

namespace {

using DistanceRows = nb::ndarray<double, nb::shape<-1, 10>, nb::c_contig, nb::device::cpu>;
using Hits = nb::ndarray<std::uint8_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Counts = nb::ndarray<std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Contacts = nb::ndarray<double, nb::shape<-1, 4, 7>, nb::c_contig, nb::device::cpu>;
using Vectors3 = nb::ndarray<double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using FaceRows = nb::ndarray<std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// Writes a row of distance, point of a, point of b, and normal.
void store(const SignedDistance& g, double* row) {
  row[0] = g.distance;
  for (int k = 0; k < 3; ++k)
    row[1 + k] = g.point_a[k], row[4 + k] = g.point_b[k], row[7 + k] = g.normal[k];
}

void distances(const Batch& a, const Batch& b, DistanceRows out, int threads) {
  const LongCall call;
  if (a.in_place() && b.in_place())
    return interruptible_for(out.shape(0), threads, 64, [&](auto begin, auto end, auto) {
      for (auto i = begin; i < end; ++i)
        store(signed_distance(a, b, i, a.radius(i), b.radius(i)), out.data() + 10 * i);
    });
  each_pair(a, b, out.shape(0), threads, 64, [&](auto i, Posed& x, Posed& y) {
    SignedDistance g;
    if (!posed_distance(x.row(i), y.row(i), a.radius(i), b.radius(i), &g))
      g = signed_distance(x.at(i), y.at(i), i, a.radius(i), b.radius(i));
    store(g, out.data() + 10 * i);
  });
}

// Queries of a few pairs without poses, in the calling thread and without releasing the
// interpreter: a call takes about a microsecond. They return None where the general functions must
// be used.
constexpr std::size_t few = 64;

std::size_t few_rows(const Batch& a, const Batch& b) {
  const bool planes = a.kind == Kind::half_spaces && b.kind == Kind::half_spaces;
  const bool fits = (a.count == b.count || a.count == 1 || b.count == 1) && a.count && b.count;
  const std::size_t n = std::max(a.count, b.count);
  return fits && n <= few && !planes && (a.kind == Kind::polygons) == (b.kind == Kind::polygons)
             ? n
             : 0;
}

template <class T>
nb::object owned(T* data, std::initializer_list<std::size_t> shape) {
  nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<T*>(p); });
  return nb::ndarray<nb::numpy, T>(data, shape, owner).cast();
}

nb::object few_distances(const Batch& a, const Batch& b) {
  const std::size_t n = few_rows(a, b);
  if (!n || a.kind == Kind::polygons) return nb::none();
  const geometry::RoundToNearest guard;
  auto out = std::make_unique<double[]>(10 * n);
  for (std::size_t i = 0; i < n; ++i)
    store(signed_distance(a, b, i, a.radius(i), b.radius(i)), &out[10 * i]);
  return owned(out.release(), {n, 10});
}

nb::object few_meets(const Batch& a, const Batch& b) {
  const std::size_t n = few_rows(a, b);
  if (!n) return nb::none();
  const geometry::RoundToNearest guard;
  const auto core = [](const Batch& x) { return x.sharp() && x.kind <= Kind::polygons; };
  auto out = std::make_unique<bool[]>(n);
  if (core(a) && core(b)) {
    const RowMethod decide = row_method(a.kind, b.kind);
    std::uint8_t hit[few];
    for (std::size_t i = 0; i < n; ++i) decide(a, b, i, hit), out[i] = hit[i];
  } else {
    for (std::size_t i = 0; i < n; ++i) out[i] = meet(a, b, i, a.radius(i), b.radius(i));
  }
  return owned(out.release(), {n});
}

void meets(const Batch& a, const Batch& b, Hits hit, int threads) {
  const LongCall call;
  if (a.in_place() && b.in_place())
    return interruptible_for(hit.shape(0), threads, 64, [&](auto begin, auto end, auto) {
      for (auto i = begin; i < end; ++i) hit.data()[i] = meet(a, b, i, a.radius(i), b.radius(i));
    });
  each_pair(a, b, hit.shape(0), threads, 64, [&](auto i, Posed& x, Posed& y) {
    const auto known = posed_meet(x.row(i), y.row(i), a.radius(i), b.radius(i));
    hit.data()[i] = known ? *known : meet(x.at(i), y.at(i), i, a.radius(i), b.radius(i));
  });
}

// A common point of each row that is a hit; other rows stay as they are.
void common_points(const Batch& a, const Batch& b, Hits hit, Vectors3 out, int threads) {
  const LongCall call;
  each_pair(a, b, hit.shape(0), threads, 64, [&](auto i, Posed& x, Posed& y) {
    if (!hit.data()[i]) return;
    const Vec3 p = support_common_point(x.at(i), y.at(i), i, a.radius(i), b.radius(i));
    std::copy(p.begin(), p.end(), out.data() + 3 * i);
  });
}

void impacts(const Batch& a, const Batch& b, Poses pose_a, Vectors linear_a, Vectors angular_a,
             Poses pose_b, Vectors linear_b, Vectors angular_b, Touches out, int threads) {
  const LongCall call;
  const Motions mx{pose_a, linear_a, angular_a}, my{pose_b, linear_b, angular_b};
  interruptible_for(out.shape(0), threads, 16, [&](auto begin, auto end, auto) {
    for (auto i = begin; i < end; ++i)
      store(bodies_impact(a, b, i, a.radius(i), b.radius(i), mx[i], my[i]), out.data() + 7 * i);
  });
}

// Up to four contacts of each row: points of a and b and distance (7 numbers), and the normal.
void manifolds(const Batch& a, const Batch& b, double margin, Counts counts, DistanceRows normals,
               Contacts out, int threads) {
  const LongCall call;
  each_pair(a, b, counts.shape(0), threads, 64, [&](auto i, Posed& x, Posed& y) {
    const double ra = a.radius(i), rb = b.radius(i);
    const Bodies &p = x.at(i), &q = y.at(i);
    const SignedDistance g = signed_distance(p, q, i, ra, rb);
    const Manifold m = manifold_of(p, q, i, ra, rb, margin, g);
    store(g, normals.data() + 10 * i), counts.data()[i] = m.count;
    for (int k = 0; k < m.count; ++k) {
      double* row = out.data() + 7 * (Manifold::most * i + k);
      std::copy(m.on_a[k].begin(), m.on_a[k].end(), row);
      std::copy(m.on_b[k].begin(), m.on_b[k].end(), row + 3), row[6] = m.distance[k];
    }
  });
}

// Calls body(row) for every row of the batch.
template <class Body>
void each_body(const Batch& bodies, std::size_t rows, int threads, Body body) {
  const LongCall call;
  interruptible_for(rows, threads, 1, [&](auto begin, auto end, auto) {
    Posed placed(bodies);
    for (auto i = begin; i < end; ++i) body(i, RoundedBody(placed.at(i), i, bodies.radius(i)));
  });
}

void mesh_meets(const Mesh& mesh, const Batch& bodies, FaceRows faces, int threads) {
  each_body(bodies, faces.shape(0), threads,
            [&](auto i, const RoundedBody& body) { faces.data()[i] = first_overlap(mesh, body); });
}

// closed: the mesh has an inside.
void mesh_distances(const Mesh& mesh, const Batch& bodies, bool closed, DistanceRows out,
                    FaceRows faces, int threads) {
  each_body(bodies, faces.shape(0), threads, [&](auto i, const RoundedBody& body) {
    FaceDistance nearest = nearest_face(mesh, body);
    if (closed) nearest = deepest_corner(mesh, body, nearest);
    store(nearest.at, out.data() + 10 * i), faces.data()[i] = nearest.face;
  });
}

void mesh_impacts(const Mesh& mesh, const Batch& bodies, Poses pose_a, Vectors linear_a,
                  Vectors angular_a, Poses pose_b, Vectors linear_b, Vectors angular_b, Touches out,
                  FaceRows faces, int threads) {
  const Motions of_mesh{pose_a, linear_a, angular_a}, of_body{pose_b, linear_b, angular_b};
  each_body(bodies, faces.shape(0), threads, [&](auto i, const RoundedBody& body) {
    store(mesh_body_impact(mesh, body, of_mesh[i], of_body[i], faces.data() + i),
          out.data() + 7 * i);
  });
}

}  // namespace

void bind_distances(nb::module_& m) {
  m.def("distances", &distances, "a"_a, "b"_a, "out"_a, "threads"_a);
  m.def("meets", &meets, "a"_a, "b"_a, "hit"_a, "threads"_a);
  m.def("few_distances", &few_distances, "a"_a, "b"_a);
  m.def("few_meets", &few_meets, "a"_a, "b"_a);
  m.def("manifolds", &manifolds, "a"_a, "b"_a, "margin"_a, "counts"_a, "distances"_a, "out"_a,
        "threads"_a);
  m.def("common_points", &common_points, "a"_a, "b"_a, "hit"_a, "out"_a, "threads"_a);
  m.def("time_of_impact", &impacts, "a"_a, "b"_a, "pose_a"_a, "linear_a"_a, "angular_a"_a,
        "pose_b"_a, "linear_b"_a, "angular_b"_a, "out"_a, "threads"_a);
}

void bind_bodies(nb::class_<Mesh>& mesh) {
  mesh.def("meets", &mesh_meets, "bodies"_a, "faces"_a, "threads"_a);
  mesh.def("distances", &mesh_distances, "bodies"_a, "closed"_a, "out"_a, "faces"_a, "threads"_a);
  mesh.def("time_of_impact_of_bodies", &mesh_impacts, "bodies"_a, "pose_mesh"_a, "linear_mesh"_a,
           "angular_mesh"_a, "pose_body"_a, "linear_body"_a, "angular_body"_a, "out"_a, "faces"_a,
           "threads"_a);
}
