#include "convex_sweep.hpp"

#include <atomic>
#include <limits>

#include "convex_contact.hpp"
#include "convex_overlap.hpp"
#include "convex_resolve.hpp"
#include "convex_slab.hpp"
#include "tauguard/geometry/interrupt.hpp"

namespace tauguard::rigid {

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

struct Chunk {
  const Bodies& a;
  const Bodies& b;
  const double* d;
  std::size_t begin, end;
  std::uint8_t* hit;
  double* out;  // one row per pair: time of impact, point, normal
  bool points;  // find contact points
};

using Tetrahedron = SlabBody<4, 6>;
using Block = SlabBody<8, 3>;

template <class A, class B>
TAUGUARD_INLINE Entry cast_row(const Chunk& c, std::size_t i) {
  A a;
  B b;
  load(c.a.kind, c.a.row(i), c.a.row(i), a);
  load(c.b.kind, c.b.row(i), c.a.row(i), b);
  return cast(a, b, c.d + 3 * i);
}

// Whether there is a hit, by eliminating the separating plane.
template <class A, class B>
TAUGUARD_INLINE Verdict eliminate_row(const Chunk& c, std::size_t i) {
  const double *pa = c.a.row(i), *pb = c.b.row(i), *d = c.d + 3 * i;
  constexpr bool ta = A::edges == 6, tb = B::edges == 6;
  if constexpr (ta && tb)
    return swept_tetrahedra(pa, pb, d);
  else if constexpr (!ta && !tb)
    return swept_zonotopes(zonotope_of(c.a.kind, pa), zonotope_of(c.b.kind, pb), d);
  else if constexpr (tb)
    return swept_zonotope_tetrahedron(zonotope_of(c.a.kind, pa), pb, d);
  else {
    const double back[3] = {-d[0], -d[1], -d[2]};
    return swept_zonotope_tetrahedron(zonotope_of(c.b.kind, pb), pa, back);
  }
}

void write_miss(double* out) {
  out[0] = std::numeric_limits<double>::infinity();
  std::fill(out + 1, out + 7, nan);
}

// Writes a hit at `time`. With a normal the point is the contact point; without one (zero) the
// bodies overlap at the start, and the point is any common point.
__attribute__((noinline)) void write_hit(const Chunk& c, std::size_t i, double time,
                                         const double* normal) {
  double* out = c.out + 7 * i;
  out[0] = time;
  std::fill(out + 1, out + 7, nan);
  const double length = std::sqrt(dot(normal, normal));
  if (!(length > 0)) {
    if (!c.points) return;
    double witness[7];
    find_witness(c.a, c.b, i, common, witness);
    std::copy(witness, witness + 3, out + 1);
    return;
  }
  for (int k = 0; k < 3; ++k) out[4 + k] = normal[k] / length;
  if (!c.points) return;
  const auto pa = vertices_of<double>(c.a, i);
  auto pb = vertices_of<double>(c.b, i);
  double size = 0.0;
  for (auto& p : pb)
    for (int k = 0; k < 3; ++k) {
      p[k] += time * c.d[3 * i + k];
      size = std::max(size, std::fabs(p[k]));
    }
  for (const auto& p : pa) size = std::max(size, norm1(p.data()));
  const Vec3 point = contact_point(pa, pb, geometry::load(out + 4), 1e-11 * size);
  std::copy(point.begin(), point.end(), out + 1);
}

// Writes a hit that exact arithmetic found. If the bodies touch at the start, the normal is the
// axis of the latest entry, unless this entry is certainly before the start.
__attribute__((noinline)) void write_exact_hit(const Chunk& c, std::size_t i, const Entry& entry) {
  double normal[3];
  const double time = advance_exactly(c.a, c.b, c.d + 3 * i, i, normal);
  const double none[3] = {0, 0, 0};
  if (std::isnan(normal[0]))
    return write_hit(c, i, time, entry.reliable >= 0 ? entry.normal : none);
  write_hit(c, i, time, normal);
}

void write_entry(const Chunk& c, std::size_t i, const Entry& entry) {
  const double none[3] = {0, 0, 0};
  write_hit(c, i, std::min(1.0, std::max(0.0, entry.enter)),
            entry.reliable >= 0 ? entry.normal : none);
}

template <class A, class B, bool Eliminate>
TAUGUARD_INLINE std::size_t run_rows(const Chunk& c) {
  std::size_t left = 0;
  for (std::size_t i = c.begin; i < c.end; ++i) {
    Verdict v = undecided;
    Entry entry;
    if constexpr (Eliminate) {
      v = eliminate_row<A, B>(c, i);
      if (v == common) entry = cast_row<A, B>(c, i);
    } else {
      entry = cast_row<A, B>(c, i);
      v = entry.miss() ? separated : entry.hit() ? common : eliminate_row<A, B>(c, i);
    }
    const bool exact = v == undecided || (v == common && !entry.hit());
    if (v == undecided) v = resolve_sweep_exactly(c.a, c.b, c.d + 3 * i, i);
    c.hit[i] = v == common;
    if (v != common)
      write_miss(c.out + 7 * i);
    else if (exact)
      write_exact_hit(c, i, Eliminate ? cast_row<A, B>(c, i) : entry);
    else
      write_entry(c, i, entry);
    left += exact;
  }
  return left;
}

std::size_t run_hulls(const Chunk& c) {
  for (std::size_t i = c.begin; i < c.end; ++i) {
    c.hit[i] = resolve_sweep_exactly(c.a, c.b, c.d + 3 * i, i) == common;
    if (c.hit[i])
      write_exact_hit(c, i, Entry());
    else
      write_miss(c.out + 7 * i);
  }
  return c.end - c.begin;
}

using Runner = std::size_t (*)(const Chunk&);

template <class A, class B, bool Eliminate>
std::size_t run_portable(const Chunk& c) {
  return run_rows<A, B, Eliminate>(c);
}
#if defined(TAUGUARD_AVX2)
template <class A, class B, bool Eliminate>
TAUGUARD_AVX2 std::size_t run_avx2(const Chunk& c) {
  return run_rows<A, B, Eliminate>(c);
}
#endif

template <class A, class B>
Runner runner(bool eliminate) {
#if defined(TAUGUARD_AVX2)
  if (use_avx2()) return eliminate ? run_avx2<A, B, true> : run_avx2<A, B, false>;
#endif
  return eliminate ? run_portable<A, B, true> : run_portable<A, B, false>;
}

Runner choose(Kind a, Kind b, Method method) {
  if (is_cloud(a) || is_cloud(b) || method == Method::exact) return run_hulls;
  const bool eliminate = method != Method::sat;
  if (a == Kind::tetrahedra)
    return b == Kind::tetrahedra ? runner<Tetrahedron, Tetrahedron>(eliminate)
                                 : runner<Tetrahedron, Block>(eliminate);
  return b == Kind::tetrahedra ? runner<Block, Tetrahedron>(eliminate)
                               : runner<Block, Block>(eliminate);
}

}  // namespace

std::size_t sweep(const Bodies& a, const Bodies& b, const double* d, std::size_t n, Method method,
                  int threads, bool points, std::uint8_t* hit, double* out) {
  const Runner run = choose(a.kind, b.kind, method);
  std::atomic<std::size_t> left{0};
  geometry::interruptible_for(n, threads, 256, [&](auto begin, auto end, auto) {
    left += run(Chunk{a, b, d, begin, end, hit, out, points});
  });
  return left;
}

}  // namespace tauguard::rigid
