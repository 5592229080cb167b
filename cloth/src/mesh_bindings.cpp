// tauguard.cloth._mesh: continuous collision detection of a mesh, one call per frame.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <algorithm>
#include <atomic>
#include <mutex>

#include "apart.hpp"
#include "batch.hpp"
#include "comparators.hpp"
#include "frame.hpp"
#include "mesh_ccd.hpp"
#include "tauguard/geometry/argument_errors.hpp"
#include "tauguard/geometry/call_lock.hpp"
#include "tauguard/geometry/interrupt_binding.hpp"
#include "tauguard/geometry/rounding.hpp"
#include "too_many.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace tauguard::cloth;
using tauguard::geometry::CallLock;
using tauguard::geometry::LongCall;

namespace {

using Faces = nb::ndarray<const std::int32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Ids = nb::ndarray<const std::int32_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Table = nb::ndarray<const std::uint8_t, nb::shape<-1, -1>, nb::c_contig, nb::device::cpu>;
using Positions = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Pairs = nb::ndarray<nb::numpy, std::int32_t, nb::shape<-1, 2>, nb::c_contig>;
using Named = nb::typed<nb::dict, nb::str, nb::any>;

// Makes an array from a std::vector or a SpareArray.
template <class Array, class Values>
Array array_of(Values values, std::initializer_list<std::size_t> shape) {
  auto* owned = new Values(std::move(values));
  nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<Values*>(p); });
  return Array(owned->data(), shape, owner);
}

std::vector<std::int32_t> list_of(const Faces& faces) {
  return {faces.data(), faces.data() + faces.size()};
}

Groups groups_of(const Ids& ids, const Table& meets) {
  Groups groups;
  groups.of_vertex.assign(ids.data(), ids.data() + ids.size());
  groups.meets.assign(meets.data(), meets.data() + meets.size());
  groups.count = static_cast<std::int32_t>(meets.shape(0));
  return groups;
}

// The two feature numbers of a pair as one key. Sorting keys sorts the pairs.
std::uint64_t key_of(const std::int32_t* pair) {
  return std::uint64_t(std::uint32_t(pair[0])) << 32 | std::uint32_t(pair[1]);
}

// A mesh whose lock allows one call at a time, also with Python threads, signals and forks.
struct Mesh {
  Mesh(Faces faces, Ids ids, Table meets, int k, std::optional<bool> moving, int threads)
      : ccd(list_of(faces), groups_of(ids, meets), VolumeKind{k, moving.value_or(true)},
            !moving.has_value(), threads) {}
  MeshCcd ccd;
  CallLock lock;
};
// A call on a mesh. It releases the interpreter's lock and can be ended by Ctrl-C.
struct Call {
  explicit Call(Mesh& mesh) : one(mesh.lock) {}
  LongCall open;
  std::lock_guard<CallLock> one;
};

std::vector<std::int32_t> sorted_candidates(MeshCcd& ccd, MeshCcd::Kind kind, std::size_t limit) {
  std::vector<std::vector<std::uint64_t>> parts(ccd.chunks(kind));
  std::atomic<std::size_t> found{0};
  ccd.for_each_block(kind, [&](const CandidateBlock& block, std::size_t chunk) {
    if ((found += block.size) > limit) throw TooMany("candidates of a kind", limit);
    for (std::size_t i = 0; i < block.size; ++i)
      parts[chunk].push_back(key_of(&block.pairs[2 * i]));
  });
  std::vector<std::uint64_t> keys;
  for (const auto& part : parts) keys.insert(keys.end(), part.begin(), part.end());
  std::sort(keys.begin(), keys.end());
  std::vector<std::int32_t> pairs;
  pairs.reserve(2 * keys.size());
  for (const auto key : keys) {
    pairs.push_back(static_cast<std::int32_t>(key >> 32));
    pairs.push_back(static_cast<std::int32_t>(key));
  }
  return pairs;
}

template <class Bound>
using Blocks = nb::ndarray<const Bound, nb::shape<-1, -1, 2, 16>, nb::c_contig>;
using LeafVertices = nb::ndarray<const std::int32_t, nb::shape<-1, 16>, nb::c_contig>;

// For tests: the overlaps of two leaves by the named variant of the kernels. The result has, for
// each row of one leaf, the lanes of the other leaf that it overlaps, and then the number of pairs
// that share a vertex. It is empty if the processor cannot run the variant.
template <class Bound>
auto leaf_pair(const std::string& variant, Blocks<Bound> a, Blocks<Bound> b,
               LeafVertices vertices_a, LeafVertices vertices_b, bool same) {
  const auto* kernels = overlap_kernels<Bound>(variant.c_str());
  std::vector<std::int32_t> found;
  if (kernels) {
    const auto leaf = [](const Blocks<Bound>& block, const LeafVertices& vertices) {
      return LeafLanes<Bound>{block.data(), vertices.data(), static_cast<int>(vertices.shape(0)),
                              0xffff};
    };
    Overlaps out;
    kernels->leaf_pair(leaf(a, vertices_a), leaf(b, vertices_b), static_cast<int>(a.shape(0)),
                       static_cast<int>(a.shape(1)), same, out);
    for (int i = 0; i < lanes; ++i) found.push_back(out.rows >> i & 1 ? out.lanes_of[i] : 0);
    found.push_back(static_cast<std::int32_t>(out.adjacent));
  }
  const std::size_t n = found.size();
  return array_of<nb::ndarray<nb::numpy, std::int32_t, nb::shape<-1>>>(std::move(found), {n});
}

// Adds the counts to a dictionary, by their names.
template <class Counts>
nb::dict with_counts(nb::dict d, Counts counts) {
  tauguard::geometry::for_each_field(
      counts, [&](const std::string& name, std::uint64_t count) { d[name.c_str()] = count; });
  return d;
}

nb::dict stats_of(const BroadStats& s, std::size_t bytes) {
  nb::dict seconds, d;
  seconds["project"] = s.project_s;
  seconds["build"] = s.build_s;
  seconds["refit"] = s.refit_s;
  seconds["traverse"] = s.traverse_s;
  d["vf"] = with_counts({}, s.vf);
  d["ee"] = with_counts({}, s.ee);
  d["seconds"] = seconds;
  d["builds"] = s.builds;
  d["bytes"] = bytes;
  return d;
}

nb::typed<nb::tuple, Pairs, Pairs, Named> candidates(Mesh& mesh, Positions x_t0, Positions x_t1,
                                                     double min_distance, bool fresh,
                                                     std::size_t limit) {
  std::vector<std::int32_t> vf, ee;
  BroadStats broad;
  std::size_t bytes = 0;
  {
    const Call call(mesh);
    mesh.ccd.prepare(x_t0.data(), x_t1.data(), x_t0.shape(0), min_distance, fresh, limit);
    vf = sorted_candidates(mesh.ccd, MeshCcd::Kind::vf, limit);
    ee = sorted_candidates(mesh.ccd, MeshCcd::Kind::ee, limit);
    broad = mesh.ccd.stats();
    bytes = mesh.ccd.bytes();
  }
  const std::size_t n_vf = vf.size() / 2, n_ee = ee.size() / 2;
  return nb::make_tuple(array_of<Pairs>(std::move(vf), {n_vf, 2}),
                        array_of<Pairs>(std::move(ee), {n_ee, 2}), stats_of(broad, bytes));
}

// The arrays "pairs", "toi", "point", "normal" and "weights", and "counts" of the search.
nb::dict arrays_of(Collisions c, const BroadCounts& broad) {
  using Scalars = nb::ndarray<nb::numpy, double, nb::shape<-1>, nb::c_contig>;
  using Rows = nb::ndarray<nb::numpy, double, nb::shape<-1, -1>, nb::c_contig>;
  const std::size_t n = c.size();
  nb::dict counts = with_counts(with_counts({}, broad), c.stats), d;
  counts["hits"] = n;
  d["counts"] = counts;
  d["pairs"] = array_of<Pairs>(std::move(c.pairs), {n, 2});
  d["toi"] = array_of<Scalars>(std::move(c.toi), {n});
  d["point"] = array_of<Rows>(std::move(c.point), {n, 3});
  d["normal"] = array_of<Rows>(std::move(c.normal), {n, 3});
  d["weights"] = array_of<Rows>(std::move(c.weights), {n, 4});
  return d;
}

using Found = nb::typed<nb::tuple, Named, Named, Named>;

// `method` is a Method, or `first_comparator` and a Comparator.
constexpr int first_comparator = 2;

Found find(Mesh& mesh, Positions x_t0, Positions x_t1, int method, double min_distance, bool fresh,
           std::size_t limit) {
  Collisions vf, ee;
  BroadStats broad;
  std::size_t bytes = 0;
  const auto search = [&](MeshCcd::Kind kind) {
    if (method < first_comparator)
      return find_collisions(mesh.ccd, kind, Method(method), min_distance, limit);
    const auto narrow_phase = [=](const Ends& x, const std::int32_t* rows, std::size_t n,
                                  std::uint8_t* hit, ImpactArrays impacts, Stats& stats) {
      (kind == MeshCcd::Kind::vf ? compare_vf : compare_ee)(
          x, rows, n, Comparator(method - first_comparator), hit, impacts, stats);
    };
    return find_collisions(mesh.ccd, kind, narrow_phase, limit);
  };
  {
    const Call call(mesh);
    mesh.ccd.prepare(x_t0.data(), x_t1.data(), x_t0.shape(0), min_distance, fresh, limit);
    vf = search(MeshCcd::Kind::vf);
    ee = search(MeshCcd::Kind::ee);
    broad = mesh.ccd.stats();
    bytes = mesh.ccd.bytes();
  }
  nb::dict stats = stats_of(broad, bytes), seconds = nb::cast<nb::dict>(stats["seconds"]);
  seconds["vf"] = vf.total_s;
  seconds["ee"] = ee.total_s;
  seconds["vf_narrow"] = vf.narrow_s;
  seconds["ee_narrow"] = ee.narrow_s;
  return nb::make_tuple(arrays_of(std::move(vf), broad.vf), arrays_of(std::move(ee), broad.ee),
                        stats);
}

using Rows4 = nb::ndarray<const std::int32_t, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;
using Hits = nb::ndarray<std::uint8_t, nb::shape<-1>, nb::c_contig>;
using Times = nb::ndarray<double, nb::shape<-1>, nb::c_contig>;
using Vectors = nb::ndarray<double, nb::shape<-1, 3>, nb::c_contig>;
using Weights = nb::ndarray<double, nb::shape<-1, 4>, nb::c_contig>;

Named solve(bool vf, Positions x_t0, Positions x_t1, Rows4 rows, int method, double min_distance,
            Hits hit, Times toi, Vectors point, Vectors normal, Weights weights) {
  Stats stats;
  {
    const LongCall call;
    const tauguard::geometry::RoundToNearest guard;
    const Ends ends = Ends::of(x_t0.data(), x_t1.data());
    const ImpactArrays impacts{toi.data(), point.data(), normal.data(), weights.data()};
    const std::size_t n = rows.shape(0);
    Projection points;
    AxisFilter axes;
    // Projecting a vertex costs 18 ns and saves 6 ns per query, so it pays from 4 queries on.
    constexpr std::size_t pays = 4;
    if (Method(method) == Method::ab2pf && min_distance == 0 && n >= pays * x_t0.shape(0)) {
      points.scale_to(ends, x_t0.shape(0), seven_axes, 0, 1);
      points.set(ends, x_t0.shape(0), false, 1);
      axes.points = &points;
    }
    if (method < first_comparator)
      (vf ? solve_vf : solve_ee)(ends, rows.data(), n, Method(method), min_distance, hit.data(),
                                 impacts, stats, axes);
    else
      (vf ? compare_vf : compare_ee)(ends, rows.data(), n, Comparator(method - first_comparator),
                                     hit.data(), impacts, stats);
  }
  return with_counts({}, stats);
}

Named update_topology(Mesh& mesh, Faces faces, Ids ids, Table meets) {
  TopologyChange change;
  std::vector<std::int32_t> edges;
  {
    auto list = list_of(faces);
    auto groups = groups_of(ids, meets);
    const Call call(mesh);
    change = mesh.ccd.update_topology(std::move(list), std::move(groups));
    edges = mesh.ccd.topology().edges.vertices;
  }
  nb::dict d;
  const char* kinds[] = {"vertices", "edges", "faces"};
  for (int i = 0; i < 3; ++i) d[kinds[i]] = nb::make_tuple(change.removed[i], change.added[i]);
  d["rebuilt"] = change.rebuilt;
  const std::size_t n = edges.size() / 2;
  d["edge_rows"] = array_of<Pairs>(std::move(edges), {n, 2});
  return d;
}

}  // namespace

NB_MODULE(_mesh, m) {
  m.doc() =
      "Continuous collision detection of a mesh, one call per frame. Arguments are checked in "
      "Python.";
  tauguard::geometry::bind_interrupts();
  tauguard::geometry::bind_argument_errors();
  nb::exception<TooMany>(m, "TooManyError", tauguard::geometry::argument_error().ptr());
  nb::class_<Mesh>(m, "Mesh")
      .def(nb::init<Faces, Ids, Table, int, std::optional<bool>, int>(), "faces"_a, "ids"_a,
           "meets"_a, "k"_a, "moving"_a.none(), "threads"_a)
      .def("edges",
           [](Mesh& mesh) {
             std::vector<std::int32_t> list;
             {
               const Call call(mesh);
               list = mesh.ccd.topology().edges.vertices;
             }
             const std::size_t n = list.size() / 2;
             return array_of<Pairs>(std::move(list), {n, 2});
           })
      .def("candidates", &candidates, "x_t0"_a, "x_t1"_a, "min_distance"_a, "fresh"_a, "limit"_a)
      .def("find", &find, "x_t0"_a, "x_t1"_a, "method"_a, "min_distance"_a, "fresh"_a, "limit"_a)
      .def("update_topology", &update_topology, "faces"_a, "ids"_a, "meets"_a);
  m.def("solve", &solve, "vf"_a, "x_t0"_a, "x_t1"_a, "rows"_a, "method"_a, "min_distance"_a,
        "hit"_a, "toi"_a, "point"_a, "normal"_a, "weights"_a);
  m.def(
      "force_batch_kernels",
      [](const std::string& name) { return force_batch_kernels(name.c_str()); }, "name"_a,
      "For tests: narrow-phase kernels to use from now on (\"portable\", \"avx2\"); any other name "
      "selects the fastest ones. True if this machine can run the named ones.");
  m.def("leaf_pair", &leaf_pair<float>, "variant"_a, "a"_a, "b"_a, "vertices_a"_a, "vertices_b"_a,
        "same"_a);
  m.def("leaf_pair", &leaf_pair<std::int16_t>, "variant"_a, "a"_a, "b"_a, "vertices_a"_a,
        "vertices_b"_a, "same"_a);
}
