#include "convex_overlap.hpp"

#include <atomic>

#include "convex_abfme.hpp"
#include "convex_resolve.hpp"
#include "tauguard/geometry/thread_pool.hpp"

namespace tauguard::rigid {

namespace {

constexpr std::size_t grain = 1024;

struct Chunk {
  const Bodies& a;
  const Bodies& b;
  std::size_t begin, end;
  std::uint8_t* hit;
};

struct AbfmeTetrahedra {
  TAUGUARD_INLINE static Verdict decide(const Chunk& c, std::size_t i) {
    return abfme_tetrahedra(c.a.row(i), c.b.row(i));
  }
};
struct AbfmeZonotopes {
  TAUGUARD_INLINE static Verdict decide(const Chunk& c, std::size_t i) {
    return abfme_zonotopes(zonotope_of(c.a.kind, c.a.row(i)), zonotope_of(c.b.kind, c.b.row(i)));
  }
};
struct AbfmeZonotopeTetrahedron {
  TAUGUARD_INLINE static Verdict decide(const Chunk& c, std::size_t i) {
    return abfme_zonotope_tetrahedron(zonotope_of(c.a.kind, c.a.row(i)), c.b.row(i));
  }
};
struct AbfmeTetrahedronZonotope {
  TAUGUARD_INLINE static Verdict decide(const Chunk& c, std::size_t i) {
    return abfme_zonotope_tetrahedron(zonotope_of(c.b.kind, c.b.row(i)), c.a.row(i));
  }
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
      ++left;
      v = resolve_exactly(c.a, c.b, i);
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
  return __builtin_cpu_supports("avx2") ? run_avx2<Kernel> : run_portable<Kernel>;
}
#else
template <class Kernel>
Runner runner() {
  return run_portable<Kernel>;
}
#endif

Runner choose(Kind a, Kind b, Method method) {
  if (a == Kind::hulls || b == Kind::hulls || method == Method::exact) return run_portable<AlwaysUndecided>;
  const bool ta = a == Kind::tetrahedra, tb = b == Kind::tetrahedra;
  if (ta && tb) return runner<AbfmeTetrahedra>();
  if (!ta && !tb) return runner<AbfmeZonotopes>();
  return ta ? runner<AbfmeTetrahedronZonotope>() : runner<AbfmeZonotopeTetrahedron>();
}

}  // namespace

std::size_t overlap(const Bodies& a, const Bodies& b, std::size_t n, Method method, int threads,
                    std::uint8_t* hit) {
  const Runner run = choose(a.kind, b.kind, method);
  std::atomic<std::size_t> left{0};
  geometry::ThreadPool::shared().parallel_for(n, threads, grain, [&](auto begin, auto end, auto) {
    left += run(Chunk{a, b, begin, end, hit});
  });
  return left;
}

void witnesses(const Bodies& a, const Bodies& b, std::size_t n, int threads, double* out) {
  geometry::ThreadPool::shared().parallel_for(n, threads, 64, [&](auto begin, auto end, auto) {
    for (auto i = begin; i < end; ++i) find_witness(a, b, i, out + 7 * i);
  });
}

}  // namespace tauguard::rigid
