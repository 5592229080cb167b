// tauguard.rigid._rigid: overlap and time of impact of convex bodies and of meshes.
#include "tauguard/geometry/interrupt_binding.hpp"

void bind_convex(nanobind::module_& m);

NB_MODULE(_rigid, m) {
  tauguard::geometry::bind_interrupts();
  bind_convex(m);
}
