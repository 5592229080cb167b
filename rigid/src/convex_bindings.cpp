// The convex half of tauguard.rigid._rigid.
#include <nanobind/nanobind.h>

namespace nb = nanobind;

void bind_convex(nb::module_& m) {
  m.def("has_avx2", [] {
#if defined(__x86_64__)
    return static_cast<bool>(__builtin_cpu_supports("avx2"));
#else
    return false;
#endif
  });
}
