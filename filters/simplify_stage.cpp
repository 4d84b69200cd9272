#include "filters/simplify_stage.h"

#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "core/vectors.h"

namespace isobrick::inline v0 {
namespace {

/// Triangles of a group: more leave less to the later passes, fewer take less memory.
constexpr std::uint64_t kGroupTriangles = 100000;
/// Groups that are simplified at the same time, and what each takes.
constexpr std::size_t kGroupsAtOnce = 4;
constexpr std::uint64_t kGroupBytes = kGroupTriangles * 200;
/// Where boxes are divided in each pass: no border of a pass is one of another.
constexpr std::array<double, 3> kSplits{0.5, 0.37, 0.63};
/// Of the way to the goal, on a logarithmic scale, where each pass ends. Were the first to go all
/// the way, the borders of its groups would have the triangles that their insides lack.
constexpr std::array<double, 3> kGoals{0.4, 0.75, 1};
/// Of the permitted error, the part of each pass: errors add up.
constexpr std::array<double, 3> kErrorShares{0.5, 0.25, 0.25};
constexpr double kAnyDistance = std::numeric_limits<double>::infinity();

/// How a group's error grows while its triangles become fewer.
struct ErrorCurve {
  struct Point {
    double error, triangles;
  };
  std::vector<Point> points;  ///< errors ascend, triangles descend

  /// Triangles that are left at an error.
  double at(double error) const {
    if (error >= points.back().error) return points.back().triangles;
    std::size_t i = 1;
    while (points[i].error <= error) ++i;
    const Point a = points[i - 1], b = points[i];
    return a.triangles + (b.triangles - a.triangles) * (error - a.error) / (b.error - a.error);
  }
};

/// Halves a group until it has less than `least` triangles.
ErrorCurve curve_of(TriangleGroup group, double least) {
  ErrorCurve curve;
  curve.points.push_back({0, static_cast<double>(group.triangles.size())});
  double error = 0;
  while (static_cast<double>(group.triangles.size()) > least) {
    const std::uint64_t before = group.triangles.size();
    SimplifiedGroup half = simplify(group, {before / 2, kAnyDistance, true});
    if (half.triangles.size() >= before) break;
    group.triangles = std::move(half.triangles);
    error = std::max(error, half.quadric_error);
    const auto left = static_cast<double>(group.triangles.size());
    if (error > curve.points.back().error)
      curve.points.push_back({error, left});
    else
      curve.points.back().triangles = left;
    if (group.triangles.size() > before / 4 * 3) break;  // locked vertices are in the way
  }
  return curve;
}

std::uint64_t rounded(double count) { return static_cast<std::uint64_t>(std::llround(count)); }

}  // namespace

SimplifyStage::SimplifyStage(MeshSink& next, std::stop_token cancel, const ScratchPlace& place,
                             std::uint64_t memory, const Simplification& simplification)
    : FilterStage(next, std::move(cancel)),
      simplification_(simplification),
      place_(place),
      sorted_memory_(memory / 4),
      mesh_(place, memory / 2),
      numbers_(place, memory / 8) {
  constexpr double far = std::numeric_limits<double>::infinity();
  bounds_ = {{far, far, far}, {-far, -far, -far}};
}

std::uint64_t SimplifyStage::own_memory() const {
  return mesh_.memory() + sorted_memory_ + numbers_.memory() + kGroupsAtOnce * kGroupBytes;
}

void SimplifyStage::begin(const MeshHeader& header) {
  mesh_.begin(header);
  next().begin(header);
}

void SimplifyStage::write(const MeshChunk& chunk) {
  check_cancelled();
  mesh_.append(chunk);
  for (const Vec3f& p : chunk.positions)
    for (int axis = 0; axis < 3; ++axis) {
      bounds_.lo[axis] = std::min<double>(bounds_.lo[axis], p[axis]);
      bounds_.hi[axis] = std::max<double>(bounds_.hi[axis], p[axis]);
    }
}

std::uint64_t SimplifyStage::target() const {
  if (simplification_.triangles > 0) return simplification_.triangles;
  if (simplification_.ratio >= 1 && simplification_.max_error > 0) return 0;
  return rounded(simplification_.ratio * static_cast<double>(mesh_.size().triangles));
}

/// Calls f(group, its number) for all groups, several at the same time, and then g(number) in
/// order.
template <class F>
void SimplifyStage::for_each_group(TriangleGroups& groups, F&& f) {
  const int most = tbb::info::default_concurrency();
  const int threads = simplification_.threads > 0 ? std::min(simplification_.threads, most) : most;
  tbb::task_arena arena(threads);
  for (std::size_t first = 0; first < groups.count(); first += kGroupsAtOnce) {
    check_cancelled();
    const std::size_t count = std::min(kGroupsAtOnce, groups.count() - first);
    std::vector<TriangleGroup> loaded;
    std::uint64_t bytes = 0;
    for (std::size_t i = 0; i < count; ++i) {
      bytes += groups.size(first + i) * sizeof(Triangle);
      loaded.push_back(groups.load(first + i, mesh_.positions()));
    }
    f(first, loaded, arena);
    progress().advance(bytes);
  }
}

/// Targets of groups at one common error, at which all have `target` triangles together.
std::vector<std::uint64_t> SimplifyStage::plan_targets(TriangleGroups& groups,
                                                       std::uint64_t target) {
  const double share = static_cast<double>(target) / static_cast<double>(mesh_.size().triangles);
  std::vector<ErrorCurve> curves(groups.count());
  std::uint64_t all = 0;
  for (std::size_t i = 0; i < groups.count(); ++i) all += groups.size(i);
  const double ratio = std::min(share, static_cast<double>(target) / static_cast<double>(all));
  for_each_group(
      groups, [&](std::size_t first, std::vector<TriangleGroup>& loaded, tbb::task_arena& arena) {
        arena.execute([&] {
          tbb::parallel_for(std::size_t{0}, loaded.size(), [&](std::size_t i) {
            const double least = ratio * static_cast<double>(loaded[i].triangles.size()) / 4;
            curves[first + i] = curve_of(std::move(loaded[i]), least);
          });
        });
      });
  const auto total = [&](double error) {
    double sum = 0;
    for (const ErrorCurve& curve : curves) sum += curve.at(error);
    return sum;
  };
  double lo = 0, hi = 0;
  for (const ErrorCurve& curve : curves) hi = std::max(hi, curve.points.back().error);
  for (int step = 0; step < 60; ++step) {
    const double middle = 0.5 * (lo + hi);
    (total(middle) > static_cast<double>(target) ? lo : hi) = middle;
  }
  std::vector<std::uint64_t> targets;
  for (const ErrorCurve& curve : curves) targets.push_back(rounded(curve.at(hi)));
  return targets;
}

void SimplifyStage::run_pass(TriangleGroups& groups, const std::vector<std::uint64_t>& targets,
                             double max_distance) {
  for_each_group(
      groups, [&](std::size_t first, std::vector<TriangleGroup>& loaded, tbb::task_arena& arena) {
        std::vector<SimplifiedGroup> simplified(loaded.size());
        arena.execute([&] {
          tbb::parallel_for(std::size_t{0}, loaded.size(), [&](std::size_t i) {
            simplified[i] = simplify(loaded[i], {targets[first + i], max_distance});
          });
        });
        for (std::size_t i = 0; i < loaded.size(); ++i)
          for (const Triangle& t : simplified[i].triangles)
            mesh_.triangles().push_back(
                {loaded[i].vertices[t[0]], loaded[i].vertices[t[1]], loaded[i].vertices[t[2]]});
      });
}

void SimplifyStage::simplify_all() {
  const std::uint64_t goal = target();
  const auto first = static_cast<double>(mesh_.triangles().size());
  const double ratio = static_cast<double>(goal) / first;
  const bool has_limit = simplification_.max_error > 0;
  for (std::size_t pass = 0; pass < kSplits.size(); ++pass) {
    const std::uint64_t all = mesh_.triangles().size();
    if (all <= goal) break;
    TriangleGroups groups(place_, sorted_memory_, kSplits[pass]);
    groups.sort(mesh_.positions(), bounds_, mesh_.triangles(), kGroupTriangles,
                [this] { check_cancelled(); });
    sorted_bytes_ = std::max(sorted_bytes_, groups.file_bytes());
    // One group has no borders that another pass could simplify.
    const bool is_last = groups.count() == 1 || pass + 1 == kSplits.size();
    const std::uint64_t wanted =
        is_last || goal == 0 ? goal : rounded(first * std::pow(ratio, kGoals[pass]));
    const bool has_plan = groups.count() > 1 && wanted > 0;
    progress().begin("simplifying", (has_plan ? 2 : 1) * all * sizeof(Triangle));
    const std::vector<std::uint64_t> targets =
        has_plan ? plan_targets(groups, wanted)
                 : std::vector<std::uint64_t>(groups.count(), wanted);
    const double share = is_last && pass == 0 ? 1 : kErrorShares[pass];
    run_pass(groups, targets, has_limit ? share * simplification_.max_error : kAnyDistance);
    progress().end();
    if (is_last) break;
  }
}

void SimplifyStage::write_kept() {
  const std::uint64_t vertices = mesh_.positions().size();
  numbers_.resize(vertices);
  mesh_.triangles().for_each_run([&](std::span<const Triangle> run, std::uint64_t) {
    check_cancelled();
    for (const Triangle& t : run)
      for (const std::uint32_t v : t) numbers_.edit(v) = 1;
  });
  std::vector<Vec3f> positions, normals;
  std::uint32_t kept = 0;
  mesh_.positions().for_each_run([&](std::span<const Vec3f> run, std::uint64_t first) {
    check_cancelled();
    positions.clear();
    normals.clear();
    const std::uint32_t before = kept;
    for (std::size_t i = 0; i < run.size(); ++i) {
      if (numbers_[first + i] == 0) continue;
      numbers_.edit(first + i) = ++kept;
      positions.push_back(run[i]);
      if (mesh_.has_normals()) normals.push_back(mesh_.normals()[first + i]);
    }
    if (!positions.empty())
      next().write({.first_vertex = before, .positions = positions, .normals = normals});
  });
  std::vector<Triangle> triangles;
  mesh_.triangles().for_each_run([&](std::span<const Triangle> run, std::uint64_t) {
    check_cancelled();
    triangles.clear();
    for (const Triangle& t : run)
      triangles.push_back({numbers_[t[0]] - 1, numbers_[t[1]] - 1, numbers_[t[2]] - 1});
    next().write({.first_vertex = kept, .triangles = triangles});
  });
}

void SimplifyStage::finish() {
  if (target() < mesh_.size().triangles) {
    simplify_all();
    write_kept();
    mesh_.release();
    numbers_.release();
  } else {
    mesh_.replay_and_release(next());
  }
  next().finish();
}

}  // namespace isobrick
