#include "k_dop.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>

#include "tauguard/geometry/aabb.hpp"
#include "tauguard/geometry/k_dop.hpp"
#include "tauguard/geometry/lanes.hpp"
#include "tauguard/geometry/thread_pool.hpp"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace tauguard::cloth {
namespace {

using geometry::Aabb;
using geometry::ThreadPool;

constexpr std::size_t grain = 4096;

Aabb bounds(const Ends& x, std::size_t n, int threads) {
  Aabb all;
  std::mutex mutex;
  ThreadPool::shared().parallel_for(n, threads, grain, [&](auto begin, auto end, auto) {
    Aabb part;
    for (auto i = begin; i < end; ++i) {
      part.add(x.at(false, static_cast<std::int32_t>(i)));
      part.add(x.at(true, static_cast<std::int32_t>(i)));
    }
    const std::lock_guard<std::mutex> lock(
        mutex);  // minima and maxima: any order gives the same box
    all.add(part);
  });
  return all;
}

// The power of two that brings |x| <= size to at most 1, within the range that doubles can hold.
double shrink(double size) {
  if (!(size > 0)) return 1;
  return std::ldexp(1.0, std::clamp(-(std::ilogb(size) + 1), -1030, 1000));
}

TAUGUARD_INLINE void convert(geometry::Float4 x, std::int16_t* to) {
  constexpr float most = shorts_of_unit;
  x = most * x;
  x = x < most ? x : geometry::Float4{} + most;
#if defined(__x86_64__)
  const __m128i whole = _mm_cvttps_epi32(x);  // -2^31 for any x below -2^31
  _mm_storel_epi64(reinterpret_cast<__m128i*>(to), _mm_packs_epi32(whole, whole));
#else
  for (int i = 0; i < 4; ++i) to[i] = static_cast<std::int16_t>(x[i] > -most ? x[i] : -most);
#endif
}

}  // namespace

const std::int8_t (*axes_of(int k))[3] {
  switch (k) {
    case 6:
    case 16:
    case 18:
    case 26:
      return geometry::k_dop_axes;
    case 14:
      return geometry::k_dop_corner_axes;
    default:
      throw std::invalid_argument("k_dop" + std::to_string(k) +
                                  ": expected k = 6, 14, 16, 18 or 26");
  }
}

void Projection::scale_to(const Ends& x, std::size_t n, VolumeKind kind, double min_distance,
                          int threads) {
  kind_ = kind;
  const auto* axis = axes_of(kind.k);
  std::fill(pad_, pad_ + most_slots, 0.0f);
  double largest = 0;
  const Aabb raw = bounds(x, n, threads);
  for (int k = 0; k < 3 && n > 0; ++k) largest = std::max({largest, -raw.lo[k], raw.hi[k]});
  first_ = shrink(largest);
  double extent = 0;
  for (int k = 0; k < 3 && n > 0; ++k) {
    const double lo = raw.lo[k] * first_, hi = raw.hi[k] * first_;
    centre_[k] = (lo + hi) / 2;
    extent = std::max({extent, hi - centre_[k], centre_[k] - lo});
  }
  second_ = shrink(extent);

  for (int a = 0; a < kind.axes(); ++a) {
    const int terms = std::abs(axis[a][0]) + std::abs(axis[a][1]) + std::abs(axis[a][2]);
    // Half of the minimum distance in scaled units, times |axis| / 2^(terms - 1). If it is too
    // large for float32, it becomes infinite; then nothing is apart, which is conservative.
    const double margin =
        0.5 * min_distance * first_ * second_ * std::sqrt(double(terms)) / (1 << (terms - 1));
    const double padded = margin * (1 + 0x1p-20) + 0x1p-22;
    pad_[a] = padded < 1e30 ? static_cast<float>(padded) : std::numeric_limits<float>::infinity();
  }
}

void Projection::set(const Ends& x, std::size_t n, bool in_short, int threads) {
  const int slots = kind_.slots();
  const auto* axes = axes_of(kind_.k);
  double axis[3][most_slots] = {};  // divided by 2^(m - 1)
  for (int a = 0; a < kind_.axes(); ++a) {
    const int terms = std::abs(axes[a][0]) + std::abs(axes[a][1]) + std::abs(axes[a][2]);
    for (int k = 0; k < 3; ++k) axis[k][a] = axes[a][k] / double(1 << (terms - 1));
  }
  if (std::exchange(in_short_, in_short) != in_short) {  // frees the other values
    values_ = {};
    shorts_ = {};
  }
  values_.resize(in_short ? 0 : 2 * slots * n);
  shorts_.resize(in_short ? 4 * slots * n : 0);
  ThreadPool::shared().parallel_for(n, threads, grain, [&](auto begin, auto end, auto) {
    const double first = first_, second = second_, *centre = centre_;
    for (auto i = begin; i < end; ++i)
      for (int r = 0; r < 2 * slots; r += 4) {
        const double* p = x.at(r >= slots, static_cast<std::int32_t>(i));
        geometry::Double4 sum{};
        for (int k = 0; k < 3; ++k)
          sum += (p[k] * first - centre[k]) * second * geometry::load4(axis[k] + r % slots);
        const auto at = __builtin_convertvector(sum, geometry::Float4);
        if (!in_short) {
          std::memcpy(values_.data() + 2 * slots * i + r, &at, sizeof at);
          continue;
        }
        geometry::Float4 pad;
        std::memcpy(&pad, pad_ + r % slots, sizeof pad);
        std::int16_t* low = shorts_.data() + 4 * slots * i + r;
        convert(at - pad, low);
        convert(at + pad, low + 2 * slots);
      }
  });
}

}  // namespace tauguard::cloth
