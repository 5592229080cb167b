// libFuzzer: two moving convex shapes, and a flex's simplices against them, of any numbers at all.
#include "input.hpp"
#include "sweep.hpp"
#include "tauguard/geometry/rounding.hpp"

namespace {

using namespace tauguard::contacts;

constexpr Kind curved_or_polytope[] = {Kind::points,    Kind::segments, Kind::ellipsoids,
                                       Kind::cylinders, Kind::cones,    Kind::boxes,
                                       Kind::hulls};

Shape shape_of(Input& in) {
  Shape shape{curved_or_polytope[in.between(0, 6)], {}, 0, {}, {}, {}, {}, {}};
  for (double& s : shape.size) s = std::fabs(in.number());
  if (shape.kind == Kind::points || shape.kind == Kind::segments)
    shape.radius = std::fabs(in.number());
  if (shape.kind == Kind::hulls)
    for (int k = in.between(1, 9); k > 0; --k)
      for (auto* axis : {&shape.x, &shape.y, &shape.z}) axis->push_back(in.number());
  return shape;
}

const LocalFrame in_place{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {0, 0, 0}};

// Of two bodies at both ends of a step; what a diverging simulation gives is not excluded.
struct Way {
  explicit Way(Input& in) {
    for (int end = 0; end < 2; ++end)
      for (int b = 0; b < 2; ++b) {
        in.rotation(&xmat[end][9 * b], 3);
        for (int k = 0; k < 3; ++k) xpos[end][3 * b + k] = in.number();
      }
    if (in.choice(8) == 7)
      (in.choice(2) ? xpos[1][in.choice(6)] : xmat[1][in.choice(18)]) = in.any();
  }
  Poses poses() const { return {xpos[0], xmat[0], xpos[1], xmat[1]}; }
  double xpos[2][6], xmat[2][18];
};

std::vector<Row> rows_of(Input& in, const Geoms& bodies) {
  Geoms geoms = bodies;
  const Way way(in);
  const double reach = in.choice(2) ? 0.05 : 0;
  RigidPairs pairs({{0, 1, reach}});
  std::vector<Row> rows;
  pairs.find(geoms, way.poses(), &rows);
  constexpr int vertices = 8;
  const int corners = in.between(2, 4);
  const auto x0 = in.numbers(3 * vertices);
  auto x1 = in.numbers(3 * vertices);
  if (in.choice(8) == 7) x1[in.choice(3 * vertices)] = in.any();
  std::vector<std::int32_t> elements(std::size_t(corners) * std::size_t(in.between(1, 8)));
  for (auto& e : elements) e = in.choice(vertices);
  const std::size_t count = elements.size() / std::size_t(corners);
  const std::vector<std::uint8_t> skip(count, 0);
  find_flex(geoms, way.poses(), x0.data(), x1.data(), elements.data(), count, corners, 0.01,
            {{0, 0.02, skip.data()}, {1, 0.0, skip.data()}}, &rows);
  for (std::size_t k = 0; k + 1 < count; ++k) {
    Touch touch;
    simplices_touch(x0.data(), x1.data(), &elements[std::size_t(corners) * k],
                    &elements[std::size_t(corners) * (k + 1)], corners, 0.02, &touch);
  }
  for (const Row& row : rows) require(row.feature < int(count), "a simplex that is not there");
  return rows;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  const tauguard::geometry::RoundToNearest guard;
  Input in(bytes, size);
  Geoms geoms;
  geoms.add(shape_of(in), 0, in_place), geoms.add(shape_of(in), 1, in_place);
  Input again = in;
  const auto rows = rows_of(in, geoms), twice = rows_of(again, geoms);
  require(rows.size() == twice.size(), "the same step twice gives other rows");
  for (std::size_t k = 0; k < rows.size(); ++k)
    require(!std::memcmp(&rows[k].t, &twice[k].t, 8), "the same step twice gives other times");
  return 0;
}
