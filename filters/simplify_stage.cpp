#include "filters/simplify_stage.h"

#include <tbb/info.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "filters/collapse_error.h"

namespace isobrick::inline v0 {
namespace {

/// Triangles of a group: more leave less to the later passes, fewer take less memory.
constexpr std::uint64_t kGroupTriangles = 100000;
/// What a group takes that is simplified, and how many are at the same time however small the
/// memory is.
constexpr std::uint64_t kGroupBytes = kGroupTriangles * 300;
constexpr std::uint64_t kLeastAtOnce = 4;
/// Where boxes are divided in each pass: no border of a pass is one of another.
constexpr std::array<double, 3> kSplits{0.5, 0.37, 0.63};
/// Of the way to the goal, on a logarithmic scale, where each pass ends. Were the first to go all
/// the way, the borders of its groups would have the triangles that their insides lack.
constexpr std::array<double, 3> kGoals{0.4, 0.75, 1};
/// Of the permitted error, the part of each pass: errors add up.
constexpr std::array<double, 3> kErrorShares{0.5, 0.25, 0.25};
/// A group is collapsed until it has so many times fewer triangles than its part of the goal: flat
/// ones give more.
constexpr double kReserve = 3;
constexpr double kAnyDistance = std::numeric_limits<double>::infinity();

std::uint64_t rounded(double count) { return static_cast<std::uint64_t>(std::llround(count)); }

/// Groups at the same time, for which half of the memory is.
std::size_t groups_at_once(int threads, std::uint64_t memory) {
  const std::uint64_t most = std::max(kLeastAtOnce, memory / 2 / kGroupBytes);
  return static_cast<std::size_t>(
      std::clamp<std::uint64_t>(static_cast<std::uint64_t>(threads), kLeastAtOnce, most));
}

template <class T>
std::size_t place_in(const std::vector<T>& items, const T& item) {
  return static_cast<std::size_t>(&item - items.data());
}

int threads_of(const Simplification& simplification) {
  const int most = tbb::info::default_concurrency();
  return simplification.threads > 0 ? std::min(simplification.threads, most) : most;
}

}  // namespace

template <class Number>
SimplifyStage<Number>::SimplifyStage(MeshSink& next, std::stop_token cancel,
                                     const ScratchPlace& place, std::uint64_t memory,
                                     const Simplification& simplification,
                                     std::uint64_t max_narrow_vertices)
    : FilterStage(next, std::move(cancel)),
      simplification_(simplification),
      max_narrow_vertices_(max_narrow_vertices),
      arena_(threads_of(simplification)),
      at_once_(groups_at_once(threads_of(simplification), memory)),
      place_(place),
      sorted_memory_(memory / 8),
      mesh_(place, memory / 4),
      collapses_(place, memory / 32),
      numbers_(place, memory / 32) {
  constexpr double far = std::numeric_limits<double>::infinity();
  bounds_ = {{far, far, far}, {-far, -far, -far}};
}

template <class Number>
std::uint64_t SimplifyStage<Number>::own_memory() const {
  return mesh_.memory() + sorted_memory_ + collapses_.memory() + numbers_.memory() +
         at_once_ * kGroupBytes;
}

template <class Number>
void SimplifyStage<Number>::begin(const MeshHeader& header) {
  mesh_.begin(header);
  header_ = header;
  if constexpr (!kIsWide<Number>) next().begin(header);
}

template <class Number>
void SimplifyStage<Number>::write(const MeshChunk& chunk) {
  check_cancelled();
  mesh_.append(chunk);
  for (const Vec3f& p : chunk.positions)
    for (int axis = 0; axis < 3; ++axis) {
      bounds_.lo[axis] = std::min<double>(bounds_.lo[axis], p[axis]);
      bounds_.hi[axis] = std::max<double>(bounds_.hi[axis], p[axis]);
    }
}

template <class Number>
std::optional<std::uint64_t> SimplifyStage<Number>::find_goal() const {
  if (simplification_.triangles > 0) return simplification_.triangles;
  if (simplification_.ratio >= 1 && simplification_.max_error > 0) return std::nullopt;
  return rounded(simplification_.ratio * static_cast<double>(mesh_.size().triangles));
}

/// Calls f(group) for each group.
template <class Number>
template <class F>
void SimplifyStage<Number>::in_parallel(std::vector<Group>& groups, F&& f) {
  arena_.execute([&] {
    tbb::parallel_for(std::size_t{0}, groups.size(), [&](std::size_t i) { f(groups[i]); });
  });
}

/// Calls f(first, groups) for runs of groups in order, which have no positions yet: the number of
/// the first one and all of them.
template <class Number>
template <class F>
void SimplifyStage<Number>::for_each_run(TriangleGroups<Number>& groups, F&& f) {
  for (std::size_t first = 0; first < groups.count(); first += at_once_) {
    check_cancelled();
    const std::size_t count = std::min(at_once_, groups.count() - first);
    std::vector<std::vector<TriangleOf<Number>>> triangles(count);
    std::uint64_t loaded_triangles = 0;
    for (std::size_t i = 0; i < count; ++i) {
      triangles[i] = groups.load(first + i);
      loaded_triangles += triangles[i].size();
    }
    std::vector<Group> loaded(count);
    in_parallel(loaded, [&](Group& group) {
      group = group_of<Number>(std::exchange(triangles[place_in(loaded, group)], {}));
    });
    f(first, loaded);
    progress().advance(loaded_triangles * sizeof(Triangle));
  }
}

template <class Number>
void SimplifyStage<Number>::load_positions(Group& group) {
  for (const Number v : group.numbers) group.positions.push_back(mesh_.positions()[v]);
}

/// Finds the collapses of all groups, more than there should be.
template <class Number>
void SimplifyStage<Number>::find_collapses(TriangleGroups<Number>& groups, double part,
                                           double max_distance) {
  collapses_.clear();
  for_each_run(groups, [&](std::size_t, std::vector<Group>& loaded) {
    for (Group& group : loaded) load_positions(group);
    std::vector<std::vector<Collapse>> found(loaded.size());
    in_parallel(loaded, [&](const Group& group) {
      const double least = part / kReserve * static_cast<double>(group.triangles.size());
      found[place_in(loaded, group)] =
          EdgeCollapse(group, max_distance).run(static_cast<std::size_t>(least));
    });
    for (const std::vector<Collapse>& collapses : found) collapses_.add(collapses);
  });
}

/// Does the collapses of the smallest errors.
template <class Number>
void SimplifyStage<Number>::collapse(TriangleGroups<Number>& groups, std::uint64_t all,
                                     std::uint64_t wanted) {
  collapses_.select((all - wanted + 1) / 2);  // each takes two triangles away
  double largest = 0;
  for_each_run(groups, [&](std::size_t first, std::vector<Group>& loaded) {
    std::vector<std::vector<Collapse>> collapses(loaded.size());
    for (std::size_t i = 0; i < loaded.size(); ++i) {
      collapses[i] = collapses_.load(first + i);
      if (simplification_.measures_error) load_positions(loaded[i]);
    }
    std::vector<std::vector<Triangle>> left(loaded.size());
    std::vector<double> errors(loaded.size());
    in_parallel(loaded, [&](const Group& group) {
      const auto i = place_in(loaded, group);
      const std::vector<std::uint32_t> last = final_vertices(group, collapses[i]);
      left[i] = collapsed(group, last);
      if (simplification_.measures_error) errors[i] = collapse_error(group, last, left[i]);
    });
    for (std::size_t i = 0; i < loaded.size(); ++i) {
      largest = std::max(largest, errors[i]);
      for (const Triangle& t : left[i])
        mesh_.triangles().push_back(
            {loaded[i].numbers[t[0]], loaded[i].numbers[t[1]], loaded[i].numbers[t[2]]});
    }
  });
  error_ += largest;  // passes add up
}

template <class Number>
void SimplifyStage<Number>::simplify_all() {
  const std::uint64_t goal = goal_.value_or(0);
  const auto first = static_cast<double>(mesh_.triangles().size());
  const double ratio = static_cast<double>(goal) / first;
  const bool has_limit = simplification_.max_error > 0;
  for (std::size_t pass = 0; pass < kSplits.size(); ++pass) {
    const std::uint64_t all = mesh_.triangles().size();
    if (all <= goal) break;
    TriangleGroups<Number> groups(place_, sorted_memory_, kSplits[pass]);
    groups.sort(mesh_.positions(), bounds_, mesh_.triangles(), kGroupTriangles,
                [this] { check_cancelled(); });
    // One group has no borders that another pass could simplify.
    const bool is_last = groups.count() == 1 || pass + 1 == kSplits.size();
    const std::uint64_t wanted =
        is_last || goal == 0 ? goal : std::min(all, rounded(first * std::pow(ratio, kGoals[pass])));
    const double share = is_last && pass == 0 ? 1 : kErrorShares[pass];
    progress().begin("simplifying", 2 * all * sizeof(Triangle));
    find_collapses(groups, static_cast<double>(wanted) / static_cast<double>(all),
                   has_limit ? share * simplification_.max_error : kAnyDistance);
    collapse(groups, all, wanted);
    sorted_bytes_ = std::max(sorted_bytes_, groups.file_bytes() + collapses_.file_bytes());
    progress().end();
    if (is_last) break;
  }
}

/// With numbers of 64 bits it is not known before how many vertices are left.
template <class Number>
void SimplifyStage<Number>::begin_next(std::uint64_t vertices) {
  if constexpr (!kIsWide<Number>) return;
  header_.wide = vertices > max_narrow_vertices_;
  check_takes(next(), header_.wide, vertices);
  next().begin(header_);
}

/// Numbers the vertices that triangles name; how many there are.
template <class Number>
std::uint64_t SimplifyStage<Number>::number_kept() {
  numbers_.resize(mesh_.positions().size());
  mesh_.triangles().for_each_run([&](std::span<const TriangleOf<Number>> run, std::uint64_t) {
    check_cancelled();
    for (const auto& t : run)
      for (const Number v : t) numbers_.edit(v) = 1;
  });
  Number kept = 0;
  numbers_.edit_runs([&](std::span<Number> run, std::uint64_t) {
    check_cancelled();
    for (Number& number : run)
      if (number != 0) number = ++kept;
  });
  return kept;
}

template <class Number>
void SimplifyStage<Number>::write_kept() {
  const std::uint64_t kept = number_kept();
  begin_next(kept);
  std::vector<Vec3f> positions, normals;
  std::uint64_t before = 0;
  mesh_.positions().for_each_run([&](std::span<const Vec3f> run, std::uint64_t first) {
    check_cancelled();
    positions.clear();
    normals.clear();
    for (std::size_t i = 0; i < run.size(); ++i) {
      if (numbers_[first + i] == 0) continue;
      positions.push_back(run[i]);
      if (mesh_.has_normals()) normals.push_back(mesh_.normals()[first + i]);
    }
    if (!positions.empty())
      next().write({.first_vertex = before, .positions = positions, .normals = normals});
    before += positions.size();
  });
  std::vector<TriangleOf<Number>> triangles;
  mesh_.triangles().for_each_run([&](std::span<const TriangleOf<Number>> run, std::uint64_t) {
    check_cancelled();
    triangles.clear();
    for (const auto& t : run)
      triangles.push_back({numbers_[t[0]] - 1, numbers_[t[1]] - 1, numbers_[t[2]] - 1});
    write_triangles<Number>(next(), header_.wide, kept, triangles);
  });
}

template <class Number>
void SimplifyStage<Number>::finish() {
  goal_ = find_goal();
  if (goal_.value_or(0) < mesh_.size().triangles) {
    simplify_all();
    write_kept();
    mesh_.release();
    numbers_.release();
    collapses_.release();
  } else {
    begin_next(mesh_.size().vertices);
    mesh_.replay_and_release(next(), header_.wide);
  }
  next().finish();
}

template class SimplifyStage<std::uint32_t>;
template class SimplifyStage<std::uint64_t>;

}  // namespace isobrick
