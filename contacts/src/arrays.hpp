// Types of the arrays that are passed between Python and the kernels.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <array>
#include <utility>

#include "sweep.hpp"

namespace tauguard::contacts {

namespace nb = nanobind;
using namespace nb::literals;

using Doubles = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Anything = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Rows3 = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Rows9 = nb::ndarray<const double, nb::shape<-1, 9>, nb::c_contig, nb::device::cpu>;
using Ints = nb::ndarray<const std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using IntRows = nb::ndarray<const std::int32_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Bytes = nb::ndarray<const std::uint8_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Integers = nb::typed<nb::list, int>;
using Mask = nb::ndarray<const std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

template <class T, std::size_t N>
auto owned(std::vector<T>&& values, std::array<std::size_t, N> shape) {
  auto* held = new std::vector<T>(std::move(values));
  nb::capsule owner(held, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  return nb::ndarray<nb::numpy, T>(held->data(), N, shape.data(), owner);
}

inline std::vector<Vec3> vectors(const Rows3& rows) {
  std::vector<Vec3> out(rows.shape(0));
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = {rows.data()[3 * i], rows.data()[3 * i + 1], rows.data()[3 * i + 2]};
  return out;
}

template <class T, class Array>
std::vector<T> list(const Array& values) {
  return std::vector<T>(values.data(), values.data() + values.size());
}

inline std::pair<Shape, LocalFrame> shape_of(int kind, const Doubles& size, double radius,
                                             const Doubles& pos, const Doubles& mat,
                                             const Rows3& vertices) {
  Shape shape{static_cast<Kind>(kind),
              {size.data()[0], size.data()[1], size.data()[2]},
              radius,
              {},
              {},
              {},
              {},
              {}};
  for (const Vec3& v : vectors(vertices))
    shape.x.push_back(v[0]), shape.y.push_back(v[1]), shape.z.push_back(v[2]);
  LocalFrame frame;
  for (int i = 0; i < 3; ++i) {
    frame.row[i] = {mat.data()[3 * i], mat.data()[3 * i + 1], mat.data()[3 * i + 2]};
    frame.at[i] = pos.data()[i];
  }
  return {std::move(shape), frame};
}

// Adds the guarded stepper (stepper.hpp) to the Python module.
void bind_guard(nb::module_& m);

}  // namespace tauguard::contacts
