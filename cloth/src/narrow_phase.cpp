// Queries are solved in batches. For most queries the coplanarity cubic has no root. For the others
// the step is split into pieces with one root each, by Descartes' rule in Bernstein form (Vincent's
// theorem). At each root, earliest first, a test decides whether the features touch. It takes
// rounding and the error of the root into account. Queries that this test leaves undecided go to
// intervals.hpp, and if they remain undecided, to integer_contact.hpp and then to exact.hpp.
#include "narrow_phase.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "batch.hpp"
#include "cuts.hpp"
#include "exact.hpp"
#include "impact.hpp"
#include "integer_contact.hpp"
#include "intervals.hpp"
#include "query.hpp"
#include "sliding_contact.hpp"
#include "start_contact.hpp"
#include "tauguard/geometry/interrupt.hpp"
#include "tauguard/geometry/scratch.hpp"

namespace tauguard::cloth {
namespace {

constexpr int block = 512;  // number of queries that pass the axis filter together
constexpr int batch = 128;  // number of queries that pass the later stages together

// The same cubic in all four lanes.
Cubics cubics_of(const double* b) { return {{splat(b[0]), splat(b[1]), splat(b[2]), splat(b[3])}}; }

// Writes pieces with one root each, in order of time; together they have all roots of the cubic.
// Returns their number, or -1 if rounding prevents a decision. There are at most three cuts in a
// row, which the error bound covers.
int split(const double* b, double error, std::int32_t query, Piece* pieces) {
  struct Part {
    double start, length;
    Cubic c;
    int cuts;
  } stack[8];
  stack[0] = {0, 1, {{b[0], b[1], b[2], b[3]}}, 0};
  int count = 0;
  for (int top = 1; top > 0;) {
    const Part part = stack[--top];
    const double* c = part.c.b;
    if (one_sign(part.c, error) != 0) continue;
    if (one_root(cubics_of(c), splat(error))[0]) {
      pieces[count++] = {part.start, part.length, {c[0], c[1], c[2], c[3]}, query};
      continue;
    }
    if (part.cuts == 3 || !(std::fabs(c[0]) > error && std::fabs(c[3]) > error)) return -1;
    const double cut = cut_of(cubics_of(c))[0], middle = part.start + cut * part.length;
    Part &right = stack[top++], &left = stack[top++];
    left = {part.start, middle - part.start, {}, part.cuts + 1};
    right = {middle, part.start + part.length - middle, {}, part.cuts + 1};
    halve(part.c, cut, left.c, right.c);
  }
  return count;
}

template <bool vf>
double exactly(const Ends& x, const std::int32_t* row, Stats& stats) {
  geometry::poll_interrupt();
  ++stats.exact;
  const double t = integer_contact(vf, x, row);
  if (!std::isnan(t)) return t;
  ++stats.long_exact;
  return exact_contact(vf, x, row);
}

// Solves one query that the batch left undecided: by intervals and, if they fail, exactly.
template <bool vf>
double resolve(const Ends& x, const std::int32_t* row, double distance, Stats& stats) {
  ++stats.resolved;
  const double t = first_contact(make<vf>(x, row, distance), vf, stats);
  return std::isnan(t) ? exactly<vf>(x, row, stats) : t;
}

// Working memory of a batch.
struct Batch {
  Group groups[batch / width];
  Piece pieces[3 * batch];
  double at[3 * batch];
  std::int32_t open[batch];
  AtStart start[batch];     // of the open queries
  int count = 0, left = 0;  // number of pieces; number of undecided queries
};

// Writes the pieces of all queries that may have contact, sorted by time within a query.
void make_pieces(Batch& b, int n, Stats& stats) {
  std::int32_t single[batch], several[batch];
  int singles = 0, count = 0;
  for (int i = 0; i < n; ++i) {  // no branches, which would be mispredicted
    const std::int64_t flags = b.groups[i / width].flags[i % width];
    const bool none = flags & Group::no_root, one = flags & Group::one_root,
               open = flags & Group::open;
    single[singles] = several[count] = b.open[b.left] = i;
    singles += one;
    count += !(none | one | open);
    b.left += open & !(none | one);
    stats.cubic_sign += none;
  }
  for (int i = 0; i < singles; ++i) {
    const Group& group = b.groups[single[i] / width];
    Piece& piece = b.pieces[b.count++];
    piece.start = 0;
    piece.length = 1;
    for (int j = 0; j < 4; ++j) piece.cubic[j] = group.value[Group::cubic + j][single[i] % width];
    piece.query = single[i];
  }
  const Cut cut = batch_kernels().cut(b.groups, several, count, b.pieces + b.count);
  b.count += cut.pieces;
  stats.cubic_sign += cut.clear;
  for (int i = 0; i < cut.left; ++i) {
    const Group& group = b.groups[several[i] / width];
    const int lane = several[i] % width;
    double c[4];
    for (int j = 0; j < 4; ++j) c[j] = group.value[Group::cubic + j][lane];
    const int found = split(c, group.value[Group::error][lane], several[i], b.pieces + b.count);
    if (found < 0) b.open[b.left++] = several[i];
    if (found == 0) ++stats.cubic_sign;
    b.count += std::max(found, 0);
  }
}

// Whether the cubic may be zero at the start, given its rounding error.
bool may_touch_at_start(const Batch& b, std::int32_t query) {
  const Group& group = b.groups[query / width];
  const int lane = query % width;
  return (group.flags[lane] & Group::odd) ||
         !(std::fabs(group.value[Group::cubic][lane]) > group.value[Group::error][lane]);
}

// Time of contact of a query whose features are apart at the start. If the cubic is zero at the
// start, it may be zero throughout the step. Features that slide on a common plane perpendicular to
// an axis are then solved in two dimensions.
template <bool vf>
double later(const Batch& b, std::int32_t query, const Ends& x, const std::int32_t* row,
             Stats& stats) {
  if (may_touch_at_start(b, query)) {
    const double t = sliding_contact(vf, x, row);
    stats.sliding += !std::isnan(t);
    if (!std::isnan(t)) return t;
  }
  return resolve<vf>(x, row, 0, stats);
}

// Solves one batch: writes the time of contact of each query, or `never`.
template <bool vf>
void ab2pf(const Ends& x, const std::int32_t* rows, int n, double* toi, Stats& stats) {
  geometry::Scratch<Batch> scratch;
  Batch& b = *scratch;
  const BatchKernels& kernels = batch_kernels();
  b.count = b.left = 0;
  kernels.gather(vf, x, rows, n, b.groups);
  std::fill(toi, toi + n, never);
  make_pieces(b, n, stats);
  kernels.at_roots(vf, x, rows, b.groups, b.pieces, b.count, b.at);
  // The first piece of a query that is not clear decides. Few branches: they would be mispredicted.
  for (int i = b.count - 1; i >= 0; --i) {
    double& time = toi[b.pieces[i].query];
    time = b.at[i] == never ? time : b.at[i];
  }
  for (int i = 0; i < b.count; ++i) {
    const std::int32_t query = b.pieces[i].query;
    const bool first = i == 0 || b.pieces[i - 1].query != query;
    stats.roots += first & (toi[query] == never);
    if (toi[query] >= 0) continue;
    if (first && toi[query] == unknown) b.open[b.left++] = query;
    if (toi[query] == edge) toi[query] = exactly<vf>(x, rows + 4 * query, stats);
  }
  kernels.at_start(vf, x, rows, b.open, b.left, b.start);
  for (int i = 0; i < b.left; ++i) {
    const std::int32_t query = b.open[i], *row = rows + 4 * query;
    if (b.start[i] == AtStart::unknown && may_touch_at_start(b, query))
      b.start[i] = at_start(vf, x, row);
    const bool touching = b.start[i] == AtStart::touching;
    stats.at_start += touching;
    toi[query] = touching ? 0 : later<vf>(b, query, x, row, stats);
  }
}

// Solves a block: applies the axis filter, and solves the remaining queries in batches.
template <bool vf>
void in_batches(const Ends& x, const std::int32_t* rows, int n, AxisFilter axes, double* toi,
                Stats& stats) {
  if (!axes.look) {
    for (int first = 0; first < n; first += batch)
      ab2pf<vf>(x, rows + 4 * first, std::min(batch, n - first), toi + first, stats);
    return;
  }
  std::int32_t left[block], part[4 * batch];
  double found[batch];
  const int count = axes.points
                        ? batch_kernels().not_apart_on_seven(vf, axes.points->of(0), rows, n, left)
                        : batch_kernels().not_apart(vf, x, rows, n, left);
  stats.axes += n - count;
  std::fill(toi, toi + n, never);
  for (int first = 0; first < count; first += batch) {
    const int some = std::min(batch, count - first);
    for (int i = 0; i < some; ++i) std::copy_n(rows + 4 * left[first + i], 4, part + 4 * i);
    ab2pf<vf>(x, part, some, found, stats);
    for (int i = 0; i < some; ++i) toi[left[first + i]] = found[i];
  }
}

template <bool vf>
void one_by_one(const Ends& x, const std::int32_t* rows, int n, Method method, double distance,
                double* toi, Stats& stats) {
  for (int i = 0; i < n; ++i) {
    geometry::poll_interrupt();
    const std::int32_t* row = rows + 4 * i;
    if (method == Method::ab2pf) {
      toi[i] = resolve<vf>(x, row, distance, stats);
    } else {
      ++stats.exact;
      ++stats.long_exact;
      toi[i] = exact_contact(vf, x, row);
    }
  }
}

template <bool vf>
void solve(const Ends& x, const std::int32_t* rows, std::size_t n, Method method, double distance,
           std::uint8_t* hit, ImpactArrays out, Stats& stats, AxisFilter axes) {
  double toi[block];
  for (std::size_t first = 0; first < n; first += block) {
    geometry::poll_interrupt();
    const int count = static_cast<int>(std::min<std::size_t>(block, n - first));
    const std::int32_t* part = rows + 4 * first;
    if (method == Method::ab2pf && distance == 0) {
      in_batches<vf>(x, part, count, axes, toi, stats);
    } else {
      one_by_one<vf>(x, part, count, method, distance, toi, stats);
    }
    for (int i = 0; i < count; ++i) hit[first + i] = toi[i] <= 1;
    if (!out.point) std::copy_n(toi, count, out.toi + first);
    for (int i = 0; out.point && i < count; ++i) {
      if (!hit[first + i]) continue;
      out.toi[first + i] = toi[i];
      describe<vf>(x, part + 4 * i, toi[i], distance, out, first + i);
    }
  }
}
}  // namespace

void solve_vf(const Ends& x, const std::int32_t* rows, std::size_t n, Method method,
              double min_distance, std::uint8_t* hit, ImpactArrays impacts, Stats& stats,
              AxisFilter axes) {
  solve<true>(x, rows, n, method, min_distance, hit, impacts, stats, axes);
}
void solve_ee(const Ends& x, const std::int32_t* rows, std::size_t n, Method method,
              double min_distance, std::uint8_t* hit, ImpactArrays impacts, Stats& stats,
              AxisFilter axes) {
  solve<false>(x, rows, n, method, min_distance, hit, impacts, stats, axes);
}
}  // namespace tauguard::cloth
