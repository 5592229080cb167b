// Continuous collision detection of a deforming mesh with itself. Trees and fronts of the broad
// phase are kept between steps. The narrow phase (frame.hpp) tests the candidates.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "candidates.hpp"
#include "feature_tree.hpp"
#include "front.hpp"
#include "k_dop.hpp"
#include "spare_memory.hpp"
#include "tauguard/geometry/fields.hpp"
#include "topology.hpp"

namespace tauguard::cloth {

// Counts of one kind of query (vertex-face or edge-edge) in the last step.
struct BroadCounts {
  std::uint64_t node_tests = 0, front = 0, leaf_pairs = 0, candidates = 0, adjacent = 0,
                kept_apart = 0;
  TAUGUARD_FIELDS(node_tests, front, leaf_pairs, adjacent, kept_apart, candidates)
};

struct BroadStats {
  BroadCounts vf, ee;
  double project_s = 0, build_s = 0, refit_s = 0, traverse_s = 0;
  std::uint64_t builds = 0;  // of trees, in this step
};

struct TopologyChange {
  std::array<std::uint64_t, 3> removed{}, added{};  // vertices, edges, faces
  std::uint64_t rebuilt = 0;                        // trees to rebuild, for lack of free slots
};

class MeshCcd {
 public:
  enum class Kind { vf, ee };

  // adaptive: sets volume.moving in each step, by how far vertices move relative to the edges.
  MeshCcd(std::vector<std::int32_t> faces, Groups groups, VolumeKind volume, bool adaptive,
          int threads);

  const Topology& topology() const { return topology_; }
  int threads() const { return threads_; }
  // The kind of bounding volume in the last prepare.
  VolumeKind volume() const { return volume_; }

  // Updates trees, volumes and fronts for this step. The positions (n, 3) are copied. fresh: start
  // the traversal at the root instead of the last front. Throws std::invalid_argument if features
  // have vertices beyond n or a position is not finite, and TooMany if a front has more than
  // 8 x limit entries. The object can be used after an exception.
  void prepare(const double* x_t0, const double* x_t1, std::size_t n, double min_distance,
               bool fresh, std::size_t limit);
  // The positions of the last prepare.
  Ends ends() const { return Ends::packed(lines_.data()->value); }
  // Calls take(block, chunk) with all candidates of one kind, from several threads; call prepare
  // first. The candidates of a chunk and their order do not depend on the threads.
  using Take = std::function<void(const CandidateBlock&, std::size_t)>;
  std::size_t chunks(Kind kind) const;
  void for_each_block(Kind kind, const Take& take);

  TopologyChange update_topology(std::vector<std::int32_t> faces, Groups groups);

  const BroadStats& stats() const { return stats_; }
  // Memory of the result arrays, which may outlive this object.
  const std::shared_ptr<SpareMemory>& spare() const { return spare_; }
  std::size_t bytes() const;

 private:
  struct alignas(64) Line {
    double value[Ends::line];
  };
  void copy(const double* x_t0, const double* x_t1, std::size_t n);
  // The mean over the edges of length / (largest coordinate of the edge), where quotients above 1
  // count as 1. So a few long edges have little effect. NaN without edges.
  double over_edges(double length) const;
  bool is_fast() const;
  void place(double min_distance);
  void descend(bool fresh, std::size_t limit);
  void forget();

  std::shared_ptr<SpareMemory> spare_ = std::make_shared<SpareMemory>();
  std::vector<Line> lines_;
  std::vector<std::uint8_t> isolated_;
  Topology topology_;
  Groups groups_;
  VolumeKind volume_;
  bool adaptive_;
  int threads_;
  Projection points_;
  FeatureTree vertices_, edges_, faces_;
  std::array<double, 3> built_spread_{-1, -1, -1};  // of vertices, edges, faces; -1: not built
  Front vf_front_, ee_front_;
  const std::vector<NodePair>*vf_pairs_ = nullptr, *ee_pairs_ = nullptr;
  BroadStats stats_;
};

}  // namespace tauguard::cloth
