// Overlap of many boxes: eight pairs at a time in single precision with certified bounds. Pairs
// that the bounds leave undecided (boxes close to contact) are then decided one by one.
#include <atomic>
#include <cstring>

#include "convex_boxes.hpp"
#include "convex_overlap.hpp"
#include "convex_resolve.hpp"
#include "tauguard/geometry/interrupt.hpp"

namespace tauguard::rigid {

namespace {

struct Batch {
  const Bodies &a, &b;
  const BoxBlock *blocks_a, *blocks_b;
  double skew;
  std::size_t n;
  std::uint8_t* hit;
};

// Decides row i, which single precision could not decide; true if exact arithmetic was needed.
bool decide_row(const Batch& batch, std::size_t i) {
  Verdict v = box_pair(batch.a.row(i), batch.b.row(i), batch.skew);
  const bool exact = v == undecided;
  if (exact) v = resolve_exactly(batch.a, batch.b, i);
  batch.hit[i] = v == common;
  return exact;
}

TAUGUARD_INLINE std::size_t run_blocks(const Batch& batch, std::size_t begin, std::size_t end) {
  std::size_t left = 0;
  for (std::size_t k = begin; k < end; ++k) {
    Mask8 apart, together;
    box_blocks(batch.blocks_a[batch.a.count == 1 ? 0 : k],
               batch.blocks_b[batch.b.count == 1 ? 0 : k], static_cast<float>(batch.skew), apart,
               together);
    const std::size_t first = 8 * k, lanes = std::min<std::size_t>(8, batch.n - first);
    using Byte8 = std::int8_t __attribute__((vector_size(8)));
    const Byte8 hits = __builtin_convertvector(together & 1, Byte8);
    std::memcpy(batch.hit + first, &hits, lanes);
    if (all_eight(apart | together)) continue;
    for (std::size_t lane = 0; lane < lanes; ++lane)
      if (!apart[lane] && !together[lane]) left += decide_row(batch, first + lane);
  }
  return left;
}

std::size_t run_portable(const Batch& batch, std::size_t begin, std::size_t end) {
  return run_blocks(batch, begin, end);
}

#if defined(TAUGUARD_AVX2)
TAUGUARD_AVX2 std::size_t run_avx2(const Batch& batch, std::size_t begin, std::size_t end) {
  return run_blocks(batch, begin, end);
}
#endif

}  // namespace

Skew box_skew(const double* rotation, std::size_t n, double tolerance) {
  const geometry::RoundToNearest guard;
  Skew out{0.0, n};
  for (std::size_t i = 0; i < n; ++i) {
    const double* r = rotation + 9 * i;
    double worst = 0.0;
    for (int j = 0; j < 3; ++j)
      for (int k = j; k < 3; ++k) {
        const double entry =
            r[j] * r[k] + r[3 + j] * r[3 + k] + r[6 + j] * r[6 + k] - (j == k ? 1.0 : 0.0);
        if (!(std::fabs(entry) <= worst)) worst = std::fabs(entry);
      }
    if (!(worst <= tolerance) && out.first_beyond == n) out.first_beyond = i;
    if (!(worst <= out.largest)) out.largest = worst;
  }
  out.largest += 0x1p-50;  // the rounding of an entry near 1
  return out;
}

void pack_boxes(const double* packed, std::size_t n, double* blocks) {
  const geometry::RoundToNearest guard;
  auto* block = reinterpret_cast<BoxBlock*>(blocks);
  for (std::size_t k = 0; 8 * k < n; ++k, ++block)
    for (std::size_t lane = 0; lane < 8; ++lane) {
      const double* p = packed + 15 * std::min(8 * k + lane, n - 1);
      for (int c = 0; c < 3; ++c) {
        block->center[c][lane] = p[c];
        block->half_extents[c][lane] = static_cast<float>(p[3 + c]);
      }
      for (int c = 0; c < 9; ++c) block->rotation[c][lane] = static_cast<float>(p[6 + c]);
    }
}

std::size_t overlap_boxes(const Bodies& a, const void* blocks_a, const Bodies& b,
                          const void* blocks_b, double skew, std::size_t n, int threads,
                          std::uint8_t* hit) {
  const Batch batch{
      a, b,  static_cast<const BoxBlock*>(blocks_a), static_cast<const BoxBlock*>(blocks_b), skew,
      n, hit};
  auto run = run_portable;
#if defined(TAUGUARD_AVX2)
  if (use_avx2()) run = run_avx2;
#endif
  std::atomic<std::size_t> left{0};
  geometry::interruptible_for((n + 7) / 8, threads, 512,
                              [&](auto begin, auto end, auto) { left += run(batch, begin, end); });
  return left;
}

}  // namespace tauguard::rigid
