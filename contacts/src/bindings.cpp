// tauguard.contacts._contacts: contacts of a scene in one step. Arguments are checked in Python.
#include <mutex>

#include "arrays.hpp"
#include "tauguard/geometry/argument_errors.hpp"
#include "tauguard/geometry/rounding.hpp"

using namespace tauguard::contacts;

namespace {

Poses poses_of(const Rows3& xpos_t0, const Rows9& xmat_t0, const Rows3& xpos_t1,
               const Rows9& xmat_t1) {
  return {xpos_t0.data(), xmat_t0.data(), xpos_t1.data(), xmat_t1.data()};
}

// Contacts: rows (first, second, feature), rows (time, distance, point, normal), counts of work.
using Answer = nb::typed<nb::tuple, nb::ndarray<nb::numpy, std::int32_t, nb::shape<-1, 3>>,
                         nb::ndarray<nb::numpy, double, nb::shape<-1, 8>>,
                         nb::typed<nb::tuple, int, int, int>>;

Answer answer(const std::vector<Row>& rows, const Counts& counts) {
  std::vector<std::int32_t> ids;
  std::vector<double> values;
  ids.reserve(3 * rows.size()), values.reserve(8 * rows.size());
  for (const Row& r : rows) {
    ids.insert(ids.end(), {r.first, r.second, r.feature});
    values.insert(values.end(), {r.t, r.distance, r.point[0], r.point[1], r.point[2], r.normal[0],
                                 r.normal[1], r.normal[2]});
  }
  return nb::make_tuple(owned(std::move(ids), std::array<std::size_t, 2>{rows.size(), 3}),
                        owned(std::move(values), std::array<std::size_t, 2>{rows.size(), 8}),
                        nb::make_tuple(counts.moved, counts.reused, counts.candidates));
}

// The geoms of a scene and the pairs that may touch.
class Scene {
 public:
  void add(int kind, Doubles size, double radius, int body, Doubles pos, Doubles mat,
           Rows3 vertices, Rows3 normals, Rows3 edges) {
    auto [shape, frame] = shape_of(kind, size, radius, pos, mat, vertices);
    shape.normals = vectors(normals), shape.edges = vectors(edges);
    geoms_.add(std::move(shape), body, frame);
  }

  void pairs(IntRows pairs, Doubles reach) {
    std::vector<GeomPair> list(pairs.shape(0));
    for (std::size_t i = 0; i < list.size(); ++i)
      list[i] = {pairs.data()[2 * i], pairs.data()[2 * i + 1], reach.data()[i]};
    rigid_ = RigidPairs(std::move(list));
  }

  Answer find(Rows3 xpos_t0, Rows9 xmat_t0, Rows3 xpos_t1, Rows9 xmat_t1) {
    std::vector<Row> rows;
    Counts counts;
    {
      nb::gil_scoped_release release;
      const std::lock_guard lock(busy_);
      const tauguard::geometry::RoundToNearest guard;
      counts = rigid_.find(geoms_, poses_of(xpos_t0, xmat_t0, xpos_t1, xmat_t1), &rows);
    }
    return answer(rows, counts);
  }

  Answer find_flex(Rows3 xpos_t0, Rows9 xmat_t0, Rows3 xpos_t1, Rows9 xmat_t1, Rows3 x_t0,
                   Rows3 x_t1, IntRows elements, double radius, Ints with, Doubles reach,
                   Mask skip) {
    std::vector<Row> rows;
    Counts counts;
    {
      nb::gil_scoped_release release;
      const std::lock_guard lock(busy_);
      const tauguard::geometry::RoundToNearest guard;
      std::vector<FlexPair> pairs(with.shape(0));
      for (std::size_t i = 0; i < pairs.size(); ++i)
        pairs[i] = {with.data()[i], reach.data()[i], skip.data() + i * skip.shape(1)};
      counts = tauguard::contacts::find_flex(geoms_, poses_of(xpos_t0, xmat_t0, xpos_t1, xmat_t1),
                                             x_t0.data(), x_t1.data(), elements.data(),
                                             elements.shape(0), static_cast<int>(elements.shape(1)),
                                             radius, pairs, &rows);
    }
    return answer(rows, counts);
  }

 private:
  Geoms geoms_;
  RigidPairs rigid_{{}};
  std::mutex busy_;
};

// World positions of points `local` (V, 3) on bodies, summed in MuJoCo's order for equal bits.
auto carried(Rows3 xpos, Rows9 xmat, Ints body, Rows3 local) {
  std::vector<double> out(3 * body.size());
  for (std::size_t i = 0; i < body.size(); ++i) {
    const double *at = xpos.data() + 3 * body.data()[i], *r = xmat.data() + 9 * body.data()[i];
    const double* v = local.data() + 3 * i;
    const bool origin = v[0] == 0 && v[1] == 0 && v[2] == 0;
    for (int k = 0; k < 3; ++k)
      out[3 * i + k] =
          origin ? at[k] : r[3 * k] * v[0] + r[3 * k + 1] * v[1] + r[3 * k + 2] * v[2] + at[k];
  }
  const std::size_t count = body.size();
  return owned(std::move(out), std::array<std::size_t, 2>{count, 3});
}

// Whether every number of a state is finite.
bool all_finite(Anything a, Anything b, Anything c) {
  for (const Anything* values : {&a, &b, &c}) {
    const double* x = values->data();
    // x - x is 0, or NaN if x is not finite. Summing needs no branch.
    double sum = 0;
    for (std::size_t i = 0; i < values->size(); ++i) sum += x[i] - x[i];
    if (sum != 0) return false;
  }
  return true;
}

// Contacts of simplices from the lists `a` and `b`: the `pairs` that come within `distance`.
Answer simplices(Rows3 x_t0, Rows3 x_t1, IntRows a, IntRows b, IntRows pairs, double distance) {
  std::vector<Row> rows;
  {
    nb::gil_scoped_release release;
    const tauguard::geometry::RoundToNearest guard;
    const int corners = static_cast<int>(a.shape(1));
    for (std::size_t i = 0; i < pairs.shape(0); ++i) {
      const std::int32_t first = pairs.data()[2 * i], second = pairs.data()[2 * i + 1];
      Touch touch;
      if (simplices_touch(x_t0.data(), x_t1.data(), a.data() + corners * first,
                          b.data() + corners * second, corners, distance, &touch))
        rows.push_back({first, second, -1, touch.t, touch.distance, touch.point, touch.normal});
    }
  }
  return answer(rows, Counts{});
}

}  // namespace

NB_MODULE(_contacts, m) {
  nb::set_leak_warnings(false);  // a callback of MuJoCo may keep a guard alive until the end
  tauguard::geometry::bind_argument_errors();
  m.doc() = "Contacts of a moving scene, and the guarded stepper. Arguments are checked in Python.";
  nb::class_<Scene>(m, "Scene")
      .def(nb::init<>())
      .def("add", &Scene::add, "kind"_a, "size"_a, "radius"_a, "body"_a, "pos"_a, "mat"_a,
           "vertices"_a, "normals"_a, "edges"_a)
      .def("pairs", &Scene::pairs, "pairs"_a, "reach"_a)
      .def("find", &Scene::find, "xpos_t0"_a, "xmat_t0"_a, "xpos_t1"_a, "xmat_t1"_a)
      .def("find_flex", &Scene::find_flex, "xpos_t0"_a, "xmat_t0"_a, "xpos_t1"_a, "xmat_t1"_a,
           "x_t0"_a, "x_t1"_a, "elements"_a, "radius"_a, "geoms"_a, "reach"_a, "skip"_a);
  bind_guard(m);
  m.def("carried", &carried, "xpos"_a, "xmat"_a, "body"_a, "local"_a);
  m.def("simplices", &simplices, "x_t0"_a, "x_t1"_a, "a"_a, "b"_a, "pairs"_a, "distance"_a);
  m.def("all_finite", &all_finite, "a"_a, "b"_a, "c"_a);
}
