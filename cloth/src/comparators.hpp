// For comparison only: narrow phases of earlier work. Each has three stages: a filter on the
// coplanarity cubic, the roots of the cubic in floating point, and an inside test with a tolerance
// at each root. They miss collisions and report false ones, as the originals do. The product does
// not call them. They use the product's candidates, differences and cubics, so a comparison
// measures the narrow phase alone.
//
// They follow the published descriptions; missing details were inferred:
//   naive  Provot 1997, Bridson et al. 2002: no filter, all roots.
//   iccd   Tang et al. 2009: the same for each pair. Its contribution is the broad phase: 18-DOPs,
//          and each pair is tested once. Its normal cones are not implemented.
//   dnf    Tang et al. 2010: Bernstein coefficients of one sign. Its projections are left out.
//   scd    Zhang et al. 2014: no sign variation (Descartes) of the cubic in t or in 1 - t.
//   vcd    Zhang et al. 2015: no sign variation after the Moebius map of (0, 1) to (0, inf)
//          (Vincent), counted in the Bernstein coefficients. If there is one variation, there
//          is one root, which is found without splitting.
#pragma once

#include <cstddef>
#include <cstdint>

#include "impact.hpp"
#include "narrow_phase.hpp"

namespace tauguard::cloth {

enum class Comparator : int { naive = 0, iccd, dnf, scd, vcd };

// As solve_vf and solve_ee, without a minimum distance.
void compare_vf(const Ends& x, const std::int32_t* rows, std::size_t n, Comparator comparator,
                std::uint8_t* hit, ImpactArrays impacts, Stats& stats);
void compare_ee(const Ends& x, const std::int32_t* rows, std::size_t n, Comparator comparator,
                std::uint8_t* hit, ImpactArrays impacts, Stats& stats);

}  // namespace tauguard::cloth
