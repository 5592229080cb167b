// The derived error bounds assume round-to-nearest, but the caller or a library that it loaded may
// have set another mode. `RoundToNearest` sets this mode and restores the caller's mode when it is
// destroyed, also by an exception.
#pragma once

#include <cfenv>

namespace tauguard::geometry {

// The largest relative error of one rounding of a double to nearest.
inline constexpr double unit_roundoff = 0x1p-53;

class RoundToNearest {
 public:
  RoundToNearest() : saved_(std::fegetround()) {
    if (saved_ != FE_TONEAREST) std::fesetround(FE_TONEAREST);
  }
  ~RoundToNearest() {
    if (saved_ != FE_TONEAREST) std::fesetround(saved_);
  }
  RoundToNearest(const RoundToNearest&) = delete;
  RoundToNearest& operator=(const RoundToNearest&) = delete;

 private:
  int saved_;
};

}  // namespace tauguard::geometry
