// tauguard.detectors._ranking: bounded cumulative sums, forests of regression trees, and networks.
// A result depends on its row alone: one row or many give the same bits.
#include <nanobind/nanobind.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "bindings.hpp"
#include "tauguard/geometry/lanes.hpp"
#include "tauguard/geometry/thread_pool.hpp"

namespace tauguard::detectors {
namespace {

using geometry::ThreadPool;

// g = max(0, g + x) down the rows of x (T, c), from no more than `cap` on where x is below 0;
// `state` holds g before and after.
void bounded_cusum(In2 x, In1 cap, Out1 state, Out2 out) {
  const std::size_t columns = x.shape(1);
  require(cap.shape(0) == columns && state.shape(0) == columns && out.shape(0) == x.shape(0) &&
              out.shape(1) == columns,
          "bounded_cusum: arrays differ in shape");
  nb::gil_scoped_release release;
  for (std::size_t t = 0; t < x.shape(0); ++t)
    for (std::size_t c = 0; c < columns; ++c) {
      double& g = state.data()[c];
      const double more = x.data()[t * columns + c];
      g = std::max(0.0, (more < 0 ? std::min(g, cap.data()[c]) : g) + more);
      out.data()[t * columns + c] = g;
    }
}

// base + the sum of one leaf of every tree, tree by tree. Node k goes left where the feature,
// rounded to single precision as in training, is at or below its threshold; a leaf is its own
// child.
void forest(In2 x, Ids roots, Ids feature, In1 threshold, Ids left, Ids right, In1 value,
            double base, Out1 out, int threads) {
  const std::size_t nodes = feature.shape(0), d = x.shape(1);
  require(threshold.shape(0) == nodes && left.shape(0) == nodes && right.shape(0) == nodes &&
              value.shape(0) == nodes && out.shape(0) == x.shape(0),
          "forest: arrays differ in shape");
  const auto within = [&](std::int64_t k, std::size_t size) {
    return k >= 0 && static_cast<std::size_t>(k) < size;
  };
  for (std::size_t k = 0; k < roots.shape(0); ++k)
    require(within(roots.data()[k], nodes), "forest: a root is no node");
  for (std::size_t k = 0; k < nodes; ++k) {
    require(within(feature.data()[k], d), "forest: a feature that the rows do not have");
    const std::int64_t l = left.data()[k], r = right.data()[k], own = static_cast<std::int64_t>(k);
    require((l == own && r == own) || (l > own && r > own && within(l, nodes) && within(r, nodes)),
            "forest: a child that does not come after its node");
  }
  nb::gil_scoped_release release;
  ThreadPool::shared().parallel_for(x.shape(0), threads, 64, [&](auto begin, auto end, auto) {
    for (auto i = begin; i < end; ++i) {
      const double* row = x.data() + i * d;
      double sum = base;
      for (std::size_t tree = 0; tree < roots.shape(0); ++tree) {
        std::int64_t k = roots.data()[tree];
        while (left.data()[k] != k)
          k = static_cast<float>(row[feature.data()[k]]) <= threshold.data()[k] ? left.data()[k]
                                                                                : right.data()[k];
        sum += value.data()[k];
      }
      out.data()[i] = sum;
    }
  });
}

// out = bias + sum_i x_i weight_i, with weight of shape (in, out); sums in the order of i.
TAUGUARD_CLONES void affine(const double* x, const double* weight, const double* bias,
                            std::size_t in, std::size_t out, double* y) {
  for (std::size_t j = 0; j < out; ++j) y[j] = 0.0;
  for (std::size_t i = 0; i < in; ++i)
    for (std::size_t j = 0; j < out; ++j) y[j] += x[i] * weight[i * out + j];
  for (std::size_t j = 0; j < out; ++j) y[j] += bias[j];
}

// Affine layers with rectifiers in between, on inputs (x - centre) / scale. `widths` holds the
// inputs' number and every layer's outputs; `weights` and `biases` the layers' one after another.
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
          "network: arrays differ in shape");
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

NB_MODULE(_ranking, m) {
  using namespace tauguard::detectors;
  m.doc() = "Bounded cumulative sums, forests of regression trees, networks.";
  m.def("bounded_cusum", &bounded_cusum, "x"_a, "cap"_a, "state"_a.noconvert(),
        "out"_a.noconvert());
  m.def("forest", &forest, "x"_a, "roots"_a, "feature"_a, "threshold"_a, "left"_a, "right"_a,
        "value"_a, "base"_a, "out"_a.noconvert(), "threads"_a);
  m.def("network", &network, "x"_a, "widths"_a, "weights"_a, "biases"_a, "centre"_a, "scale"_a,
        "out"_a.noconvert(), "threads"_a);
}
