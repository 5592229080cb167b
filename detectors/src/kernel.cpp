#include "kernel.hpp"

namespace tauguard::detectors {

TAUGUARD_CLONES double weighted_sum(const double* x, const double* vectors, const double* coef,
                                    std::size_t blocks, std::size_t d, double inv) {
  Four sum[fours] = {};
  for (std::size_t b = 0; b < blocks; ++b) {
    Four square[fours] = {};
    const double* z = vectors + b * d * lanes;
    for (std::size_t k = 0; k < d; ++k, z += lanes) {
      const Four at = {x[k], x[k], x[k], x[k]};
      for (std::size_t f = 0; f < fours; ++f) {
        const Four gap = at - load_four(z + 4 * f);
        square[f] += gap * gap;
      }
    }
    for (std::size_t f = 0; f < fours; ++f) {
      const Four one = 1.0 / (1.0 + square[f] * inv);
      sum[f] += load_four(coef + b * lanes + 4 * f) * (one * one);
    }
  }
  double total = 0.0;
  for (std::size_t f = 0; f < fours; ++f)
    for (std::size_t l = 0; l < 4; ++l) total += sum[f][l];
  return total;
}

}  // namespace tauguard::detectors
