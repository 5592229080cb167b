// The bounds of a tree's features and nodes in a step.
#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>

#include "feature_tree.hpp"
#include "tauguard/geometry/thread_pool.hpp"

namespace tauguard::cloth {
namespace {

using geometry::ThreadPool;

// Bounds of nothing: below and above all bounds of points.
template <class Bound>
constexpr Bound nothing_high = std::numeric_limits<Bound>::lowest();
template <class Bound>
constexpr Bound nothing_low = std::numeric_limits<Bound>::max();
template <>
constexpr float nothing_high<float> = -std::numeric_limits<float>::infinity();
template <>
constexpr float nothing_low<float> = std::numeric_limits<float>::infinity();

// One bound of a feature on every axis slot at both ends of the step, [end][slot].
template <int slots, class Bound>
struct Row {
  static constexpr int size = 2 * slots, wide = 16 / sizeof(Bound), count = size / wide;
  typedef Bound Wide __attribute__((vector_size(16)));
  Wide value[count];

  void fill(Bound x) { std::fill(value, value + count, Wide{} + x); }
  void load(const Bound* from) { std::memcpy(value, from, sizeof value); }
  void lower_to(const Row& o) {
    for (int i = 0; i < count; ++i) value[i] = o.value[i] < value[i] ? o.value[i] : value[i];
  }
  void raise_to(const Row& o) {
    for (int i = 0; i < count; ++i) value[i] = value[i] < o.value[i] ? o.value[i] : value[i];
  }
  // Exchanges both ends of the step.
  Row other_end() const {
    Row other;
    std::memcpy(&other, reinterpret_cast<const Bound*>(value) + slots, sizeof value / 2);
    std::memcpy(reinterpret_cast<Bound*>(other.value) + slots, value, sizeof value / 2);
    return other;
  }
};

// The lower and the upper bounds of a point.
template <int slots>
TAUGUARD_INLINE void load(const Projection& points, std::int32_t v, Row<slots, std::int16_t>& low,
                          Row<slots, std::int16_t>& high) {
  low.load(points.shorts_of(v));
  high.load(points.shorts_of(v) + 2 * slots);
}
template <int slots>
TAUGUARD_INLINE void load(const Projection& points, std::int32_t v, Row<slots, float>& low,
                          Row<slots, float>& high) {
  Row<slots, float> pad;
  for (int r = 0; r < 2 * slots; r += slots)
    std::memcpy(reinterpret_cast<float*>(pad.value) + r, points.pad(), slots * sizeof(float));
  low.load(points.of(v));
  for (int i = 0; i < low.count; ++i) {
    high.value[i] = low.value[i] + pad.value[i];
    low.value[i] -= pad.value[i];
  }
}

TAUGUARD_INLINE geometry::Float4 alternate(geometry::Float4 a, geometry::Float4 b, bool first) {
  return first ? __builtin_shufflevector(a, b, 0, 4, 1, 5)
               : __builtin_shufflevector(a, b, 2, 6, 3, 7);
}
using Short8 = std::int16_t __attribute__((vector_size(16)));
TAUGUARD_INLINE Short8 alternate(Short8 a, Short8 b, bool first) {
  return first ? __builtin_shufflevector(a, b, 0, 8, 1, 9, 2, 10, 3, 11)
               : __builtin_shufflevector(a, b, 4, 12, 5, 13, 6, 14, 7, 15);
}

// Writes the lower or upper bounds of 16 volumes into a block. Squares of values are transposed:
// each round brings values of two rows that are half a square apart side by side.
template <int slots, class Bound>
void write_lanes(const Row<slots, Bound>* rows, int axes, int times, Bound* block) {
  using R = Row<slots, Bound>;
  for (int i = 0; i * R::wide < times * slots; ++i)
    for (int lane = 0; lane < lanes; lane += R::wide) {
      typename R::Wide square[R::wide], next[R::wide];
#pragma GCC unroll 8
      for (int j = 0; j < R::wide; ++j) square[j] = rows[lane + j].value[i];
#pragma GCC unroll 3
      for (int round = 1; round < R::wide; round *= 2) {
#pragma GCC unroll 8
        for (int j = 0; j < R::wide; ++j)
          next[j] = alternate(square[j / 2], square[j / 2 + R::wide / 2], j % 2 == 0);
#pragma GCC unroll 8
        for (int j = 0; j < R::wide; ++j) square[j] = next[j];
      }
#pragma GCC unroll 8
      for (int j = 0; j < R::wide; ++j) {
        const int r = i * R::wide + j, t = r / slots, axis = r % slots;
        if (axis < axes && t < times)
          std::memcpy(block + (axis * times + t) * 2 * lanes + lane, &square[j], sizeof square[j]);
      }
    }
}

}  // namespace

template <int slots, class Bound>
void FeatureTree::fit_leaf(std::int32_t leaf, const Projection& points, Bounds<Bound>& out) const {
  using R = Row<slots, Bound>;
  const std::int32_t* v = vertices(leaf);
  // Vertices are scattered in memory, so the vertices of the next leaf are prefetched.
  if (leaf + 1 < leaves_)
    for (int i = 0; i < lanes * arity_; ++i) {
      const std::int32_t next = std::max(v[lanes * arity_ + i], 0);
      __builtin_prefetch(short_ ? static_cast<const void*>(points.shorts_of(next))
                                : static_cast<const void*>(points.of(next)));
    }
  R low[lanes], high[lanes], node_low, node_high, least, most;
  node_low.fill(nothing_low<Bound>);
  node_high.fill(nothing_high<Bound>);
  for (int lane = 0; lane < lanes; ++lane) {
    if (!(occupied_[leaf] >> lane & 1)) {
      low[lane].fill(nothing_low<Bound>);
      high[lane].fill(nothing_high<Bound>);
      continue;
    }
    R lows, highs;
    load(points, v[lane], lows, highs);
    for (int j = 1; j < arity_; ++j) {
      load(points, v[j * lanes + lane], least, most);
      lows.lower_to(least);
      highs.raise_to(most);
    }
    if (times_ == 1) {
      lows.lower_to(lows.other_end());
      highs.raise_to(highs.other_end());
    }
    node_low.lower_to(lows);
    node_high.raise_to(highs);
    low[lane] = lows;
    high[lane] = highs;
  }
  Bound* block = out.blocks.data() + leaf * block_stride();
  write_lanes(low, axes_, times_, block);
  write_lanes(high, axes_, times_, block + lanes);
  Bound* node = out.nodes.data() + (leaves_ + std::size_t(leaf)) * node_stride();
  for (int t = 0; t < times_; ++t, node += 2 * slots) {
    std::memcpy(node, reinterpret_cast<const Bound*>(node_low.value) + t * slots,
                slots * sizeof(Bound));
    std::memcpy(node + slots, reinterpret_cast<const Bound*>(node_high.value) + t * slots,
                slots * sizeof(Bound));
  }
}

template <int slots, class Bound>
void FeatureTree::fit(const Projection& points, int threads, Bounds<Bound>& out) {
  const std::size_t n = leaves_, stride = node_stride();
  out.blocks.resize(n * block_stride());
  out.nodes.resize(2 * n * stride);
  auto& pool = ThreadPool::shared();
  pool.parallel_for(n, threads, 128, [&](auto begin, auto end, auto) {
    for (auto i = begin; i < end; ++i)
      fit_leaf<slots, Bound>(static_cast<std::int32_t>(i), points, out);
  });
  std::size_t level = 1;
  while (2 * level < n) level *= 2;
  for (; level >= 1 && n > 1; level /= 2)
    pool.parallel_for(
        std::min(2 * level, n) - level, threads, 1024, [&](auto begin, auto end, auto) {
          Bound* up = out.nodes.data() + (level + begin) * stride;
          const Bound *a = out.nodes.data() + 2 * (level + begin) * stride, *b = a + stride;
          for (auto i = begin; i < end; ++i, a += stride, b += stride)
            for (int t = 0; t < times_; ++t, up += 2 * slots, a += 2 * slots, b += 2 * slots) {
              Side<slots, Bound> x[2], y[2];  // low, high
              std::memcpy(x, a, sizeof x);
              std::memcpy(y, b, sizeof y);
              x[0] = y[0] < x[0] ? y[0] : x[0];
              x[1] = x[1] < y[1] ? y[1] : x[1];
              std::memcpy(up, x, sizeof x);
            }
        });
  double sum = 0;
  for (std::size_t i = n; i < 2 * n; ++i) {
    const Bound* v = out.nodes.data() + i * stride;
    for (int k = 0; k < 3 && occupied_[i - n]; ++k) sum += double(v[slots + k]) - v[k];
  }
  spread_ = short_ ? sum / shorts_of_unit : sum;
}

void FeatureTree::refit(const Projection& points, int threads) {
  axes_ = points.kind().axes();
  slots_ = points.kind().slots();
  times_ = points.kind().times();
  if (std::exchange(short_, points.in_short()) != short_) {  // frees the other bounds
    shorts_ = {};
    floats_ = {};
  }
  const auto fit_as = [&](auto& out) {
    slots_ == 4   ? fit<4>(points, threads, out)
    : slots_ == 8 ? fit<8>(points, threads, out)
                  : fit<16>(points, threads, out);
  };
  short_ ? fit_as(shorts_) : fit_as(floats_);
}

}  // namespace tauguard::cloth
