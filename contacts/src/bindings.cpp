// tauguard.contacts._contacts: a scene's pairs over one step. Arguments are checked in Python.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <mutex>

#include "sweep.hpp"
#include "tauguard/geometry/rounding.hpp"
#include "verdict.hpp"

namespace nb = nanobind;
using namespace tauguard::contacts;

using Doubles = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Anything = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Rows3 = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Rows9 = nb::ndarray<const double, nb::shape<-1, 9>, nb::c_contig, nb::device::cpu>;
using Ints = nb::ndarray<const std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using IntRows = nb::ndarray<const std::int32_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Bytes = nb::ndarray<const std::uint8_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Mask = nb::ndarray<const std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

namespace {

template <class T, std::size_t N>
auto owned(std::vector<T>&& values, std::array<std::size_t, N> shape) {
  auto* held = new std::vector<T>(std::move(values));
  nb::capsule owner(held, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  return nb::ndarray<nb::numpy, T>(held->data(), N, shape.data(), owner);
}

std::vector<Vec> vectors(const Rows3& rows) {
  std::vector<Vec> out(rows.shape(0));
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = {rows.data()[3 * i], rows.data()[3 * i + 1], rows.data()[3 * i + 2]};
  return out;
}

Poses poses_of(const Rows3& xpos_t0, const Rows9& xmat_t0, const Rows3& xpos_t1,
               const Rows9& xmat_t1) {
  return {xpos_t0.data(), xmat_t0.data(), xpos_t1.data(), xmat_t1.data()};
}

// Rows as (first, second, feature) and (time, distance, point, normal), and the counts.
nb::tuple answer(const std::vector<Row>& rows, const Counts& counts) {
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

template <class T, class Array>
std::vector<T> list(const Array& values) {
  return std::vector<T>(values.data(), values.data() + values.size());
}

std::pair<Shape, Frame> shape_of(int core, const Doubles& size, double radius, const Doubles& pos,
                                 const Doubles& mat, const Rows3& vertices) {
  Shape shape{static_cast<Core>(core),
              {size.data()[0], size.data()[1], size.data()[2]},
              radius,
              {},
              {},
              {},
              {},
              {}};
  for (const Vec& v : vectors(vertices))
    shape.x.push_back(v[0]), shape.y.push_back(v[1]), shape.z.push_back(v[2]);
  Frame frame;
  for (int i = 0; i < 3; ++i) {
    frame.row[i] = {mat.data()[3 * i], mat.data()[3 * i + 1], mat.data()[3 * i + 2]};
    frame.at[i] = pos.data()[i];
  }
  return {std::move(shape), frame};
}

// The geoms of a scene and which of them meet.
class Scene {
 public:
  void add(int core, Doubles size, double radius, int body, Doubles pos, Doubles mat,
           Rows3 vertices, Rows3 normals, Rows3 edges) {
    auto [shape, frame] = shape_of(core, size, radius, pos, mat, vertices);
    shape.normals = vectors(normals), shape.edges = vectors(edges);
    geoms_.add(std::move(shape), body, frame);
  }

  // The surface of the geom added last, instead of its hull.
  void surface(Rows3 vertices, IntRows faces) {
    const std::vector<Vec> points = vectors(vertices);
    Surface surface;
    for (std::size_t i = 0; i < faces.shape(0); ++i) {
      Shape triangle{Core::hull, {0, 0, 0}, 0, {}, {}, {}, {}, {}};
      Vec middle{};
      for (int k = 0; k < 3; ++k) {
        const Vec& p = points[faces.data()[3 * i + k]];
        triangle.x.push_back(p[0]), triangle.y.push_back(p[1]), triangle.z.push_back(p[2]);
        middle = middle + (1.0 / 3) * p;
      }
      double radius = 0;
      for (int k = 0; k < 3; ++k)
        radius = std::max(radius, norm(points[faces.data()[3 * i + k]] - middle));
      surface.triangles.push_back(std::move(triangle));
      surface.centre.push_back(middle), surface.radius.push_back(radius);
    }
    geoms_.add_surface(std::move(surface));
  }

  void pairs(IntRows pairs, Doubles reach) {
    std::vector<GeomPair> list(pairs.shape(0));
    for (std::size_t i = 0; i < list.size(); ++i)
      list[i] = {pairs.data()[2 * i], pairs.data()[2 * i + 1], reach.data()[i]};
    rigid_ = RigidPairs(std::move(list));
  }

  nb::tuple find(Rows3 xpos_t0, Rows9 xmat_t0, Rows3 xpos_t1, Rows9 xmat_t1) {
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

  nb::tuple find_flex(Rows3 xpos_t0, Rows9 xmat_t0, Rows3 xpos_t1, Rows9 xmat_t1, Rows3 x_t0,
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

// Judges steps between the poses in two fixed sets of arrays: those of two MjData.
class Judge {
 public:
  Judge(Rows3 xpos_t0, Rows9 xmat_t0, Rows3 xpos_t1, Rows9 xmat_t1, Rows3 x_t0, Rows3 x_t1)
      : xpos_t0_(xpos_t0),
        xpos_t1_(xpos_t1),
        x_t0_(x_t0),
        x_t1_(x_t1),
        xmat_t0_(xmat_t0),
        xmat_t1_(xmat_t1) {}

  int add(int core, Doubles size, double radius, int body, Doubles pos, Doubles mat,
          Rows3 vertices) {
    const auto [shape, frame] = shape_of(core, size, radius, pos, mat, vertices);
    return verdict_.add(shape, body, frame);
  }

  void pair(Ints a, Ints b) { verdict_.add_pair(list<std::int32_t>(a), list<std::int32_t>(b)); }

  void flex_pair(Ints a, Doubles radii, IntRows elements, Bytes skip) {
    verdict_.add_flex_pair(list<std::int32_t>(a), list<double>(radii), list<std::int32_t>(elements),
                           static_cast<int>(elements.shape(1)), list<std::uint8_t>(skip));
  }

  // None, or rows (pair, feature, level, deepest) and (t, way).
  nb::object judge() {
    std::vector<Hit> hits;
    {
      const tauguard::geometry::RoundToNearest guard;
      verdict_.judge(poses_of(xpos_t0_, xmat_t0_, xpos_t1_, xmat_t1_), x_t0_.data(), x_t1_.data(),
                     &hits);
    }
    if (hits.empty()) return nb::none();
    std::vector<std::int32_t> ids;
    std::vector<double> values;
    for (const Hit& h : hits) {
      ids.insert(ids.end(), {h.pair, h.feature, h.level, h.deepest});
      values.insert(values.end(), {h.t, h.way});
    }
    return nb::make_tuple(owned(std::move(ids), std::array<std::size_t, 2>{hits.size(), 4}),
                          owned(std::move(values), std::array<std::size_t, 2>{hits.size(), 2}));
  }

 private:
  Rows3 xpos_t0_, xpos_t1_, x_t0_, x_t1_;
  Rows9 xmat_t0_, xmat_t1_;
  Verdict verdict_;
};

// Points (V, 3) that bodies carry, in the order of MuJoCo's own sums so that the bits are its own.
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
    // x - x is 0, or NaN where x is not finite; a sum of them needs no branch.
    double sum = 0;
    for (std::size_t i = 0; i < values->size(); ++i) sum += x[i] - x[i];
    if (sum != 0) return false;
  }
  return true;
}

// Rows (simplex, simplex), of two lists, that come within `distance` of one another.
nb::tuple simplices(Rows3 x_t0, Rows3 x_t1, IntRows a, IntRows b, IntRows pairs, double distance) {
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
  nb::class_<Scene>(m, "Scene")
      .def(nb::init<>())
      .def("add", &Scene::add)
      .def("surface", &Scene::surface)
      .def("pairs", &Scene::pairs)
      .def("find", &Scene::find)
      .def("find_flex", &Scene::find_flex);
  nb::class_<Judge>(m, "Judge")
      .def(nb::init<Rows3, Rows9, Rows3, Rows9, Rows3, Rows3>())
      .def("add", &Judge::add)
      .def("pair", &Judge::pair)
      .def("flex_pair", &Judge::flex_pair)
      .def("judge", &Judge::judge);
  m.def("carried", &carried);
  m.def("simplices", &simplices);
  m.def("all_finite", &all_finite);
}
