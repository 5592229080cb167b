// Narrow phases of earlier work, as strategies over shared parts: a filter on the coplanarity
// cubic, its roots in floating point, and an inside test with a tolerance at each root. They can
// miss and report falsely, as the originals can. Written from the published descriptions; inferred
// where those are silent:
//   naive  Provot 1997, Bridson et al. 2002: no filter, all roots.
//   iccd   Tang et al. 2009: the same per pair; its own part is the broad phase, of which 18-DOPs
//   and testing
//          each pair once are here and normal cones are not.
//   dnf    Tang et al. 2010: Bernstein coefficients of one sign; its projections are left out.
//   scd    Zhang et al. 2014: no sign variation (Descartes) of the cubic in t or in 1 - t.
//   vcd    Zhang et al. 2015: no sign variation after the Moebius map of (0, 1) to (0, inf)
//   (Vincent), which
//          is the Bernstein form's; one variation is one root, found without splitting.
#pragma once

#include "narrow_phase.hpp"
#include "query.hpp"

namespace tauguard::cloth {

bool filtered_out(const Cubic& c, Method method);
// The first root at which the features meet, or infinity.
double first_root_inside(const Query& k, const Cubic& c, Method method, bool vf);

}  // namespace tauguard::cloth
