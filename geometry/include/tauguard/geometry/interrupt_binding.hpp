// Lets Ctrl-C end the calls of a native module.
#pragma once

#include <nanobind/nanobind.h>

#include "tauguard/geometry/interrupt.hpp"

namespace tauguard::geometry {

// Call this once per module. An interrupted call raises the exception of the signal handler.
inline void bind_interrupts() {
  InterruptScope::ask = [] {
    const nanobind::gil_scoped_acquire hold;
    return PyErr_CheckSignals() != 0;
  };
  nanobind::register_exception_translator([](const std::exception_ptr& p, void*) {
    try {
      std::rethrow_exception(p);
    } catch (const Interrupted&) {
      if (!PyErr_Occurred()) PyErr_SetNone(PyExc_KeyboardInterrupt);
    }
  });
}

// While the object lives, the interpreter's lock is released and Ctrl-C can end the call.
class LongCall {
  nanobind::gil_scoped_release release_;
  InterruptScope scope_;
};

}  // namespace tauguard::geometry
