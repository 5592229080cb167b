// Converts doubles to integers of fixed width in a common unit, a power of two. The unit has no
// influence on a contact or its time.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>

#include "tauguard/geometry/fixed_int.hpp"

namespace tauguard::cloth {

// A finite double as mantissa * 2^exponent; the mantissa is odd or zero.
struct Binary {
  std::int64_t mantissa;
  int exponent;
  explicit Binary(double x) {
    std::uint64_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    const int field = static_cast<int>(bits >> 52 & 0x7ff);
    mantissa = static_cast<std::int64_t>((bits & ((std::uint64_t{1} << 52) - 1)) |
                                         std::uint64_t{field != 0} << 52);
    const int zeros = mantissa ? __builtin_ctzll(mantissa) : 0;
    mantissa >>= zeros;
    exponent = std::max(field, 1) - 1075 + zeros;
    if (bits >> 63) mantissa = -mantissa;
  }
  int bits() const { return 64 - __builtin_clzll(mantissa < 0 ? -mantissa : mantissa); }
};

// Writes n doubles as integers in a common unit; false if they span more than `coordinate_bits`.
inline constexpr int coordinate_bits = 116;
inline bool as_integers(const double* x, int n, geometry::FixedInt<2>* out) {
  int least = std::numeric_limits<int>::max(), most = std::numeric_limits<int>::min();
  for (int i = 0; i < n; ++i) {
    const Binary b(x[i]);
    if (b.mantissa == 0) continue;
    least = std::min(least, b.exponent);
    most = std::max(most, b.exponent + b.bits());
  }
  if (least < most && most - least > coordinate_bits) return false;
  for (int i = 0; i < n; ++i) {
    const Binary b(x[i]);
    out[i] = geometry::FixedInt<2>(b.mantissa).shifted(b.mantissa ? b.exponent - least : 0);
  }
  return true;
}

}  // namespace tauguard::cloth
