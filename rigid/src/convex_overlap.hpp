// The overlap query over a batch.
#pragma once

#include <cstddef>
#include <cstdint>

#include "convex_bodies.hpp"

namespace tauguard::rigid {

enum class Method : int { abfme = 0, sat = 1, automatic = 2, textbook_sat = 3, exact = 4 };

// Writes 1 (common) or 0 (separated) for rows [0, n); exact for every method but textbook_sat, whose
// answers carry the rounding errors of its arithmetic. Returns how many rows the filters left undecided.
std::size_t overlap(const Bodies& a, const Bodies& b, std::size_t n, Method method, int threads,
                    std::uint8_t* hit);

void witnesses(const Bodies& a, const Bodies& b, std::size_t n, int threads, double* out);

}  // namespace tauguard::rigid
