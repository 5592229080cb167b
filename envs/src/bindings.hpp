// Declarations that the files of the plant's Python bindings share.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <vector>

#include "physics.hpp"

namespace tauguard::envs {

namespace nb = nanobind;

using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Matrix = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Numbers = std::vector<double>;
// An array that Python made and the plant reads or writes.
using Array = nb::ndarray<double, nb::c_contig, nb::device::cpu>;

// Wraps such an array for the plant and keeps it alive.
inline Held held(const Array& array) {
  Held out(array.data(), {}, std::make_shared<Array>(array));
  for (std::size_t k = 0; k < array.ndim(); ++k) out.add_axis(array.shape(k));
  return out;
}

// Binds the types that a plant is made of: joints, people, surroundings, output rows, controls.
void bind_values(nb::module_& m);

}  // namespace tauguard::envs
