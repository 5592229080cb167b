// Finds the pairs that pass through each other in a step, by their eroded shapes.
//
// Eroding a shape removes a layer at its surface. Level 0 is the whole shape; the last level leaves
// almost only the middle. A pair is judged at the shallowest level at which its shapes are apart at
// the start. As long as the shapes of the last level never meet, no part of one partner has passed
// through the other.
//
// Most pairs are far apart for many steps. A pair that is found apart keeps a reserve: a lower
// bound of the gap of its shapes. Each step reduces the reserve by an upper bound of the distances
// that points of both partners move. While the reserve is above 0, the shapes cannot have met, so
// the pair is not tested.
#pragma once

#include <set>

#include "sweep.hpp"

namespace tauguard::contacts {

struct Hit {
  std::int32_t pair;     // pairs of geoms come first, then those with a flex
  std::int32_t feature;  // the simplex of a flex, -1 for geoms
  std::int32_t level;    // 0: touched and parted again; otherwise the level whose shapes met
  std::int32_t deepest;  // the deepest level whose shapes met; or the number of levels if all
                         // shapes meet at the start and did not one step earlier
  double t;              // when the whole shapes first touch; 0 if they touch at the start
  double way;            // upper bound of the approach of the pair's points in the step [m]
};

// What is found of a pair whose shapes meet: nothing more; whether those of the last level meet
// too; the deepest level whose shapes meet.
enum class Depth { none, last, all };

class Verdict {
 public:
  // Adds a shape of some level to a body and returns the shape's number.
  int add(Shape shape, int body, const LocalFrame& in_body);
  // Adds a pair: the numbers of both partners' shapes, level by level.
  void add_pair(std::vector<std::int32_t> a, std::vector<std::int32_t> b);
  // Adds a pair: a geom's shapes and the flex's radii, level by level. elements: (count, corners),
  // numbers of vertices. skip: (count,), whether to leave a simplex out.
  void add_flex_pair(std::vector<std::int32_t> a, std::vector<double> radii,
                     std::vector<std::int32_t> elements, int corners,
                     std::vector<std::uint8_t> skip);

  // Clears the memory of earlier steps.
  void forget();
  // `depth`: none or all; of pairs of geoms, `all` finds the last level only.
  void judge(const Poses& poses, const double* x_t0, const double* x_t1, Depth depth,
             std::vector<Hit>* hits);

  std::size_t rigid_pairs() const { return pairs_.size(); }
  // The vertices of some simplices of a pair with a flex, without repetition.
  std::vector<std::int32_t> vertices(int pair, const std::vector<std::int32_t>& features) const {
    const FlexPair& own = flex_pairs_[pair - pairs_.size()];
    std::set<std::int32_t> out;
    for (const std::int32_t f : features)
      for (int i = 0; i < own.corners; ++i) out.insert(own.elements[own.corners * f + i]);
    return {out.begin(), out.end()};
  }
  // The memory of a pair from earlier steps: one entry, or one for each simplex.
  std::vector<char> known(std::size_t pair) const;
  // Sets the memory of a pair. Ignored if the number of entries differs.
  void set_known(std::size_t pair, const std::vector<char>& known);
  // Pairs so deep in one another that even the shapes of the last level were not apart.
  std::vector<int> sunk_pairs() const;
  template <class Archive>
  void archive(Archive& a) {
    for (Pair& pair : pairs_) a(pair.known);
    for (FlexPair& pair : flex_pairs_) a(pair.known);
  }

 private:
  struct Entry {
    Shape shape;
    LocalFrame in_body;
    int body;
    double extent;  // bound on the distance of the shape's points from the body's origin
    double size;    // the same from the shape's own origin; 0 for a plane
  };
  struct Pair {
    std::vector<std::int32_t> a, b;
    char known;  // memory of earlier steps
  };
  // The shapes of `level` are apart at the end of the last judged step, by at least `left` [m].
  struct Reserve {
    std::int32_t a, b;  // bodies of the pair
    std::int32_t level = 0;
    double left = -INFINITY;
  };
  // Bounds on the displacement of a body's points. In the step: `linear` of the origin [m], `chord`
  // by rotation, per metre from the origin. `since`: of any point since the end of the last judged
  // step [m]; this includes edits and rollbacks between the steps.
  struct Way {
    double linear = 0, chord = 0, since = 0;
  };
  struct FlexPair {
    std::vector<std::int32_t> a;
    std::vector<double> radii;
    std::vector<std::int32_t> elements;
    int corners;
    std::vector<std::uint8_t> skip;
    std::vector<char> known;  // by simplex
  };

  void update(const Poses& poses);
  const RigidMotion& motion(int body);
  const Aabb& box(int entry);
  SupportShape mover(int entry, const Vec3& origin);
  double travel(int entry, const Vec3& drift);
  double turning(const Pair& pair) const;
  double gap_of_balls(const Pair& pair) const;
  bool stays_apart(std::size_t pair, int level, double gap, const Vec3& n);
  void judge_rigid(std::size_t pair, Depth depth, std::vector<Hit>* hits);
  void judge_flex(std::size_t pair, const double* x_t0, const double* x_t1, Depth depth,
                  std::vector<Hit>* hits);

  std::vector<Entry> entries_;
  std::vector<Pair> pairs_;
  std::vector<Reserve> reserves_;  // for each of `pairs_`
  std::vector<FlexPair> flex_pairs_;
  std::vector<Aabb> boxes_;            // for each entry, of the step with the stamp `boxed_`
  std::vector<std::uint64_t> boxed_;   // for each entry
  std::vector<int> bodies_;            // bodies with shapes
  std::vector<RigidMotion> motions_;   // for each body, of the step with the stamp `moved_`
  std::vector<std::uint64_t> stamps_;  // for each body: number of changes of its motion so far
  std::vector<std::uint64_t> moved_;   // for each body
  std::vector<Way> ways_;              // for each body
  std::vector<double> extents_;  // for each body: bound on its shapes' points; of a plane, infinite
  std::vector<char> still_;      // for each body: unmoved in this step
  std::vector<double> last_;     // 24 numbers for each body: both poses of the last step
};

}  // namespace tauguard::contacts
