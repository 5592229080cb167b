#include "mesh_boxes.hpp"

#include <cstring>

// One source, compiled for AVX2 as well where that exists and picked at load time; no contraction, so the
// bits are the portable ones.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && defined(__linux__)
#define TAUGUARD_WIDE __attribute__((target_clones("avx2", "default")))
#else
#define TAUGUARD_WIDE
#endif

namespace tauguard::rigid {
namespace {

typedef float Wide __attribute__((vector_size(32)));
typedef std::int32_t Bits __attribute__((vector_size(32)));

}  // namespace

#define WIDE_ABS(x) ((Wide)((Bits)(x) & sign_off))

TAUGUARD_WIDE unsigned overlap_mask(const Node& node, const Box& box, const Relative& rel, float* distance2) {
  const Bits sign_off = (Bits){} + 0x7fffffff;
  const Wide* centre = reinterpret_cast<const Wide*>(node.centre);
  const Wide* e = reinterpret_cast<const Wide*>(node.extent);
  Wide d[3];
  Bits hit = (Bits){} - 1;
  for (int i = 0; i < 3; ++i) {
    const float c = ((rel.r[i][0] * box.centre[0] + rel.r[i][1] * box.centre[1]) + rel.r[i][2] * box.centre[2]) + rel.t[i];
    const float reach = ((rel.abs_r[i][0] * box.extent[0] + rel.abs_r[i][1] * box.extent[1]) +
                         rel.abs_r[i][2] * box.extent[2]) + rel.pad;
    d[i] = c - centre[i];
    hit &= (Bits)(WIDE_ABS(d[i]) <= e[i] + reach);
  }
  const Wide square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
  std::memcpy(distance2, &square, sizeof square);
  for (int j = 0; j < 3; ++j) {
    const Wide along = (d[0] * rel.r[0][j] + d[1] * rel.r[1][j]) + d[2] * rel.r[2][j];
    const Wide reach = (e[0] * rel.abs_r[0][j] + e[1] * rel.abs_r[1][j]) + e[2] * rel.abs_r[2][j];
    hit &= (Bits)(WIDE_ABS(along) <= reach + (box.extent[j] + rel.pad));
  }
  const Bits lane = {1, 2, 4, 8, 16, 32, 64, 128};
  std::uint64_t word[4];
  Bits flags = hit & lane;
  std::memcpy(word, &flags, sizeof word);
  std::uint64_t any = (word[0] | word[1]) | (word[2] | word[3]);
  if (any == 0) return 0;
  for (int i = 0; i < 3; ++i) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      const float own = (box.extent[j1] * rel.abs_r[i][j2] + box.extent[j2] * rel.abs_r[i][j1]) + rel.pad;
      const Wide reach = (e[i1] * rel.abs_r[i2][j] + e[i2] * rel.abs_r[i1][j]) + own;
      hit &= (Bits)(WIDE_ABS(d[i2] * rel.r[i1][j] - d[i1] * rel.r[i2][j]) <= reach);
    }
  }
  flags = hit & lane;
  std::memcpy(word, &flags, sizeof word);
  any = (word[0] | word[1]) | (word[2] | word[3]);
  return static_cast<unsigned>(any | (any >> 32)) & 0xff;
}

}  // namespace tauguard::rigid
