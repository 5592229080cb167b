#include "mesh_ccd.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>
#include <stdexcept>

#include "tauguard/geometry/interrupt.hpp"
#include "tauguard/geometry/scratch.hpp"

namespace tauguard::cloth {
namespace {

constexpr std::size_t chunk_pairs = 512;  // number of leaf pairs in a chunk
// A tree is rebuilt if the sum of its leaves' extents has grown by this factor since the build.
constexpr double worn = 2;
// Volumes are moving (k_dop.hpp) in steps in which vertices move, on average, by more than this
// fraction of an edge. In slower steps the second interval costs more than the candidates that it
// saves (measured on meshes of 20,000 to 90,000 triangles: equal between 0.37 and 0.42). Features
// at rest count: their second interval costs as much and saves less.
constexpr double fast = 0.39;
constexpr std::size_t sampled = 1024;  // number of vertices, and of edges, in these means
// Bounds of features have 16 bits if their resolution is, on average, at most this fraction of an
// edge. With a coarser one too many volumes that are apart overlap in 16 bits.
constexpr double fine = 1.0 / 64;
// The limit on entries of a front is this many times the limit on collisions.
constexpr std::size_t leaf_pairs = 8;

// The mean of size(vertices) over some of the features; NaN if there are none.
template <class Size>
double mean(const Features& features, Size size) {
  const std::size_t n = features.size(), stride = n / sampled + 1;
  double sum = 0;
  for (std::size_t i = 0; i < n; i += stride) sum += size(features.of(i));
  return sum / ((n + stride - 1) / stride);
}

class Clock {
 public:
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return seconds;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace

MeshCcd::MeshCcd(std::vector<std::int32_t> faces, Groups groups, VolumeKind volume, bool adaptive,
                 int threads)
    : groups_(std::move(groups)), volume_(volume), adaptive_(adaptive), threads_(threads) {
  axes_of(volume.k);  // throws if k is not supported
  topology_.set(std::move(faces));
}

void MeshCcd::prepare(const double* x_t0, const double* x_t1, std::size_t n, double min_distance,
                      bool fresh, std::size_t limit) {
  const geometry::RoundToNearest guard;
  stats_ = {};
  try {
    copy(x_t0, x_t1, n);
    if (adaptive_) volume_.moving = is_fast();
    place(min_distance);
    descend(fresh, limit);
  } catch (...) {
    forget();  // trees and fronts may be incomplete
    throw;
  }
}

void MeshCcd::copy(const double* x_t0, const double* x_t1, std::size_t n) {
  if (n < topology_.rows() || (groups_.any() && n < groups_.of_vertex.size()))
    throw std::invalid_argument("x_t0: fewer vertices than the mesh has");
  lines_.resize(std::max<std::size_t>(n, 1));
  isolated_ = isolated_vertices(topology_, n);
  double wild = 0;  // NaN if an entry is not finite
  for (std::size_t i = 0; i < n; ++i) {
    double* line = lines_[i].value;
    for (int k = 0; k < 3; ++k) {
      line[k] = x_t0[3 * i + k];
      line[4 + k] = x_t1[3 * i + k];
      wild += 0 * line[k] + 0 * line[4 + k];
    }
  }
  if (std::isnan(wild))
    throw std::invalid_argument("x_t0, x_t1: changed during the call, an entry is not finite");
}

double MeshCcd::over_edges(double length) const {
  const Ends x = ends();
  return mean(topology_.edges, [&](const std::int32_t* v) {
    const double edge = geometry::largest(x(false, v[1]) - x(false, v[0]));
    return edge > length ? length / edge : 1;
  });
}

bool MeshCcd::is_fast() const {
  const Ends x = ends();
  const double motion = mean(topology_.vertices, [&](const std::int32_t* v) {
    return geometry::largest(x(true, *v) - x(false, *v));
  });
  return !(over_edges(motion) < fast);
}

void MeshCcd::place(double min_distance) {
  Clock clock;
  points_.scale_to(ends(), lines_.size(), volume_, min_distance, threads_);
  const bool in_short = over_edges(1 / (points_.unit() * shorts_of_unit)) <= fine;
  points_.set(ends(), lines_.size(), in_short, threads_);
  stats_.project_s = clock.lap();
  FeatureTree* trees[] = {&vertices_, &edges_, &faces_};
  const Features* features[] = {&topology_.vertices, &topology_.edges, &topology_.faces};
  for (int i = 0; i < 3; ++i) {
    if (built_spread_[i] >= 0) {
      trees[i]->refit(points_, threads_);
      stats_.refit_s += clock.lap();
    }
    // Spread is in units of the scene's extent, which also makes it comparable between steps.
    if (built_spread_[i] < 0 || trees[i]->spread() > worn * built_spread_[i]) {
      trees[i]->build(*features[i], ends(), groups_, threads_);
      ++stats_.builds;
      stats_.build_s += clock.lap();
      trees[i]->refit(points_, threads_);
      built_spread_[i] = trees[i]->spread();
      if (i != 1) vf_front_.reset();
      if (i == 1) ee_front_.reset();
      stats_.refit_s += clock.lap();
    }
  }
}

void MeshCcd::descend(bool fresh, std::size_t limit) {
  Clock clock;
  if (fresh) {
    vf_front_.reset();
    ee_front_.reset();
  }
  vf_pairs_ = &vf_front_.update(vertices_, faces_, threads_, leaf_pairs * limit);
  ee_pairs_ = &ee_front_.update(edges_, edges_, threads_, leaf_pairs * limit);
  stats_.vf.node_tests = vf_front_.tests();
  stats_.ee.node_tests = ee_front_.tests();
  stats_.vf.front = vf_front_.size();
  stats_.ee.front = ee_front_.size();
  stats_.vf.leaf_pairs = vf_pairs_->size();
  stats_.ee.leaf_pairs = ee_pairs_->size();
  stats_.traverse_s = clock.lap();
}

void MeshCcd::forget() {
  built_spread_ = {-1, -1, -1};
  vf_front_.reset();
  ee_front_.reset();
}

std::size_t MeshCcd::chunks(Kind kind) const {
  const auto& pairs = kind == Kind::vf ? *vf_pairs_ : *ee_pairs_;
  return (pairs.size() + chunk_pairs - 1) / chunk_pairs;
}

void MeshCcd::for_each_block(Kind kind, const Take& take) {
  const bool vf = kind == Kind::vf;
  const auto& pairs = vf ? *vf_pairs_ : *ee_pairs_;
  const FeatureTree &a = vf ? vertices_ : edges_, &b = vf ? faces_ : edges_;
  BroadCounts& counts = vf ? stats_.vf : stats_.ee;
  const Isolated isolated{static_cast<std::int32_t>(topology_.triangles),
                          isolated_.empty() ? nullptr : isolated_.data()};
  std::mutex mutex;
  geometry::interruptible_for(
      pairs.size(), threads_, chunk_pairs, [&](auto begin, auto end, auto chunk) {
        geometry::Scratch<CandidateBlock> scratch;
        CandidateBlock& block = *scratch;
        block.size = block.adjacent = block.kept_apart = 0;
        std::uint64_t candidates = 0;
        for (auto i = begin; i < end; ++i) {
          if (i + 1 < end) {
            a.prefetch(pairs[i + 1].a);
            b.prefetch(pairs[i + 1].b);
          }
          leaf_candidates(a, b, pairs[i], groups_, isolated, block);
          if (block.size >= CandidateBlock::full || (i + 1 == end && block.size > 0)) {
            geometry::poll_interrupt();
            candidates += block.size;
            take(block, chunk);
            block.size = 0;
          }
        }
        const std::lock_guard<std::mutex> lock(mutex);
        counts.candidates += candidates;
        counts.adjacent += block.adjacent;
        counts.kept_apart += block.kept_apart;
      });
}

TopologyChange MeshCcd::update_topology(std::vector<std::int32_t> faces, Groups groups) {
  Topology after;
  after.set(std::move(faces));
  const std::vector<std::int32_t> match[] = {match_sorted(topology_.vertices, after.vertices),
                                             match_sorted(topology_.edges, after.edges),
                                             match_faces(topology_.faces, after.faces)};
  FeatureTree* trees[] = {&vertices_, &edges_, &faces_};
  const Features* features[] = {&after.vertices, &after.edges, &after.faces};
  TopologyChange change;
  try {
    for (int i = 0; i < 3; ++i) {
      std::uint64_t kept = 0;
      for (const auto id : match[i]) kept += id >= 0;
      change.removed[i] = match[i].size() - kept;
      change.added[i] = features[i]->size() - kept;
      if (built_spread_[i] >= 0 && !trees[i]->update(*features[i], match[i], groups)) {
        built_spread_[i] = -1;
        ++change.rebuilt;
      }
    }
  } catch (...) {
    forget();  // the mesh is unchanged, but its trees are not
    throw;
  }
  topology_ = std::move(after);
  groups_ = std::move(groups);
  return change;
}

std::size_t MeshCcd::bytes() const {
  const std::size_t lists = topology_.vertices.vertices.capacity() +
                            topology_.edges.vertices.capacity() +
                            topology_.faces.vertices.capacity() + groups_.of_vertex.capacity();
  return lists * sizeof(std::int32_t) + lines_.capacity() * sizeof(Line) + points_.bytes() +
         vertices_.bytes() + edges_.bytes() + faces_.bytes() + vf_front_.bytes() +
         ee_front_.bytes() + spare_->bytes();
}

}  // namespace tauguard::cloth
