// libFuzzer: pairs of convex bodies at rest, on straight ways and turning, and meshes of triangles.
#include <algorithm>

#include "convex_overlap.hpp"
#include "input.hpp"
#include "mesh_body.hpp"
#include "mesh_impact.hpp"

namespace {

using namespace tauguard::rigid;

// Beyond these, the public entries refuse coordinates (bodies that move or grow; meshes).
constexpr double far = 1e100, far_mesh = 1e30;

struct Body {
  Body(Input& in, Kind kind, double most) : offsets{0, 1} {
    if (is_cloud(kind)) offsets[1] = in.between(1, 9);
    const std::size_t numbers = Bodies::strides[int(kind)] * std::size_t(offsets[1]);
    data = in.numbers(numbers, most);
    if (kind == Kind::boxes) {
      for (int k = 3; k < 6; ++k) data[k] = std::fabs(data[k]);
      in.rotation(&data[6], 3);
    }
    rows = {kind, data.data(), offsets, 1};
  }
  Body(const Body&) = delete;
  std::vector<double> data;
  std::int64_t offsets[2];
  Bodies rows;
};

bool hit_of(const Body& a, const Body& b, Method method) {
  std::uint8_t hit = 2;
  overlap(a.rows, b.rows, 1, method, 1, &hit);
  require(hit < 2, "no answer");
  return hit;
}

// The way of whole batches: nine copies, of which the last stands alone in its block.
bool hit_in_batch(const Body& a, const Body& b) {
  constexpr std::size_t n = 9;
  std::vector<double> rows[2], blocks[2];
  double skew = 0;
  const Body* bodies[] = {&a, &b};
  for (int s = 0; s < 2; ++s) {
    for (std::size_t i = 0; i < n; ++i)
      rows[s].insert(rows[s].end(), bodies[s]->data.begin(), bodies[s]->data.end());
    blocks[s].resize(2 * 72);
    pack_boxes(rows[s].data(), n, blocks[s].data());
    const Skew found = box_skew(&bodies[s]->data[6], 1, 1e-6);
    require(found.first_beyond == 1, "a rotation is none");
    skew = std::max(skew, found.largest);
  }
  std::uint8_t hit[n];
  overlap_boxes({Kind::boxes, rows[0].data(), nullptr, n}, blocks[0].data(),
                {Kind::boxes, rows[1].data(), nullptr, n}, blocks[1].data(), skew, n, 2, hit);
  for (const auto one : hit) require(one == hit[0], "rows of a batch differ");
  return hit[0];
}

struct Pair {
  Pair(Input& in, double most)
      : flat(in.choice(8) == 7), a(in, kind(in), most), b(in, kind(in), most) {}
  Kind kind(Input& in) const { return flat ? Kind::polygons : Kind(in.choice(4)); }
  bool flat;
  Body a, b;
};

// Every method against exact arithmetic; remembered planes and whole batches, too.
void resting(Input& in) {
  const Pair p(in, 1.7976931348623157e308);
  const bool exact = hit_of(p.a, p.b, Method::exact);
  for (const auto method : {Method::abfme, Method::sat, Method::automatic})
    require(hit_of(p.a, p.b, method) == exact, "an overlap differs from exact");
  std::uint8_t hit = exact;
  if (p.a.rows.kind == Kind::boxes && p.b.rows.kind == Kind::boxes)
    require(hit_in_batch(p.a, p.b) == exact, "a batch of boxes differs from exact");
  if (p.flat) return;
  double witness[7];
  tauguard::rigid::witness(p.a.rows, p.b.rows, 0, hit, witness);
  auto normal = in.numbers(3, 1e3);
  for (int again = 0; again < 2; ++again) {
    overlap_cached(p.a.rows, p.b.rows, 1, 1, normal.data(), &hit);
    require(hit == exact, "a remembered plane differs from exact");
  }
}

// Straight ways: the two methods agree; what touches at either end is hit.
void swept(Input& in) {
  const Pair p(in, 1.7976931348623157e308);
  if (p.flat) return;
  const auto d = in.numbers(3);
  std::uint8_t hit[2];
  double out[2][7];
  sweep(p.a.rows, p.b.rows, d.data(), 1, Method::abfme, 1, true, &hit[0], out[0]);
  sweep(p.a.rows, p.b.rows, d.data(), 1, Method::sat, 1, true, &hit[1], out[1]);
  require(hit[0] == hit[1], "methods of a sweep differ");
  const bool first = hit_of(p.a, p.b, Method::exact);
  require(!first || hit[0], "a sweep loses an overlap");
  for (int m = 0; m < 2; ++m) {
    require(!hit[m] || (out[m][0] >= 0 && out[m][0] <= 1), "a time out of the step");
    require(!first || out[m][0] == 0, "a sweep is late");
  }
}

struct Moved {
  Moved(Input& in, double most) {
    in.rotation(pose, 4);
    for (int k = 0; k < 3; ++k) {
      pose[4 * k + 3] = in.number(most), linear[k] = in.number(most), angular[k] = in.number(20);
    }
    pose[15] = 1;
  }
  RigidMotion motion() const { return RigidMotion(pose, linear, angular); }
  double pose[16] = {}, linear[3], angular[3];
};

// Distances have the sign of the overlap; first contacts lie in the step.
void grown(Input& in) {
  const Pair p(in, far);
  if (p.flat) return;
  const double ra = std::fabs(in.number(far)), rb = std::fabs(in.number(far));
  const bool exact = hit_of(p.a, p.b, Method::exact);
  require(meet(p.a.rows, p.b.rows, 0, 0, 0) == exact, "meet differs from exact");
  const SignedDistance bare = signed_distance(p.a.rows, p.b.rows, 0, 0, 0),
                       gap = signed_distance(p.a.rows, p.b.rows, 0, ra, rb);
  require((bare.distance <= 0) == exact, "a distance has the wrong sign");
  require((gap.distance <= 0) == meet(p.a.rows, p.b.rows, 0, ra, rb), "the sign of a grown pair");
  require(!exact || gap.distance <= 0, "a radius parts bodies");
}

void moving(Input& in) {
  const Pair p(in, far);
  if (p.flat) return;
  const double ra = std::fabs(in.number(far)), rb = std::fabs(in.number(far));
  const Moved a(in, far), b(in, far);
  const FirstTouch touch = bodies_impact(p.a.rows, p.b.rows, 0, ra, rb, a.motion(), b.motion());
  require(touch.toi == INFINITY || (touch.toi >= 0 && touch.toi <= 1), "a time out of the step");
}

struct Faces {
  Faces(Input& in, VolumeKind kind)
      : x(in.numbers(3 * vertices, far_mesh)),
        rows(faces(in)),
        mesh(x.data(), rows.data(), rows.size() / 3, kind) {}
  static std::vector<std::int32_t> faces(Input& in) {
    std::vector<std::int32_t> out(3 * std::size_t(in.between(1, 12)));
    for (auto& v : out) v = in.choice(vertices);
    return out;
  }
  static constexpr int vertices = 8;
  std::vector<double> x;
  std::vector<std::int32_t> rows;
  Mesh mesh;
};

constexpr VolumeKind volumes[] = {VolumeKind::aabb, VolumeKind::obb, VolumeKind::k_dop,
                                  VolumeKind::sphere};

// Two meshes, and a mesh and a body: every kind of bounding volume finds what the others find.
void meshes(Input& in) {
  const VolumeKind kind = volumes[in.choice(4)];
  const Input begin = in;
  const Faces a(in, kind), b(in, kind);
  Input again = begin;
  const Faces plain_a(again, VolumeKind::aabb), plain_b(again, VolumeKind::aabb);
  const Moved ma(in, far_mesh), mb(in, far_mesh);
  const Pose pose(mb.pose);
  Scratch scratch;
  const FacePair hit = first_overlap(a.mesh, b.mesh, pose, scratch);
  require((hit.a >= 0) == (first_overlap(plain_a.mesh, plain_b.mesh, pose, scratch).a >= 0),
          "bounding volumes differ");
  std::vector<Contact> contacts;
  ContactBudget budget(1000);
  all_contacts(a.mesh, b.mesh, pose, scratch, budget, contacts);
  require(contacts.empty() == (hit.a < 0), "contacts and overlap differ");
  FacePair faces{-2, -2};
  const FirstTouch touch = meshes_impact(a.mesh, b.mesh, ma.motion(), mb.motion(), &faces);
  require((faces.a >= 0) == (touch.toi <= 1), "a face without a time");
}

void mesh_and_body(Input& in) {
  const Faces a(in, volumes[in.choice(4)]);
  const Body body(in, Kind(in.choice(4)), far_mesh);
  const RoundedBody rounded(body.rows, 0, std::fabs(in.number(far_mesh)));
  const std::int32_t face = first_overlap(a.mesh, rounded);
  const FaceDistance nearest = nearest_face(a.mesh, rounded);
  require((face >= 0) == (nearest.at.distance <= 0), "a mesh's distance has the wrong sign");
  require(nearest.face >= 0, "no nearest face");
  const Moved ma(in, far_mesh), mb(in, far_mesh);
  std::int32_t touched = -2;
  const FirstTouch touch = mesh_body_impact(a.mesh, rounded, ma.motion(), mb.motion(), &touched);
  require((touched >= 0) == (touch.toi <= 1), "a face without a time");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  Input in(bytes, size);
  void (*const targets[])(Input&) = {resting, swept, grown, moving, meshes, mesh_and_body};
  targets[in.choice(6)](in);
  return 0;
}
