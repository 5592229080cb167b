// tauguard.detectors._network: feed-forward networks.
// A row gives the same bits alone and among others.
#include <nanobind/nanobind.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "bindings.hpp"
#include "tauguard/geometry/argument_errors.hpp"
#include "tauguard/geometry/lanes.hpp"
#include "tauguard/geometry/thread_pool.hpp"

namespace tauguard::detectors {
namespace {

using geometry::ThreadPool;

// y = sum_i x_i weight_i + bias, with weight of shape (in, out). The sum is in the order of i.
TAUGUARD_CLONES void affine(const double* x, const double* weight, const double* bias,
                            std::size_t in, std::size_t out, double* y) {
  for (std::size_t j = 0; j < out; ++j) y[j] = 0.0;
  for (std::size_t i = 0; i < in; ++i)
    for (std::size_t j = 0; j < out; ++j) y[j] += x[i] * weight[i * out + j];
  for (std::size_t j = 0; j < out; ++j) y[j] += bias[j];
}

// Affine layers with rectifiers between them, for inputs (x - centre) / scale. `widths`: number of
// inputs, then of outputs of each layer. `weights` and `biases` are concatenated over the layers.
void network(In2 x, Ids widths, In1 weights, In1 biases, In1 centre, In1 scale, Out2 out,
             int threads) {
  const std::size_t layers = widths.shape(0) - 1;
  require(widths.shape(0) >= 2, "network: no layers");
  std::vector<std::size_t> w;
  for (std::size_t k = 0; k <= layers; ++k) {
    require(widths.data()[k] > 0, "network: a width below 1");
    w.push_back(static_cast<std::size_t>(widths.data()[k]));
  }
  std::size_t all = 0, own = 0, widest = w[0];
  for (std::size_t k = 0; k < layers; ++k) {
    all += w[k] * w[k + 1];
    own += w[k + 1];
    widest = std::max(widest, w[k + 1]);
  }
  require(weights.shape(0) == all && biases.shape(0) == own && centre.shape(0) == w[0] &&
              scale.shape(0) == w[0] && x.shape(1) == w[0] && out.shape(0) == x.shape(0) &&
              out.shape(1) == w[layers],
          "network: the shapes of the arrays do not match");
  nb::gil_scoped_release release;
  ThreadPool::shared().parallel_for(x.shape(0), threads, 256, [&](auto begin, auto end, auto) {
    std::vector<double> now(widest), next(widest);
    for (auto t = begin; t < end; ++t) {
      for (std::size_t i = 0; i < w[0]; ++i)
        now[i] = (x.data()[t * w[0] + i] - centre.data()[i]) / scale.data()[i];
      const double *weight = weights.data(), *bias = biases.data();
      for (std::size_t k = 0; k < layers; ++k) {
        affine(now.data(), weight, bias, w[k], w[k + 1], next.data());
        weight += w[k] * w[k + 1];
        bias += w[k + 1];
        if (k + 1 < layers)
          for (std::size_t j = 0; j < w[k + 1]; ++j) next[j] = std::max(next[j], 0.0);
        now.swap(next);
      }
      std::copy(now.data(), now.data() + w[layers], out.data() + t * w[layers]);
    }
  });
}

}  // namespace
}  // namespace tauguard::detectors

NB_MODULE(_network, m) {
  tauguard::geometry::bind_argument_errors();
  using namespace tauguard::detectors;
  m.doc() = "Feed-forward networks.";
  m.def("network", &network, "x"_a, "widths"_a, "weights"_a, "biases"_a, "centre"_a, "scale"_a,
        "out"_a.noconvert(), "threads"_a);
}
