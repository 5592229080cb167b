// Ctrl-C in the calls of a native module.
#pragma once

#include <nanobind/nanobind.h>

#include "tauguard/geometry/interrupt.hpp"

namespace tauguard::geometry {

// Call this once in a module. An interrupted call raises the exception of the signal's handler.
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

// Use it around a kernel. It releases the interpreter's lock and lets Ctrl-C end the call.
class LongCall {
  nanobind::gil_scoped_release release_;
  InterruptScope scope_;
};

}  // namespace tauguard::geometry
