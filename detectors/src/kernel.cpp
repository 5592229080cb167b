#include "kernel.hpp"

namespace tauguard::detectors {

namespace {

// The sums of `rows` rows of x. A row of vectors is read once for all of them, `width` fours at a
// time, so that all partial sums stay in registers.
template <std::size_t rows, std::size_t width>
[[gnu::always_inline]] inline void sums(const double* x, const double* vectors, const double* coef,
                                        std::size_t blocks, std::size_t d, double inv,
                                        double* out) {
  Four sum[rows][fours] = {};
  for (std::size_t part = 0; part < blocks * fours; part += width) {
    const std::size_t b = part / fours, first = part % fours;
    Four square[rows][width] = {};
    const double* z = vectors + b * d * lanes + 4 * first;
    for (std::size_t k = 0; k < d; ++k, z += lanes)
      for (std::size_t r = 0; r < rows; ++r) {
        const double entry = x[r * d + k];
        const Four at = {entry, entry, entry, entry};
        for (std::size_t f = 0; f < width; ++f) {
          const Four gap = at - load_four(z + 4 * f);
          square[r][f] += gap * gap;
        }
      }
    for (std::size_t r = 0; r < rows; ++r)
      for (std::size_t f = 0; f < width; ++f) {
        const Four one = 1.0 / (1.0 + square[r][f] * inv);
        sum[r][first + f] += load_four(coef + 4 * (part + f)) * (one * one);
      }
  }
  for (std::size_t r = 0; r < rows; ++r) {
    double total = 0.0;
    for (std::size_t f = 0; f < fours; ++f)
      for (std::size_t l = 0; l < 4; ++l) total += sum[r][f][l];
    out[r] = total;
  }
}

}  // namespace

TAUGUARD_CLONES void weighted_sums(const double* x, std::size_t rows, const double* vectors,
                                   const double* coef, std::size_t blocks, std::size_t d,
                                   double inv, double* out) {
  for (; rows >= 4; rows -= 4, x += 4 * d, out += 4)
    sums<4, 2>(x, vectors, coef, blocks, d, inv, out);
  for (; rows > 0; --rows, x += d, ++out) sums<1, fours>(x, vectors, coef, blocks, d, inv, out);
}

}  // namespace tauguard::detectors
