// tauguard.rigid._rigid: overlap and time of impact of convex bodies and of meshes.
#include <nanobind/nanobind.h>

void bind_convex(nanobind::module_& m);

NB_MODULE(_rigid, m) { bind_convex(m); }
