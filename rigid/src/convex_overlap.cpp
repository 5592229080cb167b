#include "convex_overlap.hpp"

#include <atomic>

#include "comparison_sat.hpp"
#include "convex_abfme.hpp"
#include "convex_boxes.hpp"
#include "convex_resolve.hpp"
#include "convex_sat.hpp"
#include "tauguard/geometry/interrupt.hpp"

namespace tauguard::rigid {

namespace {

constexpr std::size_t grain = 1024;

struct Chunk {
  const Bodies& a;
  const Bodies& b;
  std::size_t begin, end;
  std::uint8_t* hit;
};

// A kernel decides one row; `resolve_exactly` decides rows that it leaves undecided.
#define TAUGUARD_KERNEL(Name, expression)                                  \
  struct Name {                                                            \
    TAUGUARD_INLINE static Verdict decide(const Chunk& c, std::size_t i) { \
      const double *pa = c.a.row(i), *pb = c.b.row(i);                     \
      const Kind ka = c.a.kind, kb = c.b.kind;                             \
      (void)ka, (void)kb;                                                  \
      return expression;                                                   \
    }                                                                      \
  }
TAUGUARD_KERNEL(AbfmeTT, abfme_tetrahedra(pa, pb));
TAUGUARD_KERNEL(AbfmeZZ, abfme_zonotopes(zonotope_of(ka, pa), zonotope_of(kb, pb)));
TAUGUARD_KERNEL(AbfmeZT, abfme_zonotope_tetrahedron(zonotope_of(ka, pa), pb));
TAUGUARD_KERNEL(AbfmeTZ, abfme_zonotope_tetrahedron(zonotope_of(kb, pb), pa));
TAUGUARD_KERNEL(SatTT, sat_tetrahedra(pa, pb));
TAUGUARD_KERNEL(SatZZ, sat_zonotopes(zonotope_of(ka, pa), zonotope_of(kb, pb)));
TAUGUARD_KERNEL(SatZT, sat_zonotope_tetrahedron(zonotope_of(ka, pa), pb));
TAUGUARD_KERNEL(SatTZ, sat_zonotope_tetrahedron(zonotope_of(kb, pb), pa));
#undef TAUGUARD_KERNEL

template <class A, class B>
struct Textbook {
  TAUGUARD_INLINE static Verdict decide(const Chunk& c, std::size_t i) {
    return textbook_overlap<A, B>(c.a.kind, c.a.row(i), c.b.kind, c.b.row(i)) ? common : separated;
  }
};
struct HullSimplexMethod {
  static Verdict decide(const Chunk& c, std::size_t i) { return resolve_hulls(c.a, c.b, i); }
};
struct HullEliminationMethod {
  static Verdict decide(const Chunk& c, std::size_t i) { return eliminate_hulls(c.a, c.b, i); }
};
struct AlwaysUndecided {
  static Verdict decide(const Chunk&, std::size_t) { return undecided; }
};

template <class Kernel>
TAUGUARD_INLINE std::size_t run_rows(const Chunk& c) {
  std::size_t left = 0;
  for (std::size_t i = c.begin; i < c.end; ++i) {
    Verdict v = Kernel::decide(c, i);
    if (v == undecided) {
      // For boxes with parallel edges in deep contact there is a faster kernel. The skew covers
      // every rotation that ORTHONORMAL_TOLERANCE (rigid/shapes.py) accepts.
      if (c.a.kind == Kind::boxes && c.b.kind == Kind::boxes)
        v = box_pair(c.a.row(i), c.b.row(i), 1.001e-6);
      if (v == undecided) {
        ++left;
        v = resolve_exactly(c.a, c.b, i);
      }
    }
    c.hit[i] = v == common;
  }
  return left;
}

template <class Kernel>
std::size_t run_portable(const Chunk& c) {
  return run_rows<Kernel>(c);
}

using Runner = std::size_t (*)(const Chunk&);

#if defined(TAUGUARD_AVX2)
template <class Kernel>
TAUGUARD_AVX2 std::size_t run_avx2(const Chunk& c) {
  return run_rows<Kernel>(c);
}
template <class Kernel>
Runner runner() {
  return use_avx2() ? run_avx2<Kernel> : run_portable<Kernel>;
}
#else
template <class Kernel>
Runner runner() {
  return run_portable<Kernel>;
}
#endif

template <class TT, class TZ, class ZT, class ZZ>
Runner by_kinds(bool tetrahedra_a, bool tetrahedra_b) {
  if (tetrahedra_a) return tetrahedra_b ? runner<TT>() : runner<TZ>();
  return tetrahedra_b ? runner<ZT>() : runner<ZZ>();
}

Runner choose(Kind a, Kind b, Method method) {
  if (method == Method::exact) return run_portable<AlwaysUndecided>;
  if (a == Kind::polygons || (a == Kind::hulls && b == Kind::hulls && method == Method::abfme))
    return run_portable<HullEliminationMethod>;
  if (a == Kind::hulls || b == Kind::hulls) return run_portable<HullSimplexMethod>;
  const bool ta = a == Kind::tetrahedra, tb = b == Kind::tetrahedra;
  using T = TextbookTetrahedron;
  using Z = TextbookBlock;
  if (method == Method::textbook_sat)
    return by_kinds<Textbook<T, T>, Textbook<T, Z>, Textbook<Z, T>, Textbook<Z, Z>>(ta, tb);
  if (method == Method::sat) return by_kinds<SatTT, SatTZ, SatZT, SatZZ>(ta, tb);
  return by_kinds<AbfmeTT, AbfmeTZ, AbfmeZT, AbfmeZZ>(ta, tb);
}

}  // namespace

std::size_t overlap(const Bodies& a, const Bodies& b, std::size_t n, Method method, int threads,
                    std::uint8_t* hit) {
  const Runner run = choose(a.kind, b.kind, method);
  std::atomic<std::size_t> left{0};
  geometry::interruptible_for(n, threads, grain, [&](auto begin, auto end, auto) {
    left += run(Chunk{a, b, begin, end, hit});
  });
  return left;
}

RowMethod row_method(Kind a, Kind b, Method method) {
  const Runner run = choose(a, b, method);
  return [run](const Bodies& x, const Bodies& y, std::size_t row, std::uint8_t* hit) {
    run(Chunk{x, y, row, row + 1, hit});
  };
}

void witness(const Bodies& a, const Bodies& b, std::size_t row, bool hit, double* out) {
  find_witness(a, b, row, hit ? common : separated, out);
}

}  // namespace tauguard::rigid
