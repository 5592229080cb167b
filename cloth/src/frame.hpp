// Every collision of one step: the narrow phase applied to the candidates of a MeshCcd.
#pragma once

#include <cstdint>
#include <functional>

#include "mesh_ccd.hpp"
#include "narrow_phase.hpp"
#include "spare_memory.hpp"

namespace tauguard::cloth {

// The collisions of one kind, in the order of their pairs.
struct Collisions {
  SpareArray<std::int32_t> pairs;                  // (n, 2)
  SpareArray<double> toi, point, normal, weights;  // shapes (n), (n, 3), (n, 3), (n, 4)
  Stats stats;
  double narrow_s = 0;  // time of the narrow phase, summed over threads [s]
  double total_s = 0;   // wall time of candidates, narrow phase and sorting [s]
  std::size_t size() const { return toi.size(); }
};

// Decides a block of candidates, rows (n, 4) of vertices, as solve_vf does. Only the times of
// impacts are needed. It is called from several threads.
using NarrowPhase = std::function<void(const Ends& x, const std::int32_t* rows, std::size_t n,
                                       std::uint8_t* hit, ImpactArrays impacts, Stats& stats)>;

// Call ccd.prepare first. Throws TooMany if there are more than `limit` collisions.
Collisions find_collisions(MeshCcd& ccd, MeshCcd::Kind kind, Method method, double min_distance,
                           std::size_t limit);
Collisions find_collisions(MeshCcd& ccd, MeshCcd::Kind kind, const NarrowPhase& narrow_phase,
                           std::size_t limit, double min_distance = 0);

}  // namespace tauguard::cloth
