// Eight floats at once. One source, compiled by TAUGUARD_CLONES for AVX2 as well; no contraction,
// so the bits are the portable ones.
#pragma once

#include <cstdint>
#include <cstring>

#include "tauguard/geometry/lanes.hpp"

namespace tauguard::rigid {

typedef float Wide __attribute__((vector_size(32)));
typedef std::int32_t Bits __attribute__((vector_size(32)));

}  // namespace tauguard::rigid

// Macros, not functions: a function would be compiled once, for the portable set only.
#define TAUGUARD_WIDE_ABS(x) ((Wide)((Bits)(x) & ((Bits){} + 0x7fffffff)))
// The lanes whose bits are all set, as an integer of eight bits.
#define TAUGUARD_WIDE_LANES(hit, out)                                         \
  do {                                                                        \
    const Bits lane_ = {1, 2, 4, 8, 16, 32, 64, 128};                         \
    const Bits flags_ = (hit) & lane_;                                        \
    std::uint64_t word_[4];                                                   \
    std::memcpy(word_, &flags_, sizeof word_);                                \
    const std::uint64_t any_ = (word_[0] | word_[1]) | (word_[2] | word_[3]); \
    (out) = static_cast<unsigned>(any_ | (any_ >> 32)) & 0xff;                \
  } while (false)
