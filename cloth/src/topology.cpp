#include "topology.hpp"

#include <algorithm>
#include <array>
#include <numeric>

#include "vertex_table.hpp"

namespace tauguard::cloth {
namespace {

int compare(const Features& a, std::int32_t i, const Features& b, std::int32_t j) {
  const std::int32_t *x = a.of(i), *y = b.of(j);
  for (int k = 0; k < a.arity; ++k)
    if (x[k] != y[k]) return x[k] < y[k] ? -1 : 1;
  return 0;
}

// Matches equal rows of two lists, each given by a sorted order.
void merge(const Features& before, const std::vector<std::int32_t>& old_order,
           const Features& after, const std::vector<std::int32_t>& new_order,
           std::vector<std::int32_t>& match) {
  std::size_t i = 0, j = 0;
  while (i < old_order.size() && j < new_order.size()) {
    const int order = compare(before, old_order[i], after, new_order[j]);
    if (order == 0) match[old_order[i]] = new_order[j];
    i += order <= 0;
    j += order >= 0;
  }
}

}  // namespace

void Topology::set(std::vector<std::int32_t> face_vertices) {
  faces.vertices = std::move(face_vertices);
  vertices.vertices = used_vertices(faces.vertices);
  const VertexTable numbers(vertices.vertices);
  const std::size_t count = vertices.size();
  std::vector<std::int32_t> f(
      faces.vertices.size());  // indexed by position among the vertices in use
  std::transform(faces.vertices.begin(), faces.vertices.end(), f.begin(),
                 [&](std::int32_t v) { return numbers.place(v); });
  triangles = 0;
  while (3 * triangles < f.size() && f[3 * triangles + 1] != f[3 * triangles + 2]) ++triangles;
  // Sort edges into buckets by the smaller vertex, then each bucket by the larger vertex.
  std::vector<std::size_t> begin(count + 1, 0);
  const auto each_edge = [&](auto&& visit) {
    for (std::size_t i = 0; i < f.size(); i += 3)
      for (int k = 0; k < 3; ++k)
        if (f[i + k] != f[i + (k + 1) % 3]) visit(std::minmax(f[i + k], f[i + (k + 1) % 3]));
  };
  each_edge([&](auto e) { ++begin[e.first + 1]; });
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<std::int32_t> larger(f.size());
  auto next = begin;
  each_edge([&](auto e) { larger[next[e.first]++] = e.second; });

  edges.vertices.clear();
  edges.vertices.reserve(f.size() + 6);
  for (std::size_t v = 0; v < count; ++v) {
    const auto first = larger.begin() + begin[v], last = larger.begin() + begin[v + 1];
    std::sort(first, last);
    const auto end = std::unique(first, last);
    for (auto e = first; e != end; ++e) {
      edges.vertices.push_back(vertices.vertices[v]);
      edges.vertices.push_back(vertices.vertices[*e]);
    }
  }
}

std::vector<std::uint8_t> isolated_vertices(const Topology& topology, std::size_t n) {
  if (topology.triangles == topology.faces.size()) return {};
  std::vector<std::uint8_t> isolated(n, 0);
  for (std::size_t i = topology.triangles; i < topology.faces.size(); ++i) {
    const std::int32_t* row = topology.faces.of(i);
    isolated[row[0]] = row[0] == row[1];
  }
  for (const auto v : topology.edges.vertices) isolated[v] = 0;
  return isolated;
}

std::vector<std::int32_t> match_sorted(const Features& before, const Features& after) {
  std::vector<std::int32_t> match(before.size(), -1), old_order(before.size()),
      new_order(after.size());
  std::iota(old_order.begin(), old_order.end(), 0);
  std::iota(new_order.begin(), new_order.end(), 0);
  merge(before, old_order, after, new_order, match);
  return match;
}

std::vector<std::int32_t> match_faces(const Features& before, const Features& after) {
  std::vector<std::int32_t> match(before.size(), -1), old_order, new_order;
  // Most new rows are old rows, shifted by removed ones. These are matched without sorting.
  std::size_t i = 0, j = 0;
  while (i < before.size() && j < after.size()) {
    if (compare(before, i, after, j) == 0) {
      match[i++] = static_cast<std::int32_t>(j++);
      continue;
    }
    std::size_t skip = i + 1;
    const std::size_t far = std::min(before.size(), i + 64);
    while (skip < far && compare(before, skip, after, j) != 0) ++skip;
    if (skip < far) {
      while (i < skip) old_order.push_back(static_cast<std::int32_t>(i++));
    } else {
      old_order.push_back(static_cast<std::int32_t>(i++));
      new_order.push_back(static_cast<std::int32_t>(j++));
    }
  }
  for (; i < before.size(); ++i) old_order.push_back(static_cast<std::int32_t>(i));
  for (; j < after.size(); ++j) new_order.push_back(static_cast<std::int32_t>(j));
  const auto sort = [](std::vector<std::int32_t>& order, const Features& of) {
    std::sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
      const int c = compare(of, a, of, b);
      return c != 0 ? c < 0 : a < b;
    });
  };
  sort(old_order, before);
  sort(new_order, after);
  merge(before, old_order, after, new_order, match);
  return match;
}

}  // namespace tauguard::cloth
