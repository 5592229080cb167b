// Lets the errors of a native module be those of tauguard.
#pragma once

#include <nanobind/nanobind.h>

#include <stdexcept>

namespace tauguard::geometry {

// The class tauguard.findings.ArgumentError; ValueError, its base, where a module is loaded by
// itself, as for the generation of its stub.
inline nanobind::object argument_error() {
  try {
    return nanobind::module_::import_("tauguard.findings").attr("ArgumentError");
  } catch (const nanobind::python_error&) { return nanobind::borrow(PyExc_ValueError); }
}

// Call this once per module: std::invalid_argument and std::length_error raise ArgumentError.
inline void bind_argument_errors() {
  nanobind::register_exception_translator([](const std::exception_ptr& p, void*) {
    try {
      std::rethrow_exception(p);
    } catch (const std::invalid_argument& error) {
      PyErr_SetString(argument_error().ptr(), error.what());
    } catch (const std::length_error& error) {
      PyErr_SetString(argument_error().ptr(), error.what());
    }
  });
}

}  // namespace tauguard::geometry
