#include "filters/edge_collapse.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <utility>

#include "core/vectors.h"

namespace isobrick::inline v0 {
namespace {

/// Of the squared length of an edge: where all is flat, short edges collapse first.
constexpr double kLengthWeight = 1e-8;
/// The cosine of the largest angle by which a triangle may turn in one collapse.
constexpr double kMinCosine = 0.2;

double square(Vec3d v) { return dot(v, v); }

}  // namespace

EdgeCollapse::EdgeCollapse(const TriangleGroup& group, double max_distance)
    : vertices_(group.positions.size()), triangles_(group.triangles.size()) {
  for (std::size_t v = 0; v < vertices_.size(); ++v)
    vertices_[v].position = to_double(group.positions[v]) - to_double(group.positions.front());
  find_fans(group.triangles);
  sum_planes(group.triangles);
  if (!std::isfinite(max_distance)) return;
  removed_.emplace(group.triangles.size(), max_distance);
  for (std::uint32_t i = 0; i < group.triangles.size(); ++i) {
    const Triangle& t = group.triangles[i];
    removed_->add((vertices_[t[0]].position + vertices_[t[1]].position + vertices_[t[2]].position) *
                      (1.0 / 3),
                  i);
  }
}

void EdgeCollapse::find_fans(const std::vector<Triangle>& triangles) {
  for (const Triangle& t : triangles)
    for (const std::uint32_t v : t) ++vertices_[v].count;
  std::size_t begin = 0;
  for (Vertex& v : vertices_) {
    v.begin = begin;
    begin += std::exchange(v.count, 0);
  }
  corners_.reserve(6 * triangles.size());
  corners_.resize(3 * triangles.size());
  for (std::uint32_t i = 0; i < triangles.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = triangles[i][k];
      corners_[vertices_[v].begin + vertices_[v].count++] = {i, triangles[i][(k + 1) % 3],
                                                             triangles[i][(k + 2) % 3]};
    }
  for (std::uint32_t v = 0; v < vertices_.size(); ++v) vertices_[v].is_border = !is_closed_fan(v);
}

bool EdgeCollapse::is_closed_fan(std::uint32_t vertex) const {
  const std::span<const Corners> fan = around(vertex);
  if (fan.size() < 3) return false;
  std::uint32_t at = fan.front().next;
  for (std::size_t step = 0; step < fan.size(); ++step) {
    const auto following = std::ranges::find(fan, at, &Corners::next);
    if (following == fan.end()) return false;
    at = following->last;
    if (at == fan.front().next) return step + 1 == fan.size();
  }
  return false;
}

void EdgeCollapse::sum_planes(const std::vector<Triangle>& triangles) {
  const auto normal_of = [&](const Triangle& t) {
    return cross(vertices_[t[1]].position - vertices_[t[0]].position,
                 vertices_[t[2]].position - vertices_[t[0]].position);
  };
  double sum = 0;
  for (const Triangle& t : triangles) sum += length(normal_of(t));
  const double mean = sum / static_cast<double>(triangles.size());
  for (const Triangle& t : triangles) {
    const Vec3d normal = normal_of(t);
    const double area = length(normal);
    if (!(area > 0)) continue;
    const Quadric plane = Quadric::of_plane(normal * (1 / area), vertices_[t[0]].position,
                                            std::min(1.0, area / mean));
    for (const std::uint32_t v : t) vertices_[v].quadric += plane;
  }
}

float EdgeCollapse::cost(std::uint32_t from, std::uint32_t to) const {
  const Vec3d p = vertices_[to].position;
  const double planes = std::max(0.0, vertices_[from].quadric.at(p) + vertices_[to].quadric.at(p));
  const double sum = planes + kLengthWeight * square(p - vertices_[from].position);
  return sum < std::numeric_limits<float>::max() ? static_cast<float>(sum) : kNowhere.cost;
}

void EdgeCollapse::push(std::uint32_t from, Target target) {
  vertices_[from].best = target;
  heap_.push_back({target.cost, from, ++vertices_[from].version});
  std::ranges::push_heap(heap_, std::greater<>());
}

void EdgeCollapse::push(std::uint32_t from) {
  Target least = kNowhere;
  for (const Corners& c : around(from))
    least = std::min(least, Target{cost(from, c.next), c.next}, std::less<>());
  push(from, least);
}

/// After a neighbour is gone and gave its triangles to another one.
void EdgeCollapse::update(std::uint32_t from, std::uint32_t gone, std::uint32_t changed) {
  if (vertices_[from].is_border) return;
  const Target best = vertices_[from].best;
  if (best.to == gone || best.to == changed || best.to == kNowhere.to) return push(from);
  if (const Target target{cost(from, changed), changed}; target < best) push(from, target);
}

std::optional<EdgeCollapse::Target> EdgeCollapse::find_target(std::uint32_t from) {
  targets_.clear();
  for (const Corners& c : around(from)) targets_.push_back({cost(from, c.next), c.next});
  std::ranges::sort(targets_, std::less<>());
  for (const Target& target : targets_)
    if (may_collapse(from, target.to)) return target;
  return std::nullopt;
}

bool EdgeCollapse::may_collapse(std::uint32_t from, std::uint32_t to) {
  return keeps_topology(from, to) && !turns_over(from, to) && keeps_distance(from, to);
}

bool EdgeCollapse::keeps_topology(std::uint32_t from, std::uint32_t to) {
  const std::uint32_t of_from = ++last_mark_, of_both = ++last_mark_;
  bool is_inside = false;
  for (const Corners& c : around(from)) {
    vertices_[c.next].mark = of_from;
    is_inside |= !vertices_[c.next].is_border;
  }
  std::array<std::uint32_t, 2> both{};
  std::size_t count = 0;
  for (const Corners& c : around(to))
    for (const std::uint32_t v : {c.next, c.last}) {
      if (vertices_[v].mark != of_from) continue;
      if (count == both.size()) return false;
      vertices_[v].mark = of_both;
      both[count++] = v;
    }
  if (count != both.size()) return false;
  // Neither a tetrahedron of this group nor one that other groups complete.
  const auto has_both = [&](const Corners& c) { return c.has(both[0]) && c.has(both[1]); };
  if (around(from).size() == 3 && (!is_inside || std::ranges::any_of(around(to), has_both)))
    return false;
  if (!vertices_[to].is_border) return true;
  return std::ranges::none_of(around(from), [&](const Corners& c) {
    return c.next != to && vertices_[c.next].mark == of_from && vertices_[c.next].is_border;
  });
}

bool EdgeCollapse::turns_over(std::uint32_t from, std::uint32_t to) const {
  const Vec3d a = vertices_[from].position, b = vertices_[to].position;
  Vec3d sum;
  bool has_opened = false;
  const auto normal = [&](Vec3d p, const Corners& c) {
    return cross(vertices_[c.next].position - p, vertices_[c.last].position - p);
  };
  for (const Corners& c : around(from)) {
    const Vec3d before = normal(a, c);
    sum = sum + before;
    if (c.has(to)) continue;
    const Vec3d after = normal(b, c);
    if (square(before) == 0) {
      has_opened |= square(after) > 0;
      continue;
    }
    const double product = dot(before, after);
    if (!(product > 0 &&
          product * product > kMinCosine * kMinCosine * square(before) * square(after)))
      return true;
  }
  if (!has_opened) return false;
  // A triangle without an area gets one: as the others around the vertex have it.
  return std::ranges::any_of(around(from), [&](const Corners& c) {
    return !c.has(to) && square(normal(a, c)) == 0 && dot(sum, normal(b, c)) < 0;
  });
}

bool EdgeCollapse::keeps_distance(std::uint32_t from, std::uint32_t to) {
  if (!removed_) return true;
  patches_.clear();
  gone_.clear();
  for (const Corners& c : around(from)) {
    if (c.has(to))
      gone_.push_back(c.triangle);
    else
      patches_.push_back({c.triangle, vertices_[to].position, vertices_[c.next].position,
                          vertices_[c.last].position});
  }
  return removed_->permits(vertices_[from].position, patches_, gone_);
}

void EdgeCollapse::give_triangles(std::uint32_t from, std::uint32_t to) {
  const std::size_t begin = corners_.size();
  for (const std::uint32_t v : {to, from})
    for (std::size_t i = vertices_[v].begin; i < vertices_[v].begin + vertices_[v].count; ++i) {
      const Corners c = corners_[i];
      if (!c.has(v == to ? from : to)) corners_.push_back(c);
    }
  vertices_[to].begin = begin;
  vertices_[to].count = static_cast<std::uint32_t>(corners_.size() - begin);
  vertices_[from].count = 0;
}

void EdgeCollapse::collapse(std::uint32_t from, std::uint32_t to) {
  if (removed_) removed_->move(vertices_[from].position, patches_, gone_);
  for (const Corners& fan : around(from)) {
    const std::uint32_t v = fan.next;
    if (v == to) continue;
    Corners* const first = corners_.data() + vertices_[v].begin;
    Corners* end = first + vertices_[v].count;
    end = std::remove_if(first, end, [&](const Corners& c) { return c.has(from) && c.has(to); });
    vertices_[v].count = static_cast<std::uint32_t>(end - first);
    for (Corners* c = first; c != end; ++c) {
      if (c->next == from) c->next = to;
      if (c->last == from) c->last = to;
    }
  }
  give_triangles(from, to);
  vertices_[to].quadric += vertices_[from].quadric;
  triangles_ -= 2;
  ++vertices_[from].version;
}

std::vector<Collapse> EdgeCollapse::run(std::size_t least) {
  for (std::uint32_t v = 0; v < vertices_.size(); ++v)
    if (!vertices_[v].is_border) push(v);
  std::vector<Collapse> collapses;
  float largest = 0;
  while (triangles_ > least && !heap_.empty()) {
    std::ranges::pop_heap(heap_, std::greater<>());
    const Candidate candidate = heap_.back();
    heap_.pop_back();
    const std::uint32_t from = candidate.from;
    if (candidate.version != vertices_[from].version) continue;
    const std::optional<Target> target = find_target(from);
    if (!target) {
      vertices_[from].best = kNowhere;  // until something changes around it
      continue;
    }
    const std::uint32_t to = target->to;
    if (target->cost > candidate.cost) {
      push(from, *target);
      continue;
    }
    collapse(from, to);
    largest = std::max(largest, target->cost);
    collapses.push_back({from, to, std::sqrt(largest)});
    if (!vertices_[to].is_border) push(to);
    for (const Corners& c : around(to)) {
      update(c.next, from, to);
      if (vertices_[to].is_border) update(c.last, from, to);
    }
  }
  return collapses;
}

std::vector<std::uint32_t> final_vertices(const TriangleGroup& group,
                                          std::span<const Collapse> collapses) {
  std::vector<std::uint32_t> last(group.vertices);
  for (std::uint32_t v = 0; v < last.size(); ++v) last[v] = v;
  // Where a vertex goes later, those that went to it before go too.
  for (std::size_t i = collapses.size(); i-- > 0;) last[collapses[i].from] = last[collapses[i].to];
  return last;
}

std::vector<Triangle> collapsed(const TriangleGroup& group,
                                std::span<const std::uint32_t> final_vertices) {
  std::vector<Triangle> triangles;
  for (const Triangle& t : group.triangles) {
    const Triangle left{final_vertices[t[0]], final_vertices[t[1]], final_vertices[t[2]]};
    if (left[0] != left[1] && left[1] != left[2] && left[2] != left[0]) triangles.push_back(left);
  }
  return triangles;
}

}  // namespace isobrick
