// A mesh with its tree and bounding volumes, and queries on two meshes.
#pragma once

#include <atomic>
#include <memory>
#include <stdexcept>
#include <string>

#include "comparison_volumes.hpp"
#include "mesh_obb.hpp"

namespace tauguard::rigid {

enum class VolumeKind { aabb, obb, k_dop, sphere };

inline VolumeKind kind_of(const std::string& name) {
  if (name == "aabb") return VolumeKind::aabb;
  if (name == "obb") return VolumeKind::obb;
  if (name == "k_dop") return VolumeKind::k_dop;
  return VolumeKind::sphere;
}

struct Mesh {
  Mesh(const double* vertices, const std::int32_t* faces, std::size_t n_faces, VolumeKind k)
      : tree(vertices, faces, n_faces), kind(k) {
    if (kind == VolumeKind::obb) obbs = fit_obbs(tree);
    if (kind == VolumeKind::k_dop) k_dops = fit_all<KDop>(tree);
    if (kind == VolumeKind::sphere) balls = fit_all<Ball>(tree);
  }
  Tree tree;
  VolumeKind kind;
  ObbTree obbs;
  std::vector<KDop> k_dops;
  std::vector<Ball> balls;
};

// Scratch space of one thread.
using Scratch = std::vector<SlotPair>;

// Calls leaf(i, j, posed), until it returns true, for every pair of triangles that share a point.
// i and j are the triangles of a and b in leaf order, and `posed` is triangle j under the pose.
template <class Visit>
bool each_overlap(const Mesh& a, const Mesh& b, const Pose& pose, Scratch& scratch, Visit visit) {
  const Placement at(a.tree, b.tree, pose);
  if (at.apart) return false;
  const auto leaf = [&](Child ca, Child cb) {
    for (int j = leaf_first(cb); j < leaf_first(cb) + leaf_count(cb); ++j) {
      const Triangle moved = pose.apply(b.tree.triangles[j]);
      for (int i = leaf_first(ca); i < leaf_first(ca) + leaf_count(ca); ++i)
        if (triangles_overlap(a.tree.triangles[i], moved) && visit(i, j, moved)) return true;
    }
    return false;
  };
  switch (a.kind) {
    case VolumeKind::obb:
      return traverse(a.tree, b.tree, ObbBounds{a.obbs, b.obbs, at}, scratch, leaf);
    case VolumeKind::k_dop: {
      const VolumeBounds<KDop> bounds{a.tree, b.tree, a.k_dops, b.k_dops, {a.tree, b.tree, pose}};
      return traverse(a.tree, b.tree, bounds, scratch, leaf);
    }
    case VolumeKind::sphere: {
      const VolumeBounds<Ball> bounds{a.tree, b.tree, a.balls, b.balls, {a.tree, b.tree, pose}};
      return traverse(a.tree, b.tree, bounds, scratch, leaf);
    }
    default:
      return traverse(a.tree, b.tree, BoxBounds{a.tree, b.tree, at}, scratch, leaf);
  }
}

// The first colliding pair found, as rows of the faces; {-1, -1} if the meshes are apart.
struct FacePair {
  std::int32_t a, b;
};
FacePair first_overlap(const Mesh& a, const Mesh& b, const Pose& pose, Scratch& scratch);

// A contact of two overlapping triangles: a common point, the unit normal from a to b, and the
// length of the translation of b along the normal that separates the triangles.
struct Contact {
  std::int32_t a, b;  // rows of the faces
  double point[3], normal[3], depth;
};
// Limits the contacts of a query, over all threads; throws std::length_error above the limit.
class ContactBudget {
 public:
  explicit ContactBudget(std::size_t most) : most_(most) {}
  void take() {
    if (taken_.fetch_add(1, std::memory_order_relaxed) >= most_)
      throw std::length_error("limit: more than " + std::to_string(most_) +
                              " pairs of faces meet; raise limit, or pass fewer poses per call");
  }

 private:
  const std::size_t most_;
  std::atomic<std::size_t> taken_{0};
};
// Writes the contact of the first pair found; false if the meshes are apart.
bool first_contact(const Mesh& a, const Mesh& b, const Pose& pose, Scratch& scratch, Contact* out);
// Pairs of faces of one mesh, a < b, that share a point other than a common corner or edge. `ids`:
// three corners per face; corners at the same position have the same number.
void self_contacts(const Mesh& mesh, const std::int32_t* ids, Scratch& scratch,
                   ContactBudget& budget, std::vector<Contact>& out);
void all_contacts(const Mesh& a, const Mesh& b, const Pose& pose, Scratch& scratch,
                  ContactBudget& budget, std::vector<Contact>& out);

}  // namespace tauguard::rigid
