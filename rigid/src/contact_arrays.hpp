// Contacts of meshes as arrays for Python.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "mesh_query.hpp"

namespace tauguard::rigid {

template <class T, std::size_t N>
auto owned(std::vector<T>&& values, std::array<std::size_t, N> shape) {
  auto* held = new std::vector<T>(std::move(values));
  nanobind::capsule owner(held, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  return nanobind::ndarray<nanobind::numpy, T>(held->data(), N, shape.data(), owner);
}

// A contact is a row (pose, face of a, face of b) of the first array and a row (point, normal,
// depth) of the second.
using ContactRows =
    nanobind::typed<nanobind::tuple,
                    nanobind::ndarray<nanobind::numpy, std::int32_t, nanobind::shape<-1, 3>>,
                    nanobind::ndarray<nanobind::numpy, double, nanobind::shape<-1, 7>>>;

// The contacts of every pose.
inline ContactRows contact_arrays(const std::vector<std::vector<Contact>>& found) {
  std::vector<std::int32_t> rows;
  std::vector<double> values;
  for (std::size_t i = 0; i < found.size(); ++i)
    for (const Contact& c : found[i]) {
      rows.insert(rows.end(), {static_cast<std::int32_t>(i), c.a, c.b});
      values.insert(values.end(), {c.point[0], c.point[1], c.point[2], c.normal[0], c.normal[1],
                                   c.normal[2], c.depth});
    }
  const std::size_t count = rows.size() / 3;
  return nanobind::make_tuple(owned(std::move(rows), std::array<std::size_t, 2>{count, 3}),
                              owned(std::move(values), std::array<std::size_t, 2>{count, 7}));
}

}  // namespace tauguard::rigid
