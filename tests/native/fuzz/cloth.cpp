// libFuzzer: queries of four moving points, and a mesh that is asked over several steps.
#include <map>

#include "frame.hpp"
#include "input.hpp"
#include "too_many.hpp"

namespace {

using namespace tauguard::cloth;

struct Answer {
  std::uint8_t hit = 0;
  double toi = 0, point[3] = {}, normal[3] = {}, weights[4] = {};
};

Answer ask(bool vf, const Ends& x, const std::int32_t* row, Method method, double distance) {
  Answer a;
  Stats stats;
  (vf ? solve_vf : solve_ee)(x, row, 1, method, distance, &a.hit,
                             {&a.toi, a.point, a.normal, a.weights}, stats, {});
  return a;
}

// The quick method against exact arithmetic: the same contacts, never late, 1e-9 early at most.
// With a minimum distance there is a contact wherever there is one without.
void query(Input& in, bool vf) {
  const std::int32_t row[4] = {0, 1, 2, 3};
  const bool wide = in.choice(8) == 7;  // exact arithmetic on numbers of any size is slow
  const double most = wide ? 1.7976931348623157e308 : 0x1p60, least = wide ? 0 : 0x1p-60;
  const auto x0 = in.numbers(12, most, least), x1 = in.numbers(12, most, least);
  const Ends x = Ends::of(x0.data(), x1.data());
  const Answer ours = ask(vf, x, row, Method::ab2pf, 0), exact = ask(vf, x, row, Method::exact, 0);
  require(ours.hit == exact.hit, "ab2pf differs from exact");
  if (exact.hit) {
    require(0 <= ours.toi && ours.toi <= exact.toi && exact.toi <= 1, "late");
    require(exact.toi - ours.toi <= 1e-9, "early");
  }
  const double distance = std::fabs(in.number(1e100));
  require(ask(vf, x, row, Method::ab2pf, distance).hit >= ours.hit, "a distance loses a contact");
}

constexpr int vertices = 9;

std::vector<std::int32_t> faces_of(Input& in) {
  std::vector<std::int32_t> rows;
  for (int n = in.between(1, 8); n > 0; --n) {
    const int a = in.choice(vertices), b = in.choice(vertices), c = in.choice(vertices);
    if (a != b && b != c && c != a) rows.insert(rows.end(), {a, b, c});
  }
  if (rows.empty()) rows = {0, 1, 2};
  return rows;
}

// Of every vertex in use and every face that it does not belong to: is a contact listed?
void none_missed(const std::vector<std::int32_t>& faces, const Ends& x, const Collisions& found) {
  std::map<std::pair<int, int>, bool> listed;
  for (std::size_t i = 0; i < found.size(); ++i)
    listed[{found.pairs[2 * i], found.pairs[2 * i + 1]}] = true;
  for (const std::int32_t v : faces)
    for (std::size_t f = 0; f < faces.size(); f += 3) {
      const std::int32_t row[4] = {v, faces[f], faces[f + 1], faces[f + 2]};
      if (v == row[1] || v == row[2] || v == row[3]) continue;
      if (ask(true, x, row, Method::exact, 0).hit)
        require(listed.count({v, int(f / 3)}), "the mesh misses a vertex-face contact");
    }
}

// Several steps on one mesh, from the last front and from three threads, against a fresh descent.
void mesh(Input& in) {
  constexpr std::size_t limit = 100000;
  const int ks[] = {6, 14, 16, 18, 26};
  const VolumeKind volume{ks[in.choice(5)], in.choice(2) == 1};
  auto faces = faces_of(in);
  MeshCcd ccd(faces, {}, volume, in.choice(2) == 1, 3), plain(faces, {}, {6, false}, false, 1);
  auto x0 = in.numbers(3 * vertices, 0x1p60, 0x1p-60);
  for (int step = in.between(1, 4); step > 0; --step) {
    if (in.choice(4) == 3) {
      faces = faces_of(in);
      ccd.update_topology(faces, {});
      plain.update_topology(faces, {});
    }
    auto x1 = x0;
    for (int moved = in.choice(3 * vertices + 1); moved > 0; --moved)
      x1[in.choice(3 * vertices)] = in.number(0x1p60, 0x1p-60);
    ccd.prepare(x0.data(), x1.data(), vertices, 0, in.choice(4) == 3, limit);
    plain.prepare(x0.data(), x1.data(), vertices, 0, true, limit);
    for (const auto kind : {MeshCcd::Kind::vf, MeshCcd::Kind::ee}) {
      const auto ours = find_collisions(ccd, kind, Method::ab2pf, 0, limit);
      const auto theirs = find_collisions(plain, kind, Method::ab2pf, 0, limit);
      require(ours.pairs == theirs.pairs && ours.toi == theirs.toi, "the front changes an answer");
      if (kind == MeshCcd::Kind::vf) none_missed(faces, Ends::of(x0.data(), x1.data()), ours);
    }
    x0 = x1;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  Input in(bytes, size);
  const int what = in.choice(3);
  if (what == 2)
    mesh(in);
  else
    query(in, what == 0);
  return 0;
}
