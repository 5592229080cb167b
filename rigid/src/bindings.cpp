// tauguard.rigid._rigid: overlap and time of impact of convex bodies and of meshes.
#include "tauguard/geometry/interrupt_binding.hpp"

void bind_convex(nanobind::module_& m);

NB_MODULE(_rigid, m) {
  m.doc() = "Overlap and sweeps of convex bodies on arrays. Arguments are checked in Python.";
  tauguard::geometry::bind_interrupts();
  bind_convex(m);
}
