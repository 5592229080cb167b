#include "batch.hpp"

#include <algorithm>
#include <atomic>

#include "apart.hpp"
#include "cuts.hpp"

namespace tauguard::cloth {
namespace {

// 2^-e for 2^e <= x < 2^(e + 1), for normal x below 2^1023.
TAUGUARD_INLINE Double4 inverse_power(Double4 x) {
  const Mask4 exponent = (Mask4)x & (std::int64_t{0x7ff} << 52);
  return (Double4)((std::int64_t{0x7fe} << 52) - exponent);
}

// Computes the Bernstein coefficients of the cubics p . (q x r) and their error bounds. Let u =
// 2^-53 and M the product of the largest |p|, |q| and |r|. The errors are at most
//   u           of a difference (relative),
//   48 u M      of a triple product: 6 terms, each with 3 u of its factors and 5 u of arithmetic,
//   108 u M     of a mixed product p . (q0 x r1 + q1 x r0), which has 12 terms,
//   64 u M      of a coefficient (a mixed product, a triple product and sums, divided by three),
//   162 u M     from three cuts (54 u M each; a coefficient is at most 6 M),
//   60 u M      from evaluating the polynomial,
//   324 u M     from rounding the argument.
// The last four add up to 610 u M; the bound is 2^-43 M = 1024 u M. Underflow adds less than
// 2^-1000.
TAUGUARD_INLINE void finish(const Vec3x4* p, const Vec3x4* q, const Vec3x4* r, Group& g) {
  Double4 sizes[3] = {splat(0), splat(0), splat(0)};
  for (int e = 0; e < 2; ++e) {
    sizes[0] = max(sizes[0], largest(p[e]));
    sizes[1] = max(sizes[1], largest(q[e]));
    sizes[2] = max(sizes[2], largest(r[e]));
  }
  const Double4 big = max(max(sizes[0], sizes[1]), sizes[2]);
  const Mask4 fair = (big > 0x1p-900) & (big < 0x1p900);
  const Double4 s = inverse_power(big);
  const Vec3x4 p0 = s * p[0], p1 = s * p[1], q0 = s * q[0], q1 = s * q[1], r0 = s * r[0],
               r1 = s * r[1];
  const Vec3x4 c00 = cross(q0, r0), c11 = cross(q1, r1), mixed = cross(q0, r1) + cross(q1, r0);
  const Double4 b0 = dot(p0, c00), b1 = (1.0 / 3) * (dot(p1, c00) + dot(p0, mixed)),
                b2 = (1.0 / 3) * (dot(p0, c11) + dot(p1, mixed)), b3 = dot(p1, c11);
  const Double4 error = 0x1p-43 * ((s * sizes[0]) * (s * sizes[1]) * (s * sizes[2])) + 0x1p-1000;
  const Cubics cubic{{b0, b1, b2, b3}};
  const auto flag = [](Mask4 where, std::int64_t value) { return where & (Mask4{} + value); };
  const Mask4 flags = flag(~fair, Group::odd) |
                      flag(~(fair & (abs(b0) > error) & (abs(b3) > error)), Group::open) |
                      flag(fair & one_sign(cubic, error), Group::no_root) |
                      flag(fair & one_root(cubic, error), Group::one_root);
  std::memcpy(g.flags, &flags, sizeof flags);
  store4(g.value[Group::cubic], b0);
  store4(g.value[Group::cubic + 1], b1);
  store4(g.value[Group::cubic + 2], b2);
  store4(g.value[Group::cubic + 3], b3);
  store4(g.value[Group::error], error);
  store4(g.value[Group::big], s * big);
  store4(g.value[Group::scale], s);
}

TAUGUARD_INLINE Vec3x4 transposed(Double4 a, Double4 b, Double4 c, Double4 d) {
  const Double4 ab = __builtin_shufflevector(a, b, 0, 4, 2, 6),
                cd = __builtin_shufflevector(c, d, 0, 4, 2, 6);
  const Double4 y_ab = __builtin_shufflevector(a, b, 1, 5, 3, 7),
                y_cd = __builtin_shufflevector(c, d, 1, 5, 3, 7);
  return {__builtin_shufflevector(ab, cd, 0, 1, 4, 5),
          __builtin_shufflevector(y_ab, y_cd, 0, 1, 4, 5),
          __builtin_shufflevector(ab, cd, 2, 3, 6, 7)};
}

// The differences (query.hpp) of `width` queries at both ends of the step, one query per lane. They
// are not stored between two stages: the positions stay in the cache, and are a third of the size.
struct Differences {
  Vec3x4 p[2], q[2], r[2];
};
// row(i): the vertices of query i.
template <bool vf, bool packed, class Row>
TAUGUARD_INLINE Differences differences(const Ends& x, const Row& row) {
  Differences all;
  for (int e = 0; e < 2; ++e) {
    Double4 p[width], q[width], r[width];
    for (int i = 0; i < width; ++i) {
      const std::int32_t* v = row(i);
      const Double4 a = point<packed>(x, e, v[0]), b = point<packed>(x, e, v[1]),
                    c = point<packed>(x, e, v[2]), d = point<packed>(x, e, v[3]);
      p[i] = vf ? a - b : c - a;
      q[i] = vf ? c - b : b - a;
      r[i] = vf ? d - b : d - c;
    }
    all.p[e] = transposed(p[0], p[1], p[2], p[3]);
    all.q[e] = transposed(q[0], q[1], q[2], q[3]);
    all.r[e] = transposed(r[0], r[1], r[2], r[3]);
  }
  return all;
}

template <bool vf, bool packed>
TAUGUARD_INLINE void gather(const Ends& x, const std::int32_t* rows, int n, Group* groups) {
  for (int first = 0; first < n; first += width, ++groups) {
    const auto row = [&](int i) { return rows + 4 * std::min(first + i, n - 1); };
    for (int i = 0; i < width; ++i) prefetch<packed>(x, row(i + ahead));
    const Differences of = differences<vf, packed>(x, row);
    finish(of.p, of.q, of.r, *groups);
  }
}

// Decides whether features touch at the start if their four vertices have one equal coordinate, or
// if a vertex of one is a vertex of the other. In the first case they touch if the origin is on one
// side of an edge of the hull and on the other side of no edge. With u = 2^-53, the relative error
// is 3 u for a product of two differences and 4 u = 2^-51 for the difference of two products. A
// side is exactly 0 if both products have a zero factor, which is frequent for faces with edges
// along the axes.
template <bool vf, bool packed>
TAUGUARD_INLINE void at_start(const Ends& x, const std::int32_t* rows, const std::int32_t* queries,
                              int n, AtStart* found) {
  for (int first = 0; first < n; first += width) {
    Vec3x4 v[4];
    for (int j = 0; j < 4; ++j) {
      const auto of = [&](int i) {
        return point<packed>(x, false, rows[4 * queries[std::min(first + i, n - 1)] + j]);
      };
      v[j] = transposed(of(0), of(1), of(2), of(3));
    }
    const auto equal = [&](auto of) {
      return (of(v[0]) == of(v[1])) & (of(v[0]) == of(v[2])) & (of(v[0]) == of(v[3]));
    };
    const Mask4 on_x = equal([](const Vec3x4& a) { return a.x; }),
                on_y = equal([](const Vec3x4& a) { return a.y; }),
                on_z = equal([](const Vec3x4& a) { return a.z; });
    Double4 along[4], across[4];  // the two other axes
    for (int j = 0; j < 4; ++j) {
      along[j] = on_x ? v[j].y : on_y ? v[j].z : v[j].x;
      across[j] = on_x ? v[j].z : on_y ? v[j].x : v[j].y;
    }
    Mask4 left{}, right{}, sure = on_x | on_y | on_z, met{};
    const Mask4 flat = sure;
    for (const auto& side : sides_of<vf>) {
      const int o = side[0], a = side[1], b = side[2];
      const Double4 ax = along[a] - along[o], ay = across[a] - across[o], bx = along[b] - along[o],
                    by = across[b] - across[o], x_part = ax * by, y_part = ay * bx;
      const Double4 size = abs(x_part) + abs(y_part), turn = x_part - y_part;
      const Mask4 plus = (turn > 0x1p-51 * size) & (size > 1e-250),
                  minus = (turn < -0x1p-51 * size) & (size > 1e-250),
                  on = ((ax == 0) | (by == 0)) & ((ay == 0) | (bx == 0));
      left |= plus;
      right |= minus;
      sure &= on | plus | minus;
    }
    for (int i = 0; i < (vf ? 1 : 2); ++i)
      for (int j = vf ? 1 : 2; j < 4; ++j)
        met |= (v[i].x == v[j].x) & (v[i].y == v[j].y) & (v[i].z == v[j].z);
    const unsigned touching = bits(met | (sure & (left ^ right))),
                   apart = bits(flat & left & right);
    for (int i = 0; i < width && first + i < n; ++i)
      found[first + i] = touching >> i & 1 ? AtStart::touching
                         : apart >> i & 1  ? AtStart::apart
                                           : AtStart::unknown;
  }
}

TAUGUARD_INLINE Cut cut(const Group* groups, std::int32_t* queries, int n, Piece* pieces) {
  Cut found;
  for (int first = 0; first < n; first += width) {
    alignas(64) double value[5][width];
    for (int i = 0; i < width; ++i) {
      const std::int32_t query = queries[std::min(first + i, n - 1)];
      for (int j = 0; j < 5; ++j)
        value[j][i] = groups[query / width].value[Group::cubic + j][query % width];
    }
    const Cubics whole{{load4(value[0]), load4(value[1]), load4(value[2]), load4(value[3])}};
    const Double4 error = load4(value[4]), at = cut_of(whole);
    Cubics part[2];
    halve(whole, at, part[0], part[1]);
    Mask4 decided = (abs(whole.b[0]) > error) & (abs(whole.b[3]) > error);
    unsigned roots[2];
    for (int k = 0; k < 2; ++k) {
      const Mask4 root = one_root(part[k], error);
      decided &= root | one_sign(part[k], error);
      roots[k] = bits(root);
    }
    const unsigned sure = bits(decided);
    for (int i = 0; i < width && first + i < n; ++i) {
      const std::int32_t query = queries[first + i];
      queries[found.left] = query;
      found.left += !(sure >> i & 1);
      found.clear += (sure & ~roots[0] & ~roots[1]) >> i & 1;
      for (int k = 0; k < 2; ++k) {
        Piece& piece = pieces[found.pieces];  // counted only if it has a root
        piece = {k ? at[i] : 0, k ? 1 - at[i] : at[i], {}, query};
        for (int j = 0; j < 4; ++j) piece.cubic[j] = part[k].b[j][i];
        found.pieces += (sure & roots[k]) >> i & 1;
      }
    }
  }
  return found;
}

// Pieces, one per lane.
struct Pieces {
  Double4 start, length, root, cubic[4], error, big, scale;
};
TAUGUARD_INLINE void transpose(const Group* groups, const Piece* pieces, const double* roots, int n,
                               Pieces& out) {
  alignas(64) double own[10][width];
  for (int i = 0; i < width; ++i) {
    const Piece& piece = pieces[std::min(i, n - 1)];
    const Group& g = groups[piece.query / width];
    const int lane = piece.query % width;
    own[0][i] = piece.start;
    own[1][i] = piece.length;
    for (int j = 0; j < 4; ++j) own[2 + j][i] = piece.cubic[j];
    own[6][i] = roots[std::min(i, n - 1)];
    own[7][i] = g.value[Group::error][lane];
    own[8][i] = g.value[Group::big][lane];
    own[9][i] = g.value[Group::scale][lane];
  }
  out.start = load4(own[0]);
  out.length = load4(own[1]);
  for (int j = 0; j < 4; ++j) out.cubic[j] = load4(own[2 + j]);
  out.root = load4(own[6]);
  out.error = load4(own[7]);
  out.big = load4(own[8]);
  out.scale = load4(own[9]);
}

// The value of a cubic in Bernstein form.
TAUGUARD_INLINE Double4 at(const Double4* b, Double4 x) {
  const Double4 y = 1 - x;
  return y * y * (b[0] * y + 3 * b[1] * x) + x * x * (3 * b[2] * y + b[3] * x);
}

// Finds the roots in (0, 1) of many cubics by Newton's method in a bracket. The iteration ends at a
// step below 2^-24. The error of a root is then about 2^-40; at_roots detects larger errors. Each
// lane ends its iteration by itself, so that a root does not depend on other lanes. Several groups
// are processed together to hide the latency of divisions.
constexpr int together = 4;
TAUGUARD_INLINE void find_roots(const Piece* pieces, int n, double* roots) {
  alignas(64) double value[5][together * width];
  for (int first = 0; first < n; first += together * width) {
    for (int i = 0; i < together * width; ++i)
      for (int j = 0; j < 4; ++j) value[j][i] = pieces[std::min(first + i, n - 1)].cubic[j];
    Double4 b[together][4], lo[together], hi[together], x[together];
    Mask4 done[together];
    for (int k = 0; k < together; ++k) {
      for (int j = 0; j < 4; ++j) b[k][j] = load4(value[j] + k * width);
      lo[k] = splat(0);
      hi[k] = splat(1);
      x[k] = b[k][0] / (b[k][0] - b[k][3]);
      done[k] = Mask4{};
    }
    for (int i = 0; i < 40; ++i) {
      Mask4 all = done[0] | ~done[0];
      for (int k = 0; k < together; ++k) {
        const Double4* c = b[k];
        const Double4 y = 1 - x[k], yy = y * y, xy = y * x[k], xx = x[k] * x[k];
        const Double4 f = yy * (c[0] * y + 3 * c[1] * x[k]) + xx * (3 * c[2] * y + c[3] * x[k]);
        const Mask4 before = (f > 0) == (c[0] > 0);
        lo[k] = before ? x[k] : lo[k];
        hi[k] = before ? hi[k] : x[k];
        const Double4 slope =
            3 * ((c[1] - c[0]) * yy + 2 * (c[2] - c[1]) * xy + (c[3] - c[2]) * xx);
        Double4 next = x[k] - f / slope;
        next = (next > lo[k]) & (next < hi[k]) ? next : 0.5 * (lo[k] + hi[k]);
        const Double4 step = abs(next - x[k]);
        x[k] = done[k] ? x[k] : next;
        done[k] |= step < 0x1p-24;
        all &= done[k];
      }
      if (bits(all) == (1u << width) - 1) break;
    }
    for (int k = 0; k < together; ++k) store4(value[4] + k * width, x[k]);
    for (int i = 0; i < together * width && first + i < n; ++i) roots[first + i] = value[4][i];
  }
}

// Decides whether the features touch at the root of each piece. They touch if the hull of their
// differences g_i contains the origin, that is, if the origin is on the same side of all edges:
// (g_i x g_j) . n >= 0 with n = q x r. Error bound of a side:
// * Let d = 2^-33 be the error of the time, B the largest |p|, |q|, |r|, and G the largest |g_i|
//   near the root. Then |q|, |r| <= 2 G and |n| <= 8 G^2.
// * Per unit of time g changes by at most 6 B, and q and r by 2 B. So a side changes by at most
//   (4 * 6 * 24 + 6 * 16) B G^3 = 672 B G^3 per unit of time, which is 2^-23.6 B G^3 for d.
// * Rounding adds less than 2^-38 B G^3. The bound is 2^-23 B G^3.
template <bool vf, bool packed>
TAUGUARD_INLINE void at_roots(const Ends& x, const std::int32_t* rows, const Group* groups,
                              const Piece* pieces, int n, double* toi) {
  find_roots(pieces, n, toi);
  for (int first = 0; first < n; first += width) {
    Pieces k;
    transpose(groups, pieces + first, toi + first, n - first, k);
    const Double4 t = k.start + k.length * k.root;
    const Double4 lo = max(t - 0x1p-33, k.start), hi = min(t + 0x1p-33, k.start + k.length);
    const Double4 f_lo = at(k.cubic, (lo - k.start) / k.length),
                  f_hi = at(k.cubic, (hi - k.start) / k.length);
    const Mask4 bracket =
        ((f_lo > k.error) & (f_hi < -k.error)) | ((f_lo < -k.error) & (f_hi > k.error));

    const Differences of = differences<vf, packed>(
        x, [&](int i) { return rows + 4 * pieces[std::min(first + i, n - 1)].query; });
    const auto at_root = [&](const Vec3x4* ends) {
      const Vec3x4 start = k.scale * ends[0];
      return start + t * (k.scale * ends[1] - start);
    };
    const Vec3x4 p = at_root(of.p), q = at_root(of.q), r = at_root(of.r), normal = cross(q, r);
    const Double4 a = dot(cross(p, r), normal), b = dot(cross(q, p), normal),
                  nn = dot(normal, normal);
    Double4 extent = max(max(largest(p), largest(p - q)), largest(vf ? p - r : p + r));
    Double4 least = vf ? min(min(a, b), nn - a - b) : min(min(a, nn - a), min(-b, nn + b));
    if (!vf) extent = max(extent, largest(p + r - q));
    extent += 0x1p-30 * k.big;
    const Double4 margin = 0x1p-23 * k.big * (extent * extent * extent);
    const Double4 found = least > margin ? lo : least < -margin ? splat(never) : splat(edge);
    store4(toi + first, bracket ? found : splat(unknown));
  }
}

template <bool packed>
TAUGUARD_INLINE void gather(bool vf, const Ends& x, const std::int32_t* rows, int n,
                            Group* groups) {
  vf ? gather<true, packed>(x, rows, n, groups) : gather<false, packed>(x, rows, n, groups);
}

template <bool packed>
TAUGUARD_INLINE void at_start(bool vf, const Ends& x, const std::int32_t* rows,
                              const std::int32_t* queries, int n, AtStart* found) {
  vf ? at_start<true, packed>(x, rows, queries, n, found)
     : at_start<false, packed>(x, rows, queries, n, found);
}

template <bool packed>
TAUGUARD_INLINE void at_roots(bool vf, const Ends& x, const std::int32_t* rows, const Group* groups,
                              const Piece* pieces, int n, double* toi) {
  vf ? at_roots<true, packed>(x, rows, groups, pieces, n, toi)
     : at_roots<false, packed>(x, rows, groups, pieces, n, toi);
}

#define TAUGUARD_VARIANT(name, attributes)                                                         \
  attributes void gather_##name(bool vf, const Ends& x, const std::int32_t* rows, int n,           \
                                Group* groups) {                                                   \
    x.in_lines() ? gather<true>(vf, x, rows, n, groups) : gather<false>(vf, x, rows, n, groups);   \
  }                                                                                                \
  attributes void at_start_##name(bool vf, const Ends& x, const std::int32_t* rows,                \
                                  const std::int32_t* queries, int n, AtStart* found) {            \
    x.in_lines() ? at_start<true>(vf, x, rows, queries, n, found)                                  \
                 : at_start<false>(vf, x, rows, queries, n, found);                                \
  }                                                                                                \
  attributes Cut cut_##name(const Group* groups, std::int32_t* queries, int n, Piece* pieces) {    \
    return cut(groups, queries, n, pieces);                                                        \
  }                                                                                                \
  attributes void at_roots_##name(bool vf, const Ends& x, const std::int32_t* rows,                \
                                  const Group* groups, const Piece* pieces, int n, double* toi) {  \
    x.in_lines() ? at_roots<true>(vf, x, rows, groups, pieces, n, toi)                             \
                 : at_roots<false>(vf, x, rows, groups, pieces, n, toi);                           \
  }                                                                                                \
  attributes int not_apart_##name(bool vf, const Ends& x, const std::int32_t* rows, int n,         \
                                  std::int32_t* left) {                                            \
    return vf ? not_apart<true>(x, rows, n, left) : not_apart<false>(x, rows, n, left);            \
  }                                                                                                \
  attributes int not_apart_on_seven_##name(bool vf, const float* points, const std::int32_t* rows, \
                                           int n, std::int32_t* left) {                            \
    return vf ? not_apart_on_seven<true>(points, rows, n, left)                                    \
              : not_apart_on_seven<false>(points, rows, n, left);                                  \
  }                                                                                                \
  constexpr BatchKernels name{not_apart_##name, not_apart_on_seven_##name,                         \
                              gather_##name,    at_start_##name,                                   \
                              cut_##name,       at_roots_##name};

TAUGUARD_VARIANT(portable, )
#if defined(__x86_64__)
TAUGUARD_VARIANT(avx2, TAUGUARD_AVX2)
#endif

std::atomic<const BatchKernels*> forced{nullptr};

}  // namespace

const BatchKernels* batch_kernels(const char* wanted) {
  if (std::strcmp(wanted, "portable") == 0) return &portable;
#if defined(__x86_64__)
  if (std::strcmp(wanted, "avx2") == 0 && has_avx2()) return &avx2;
#endif
  return nullptr;
}

const BatchKernels& batch_kernels() {
  static const BatchKernels* best = batch_kernels("avx2") ? batch_kernels("avx2") : &portable;
  const BatchKernels* chosen = forced.load(std::memory_order_relaxed);
  return chosen ? *chosen : *best;
}

bool force_batch_kernels(const char* name) {
  forced = batch_kernels(name);
  return forced != nullptr;
}

}  // namespace tauguard::cloth
