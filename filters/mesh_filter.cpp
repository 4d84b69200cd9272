#include <isobrick/mesh_filters.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <isobrick/error.h>
#include <isobrick/mesh_sinks.h>
#include "core/length_unit.h"
#include "filters/component_stage.h"
#include "filters/measure_stage.h"
#include "filters/simplify_stage.h"
#include "filters/smooth_stage.h"
#include "filters/unit_stage.h"
#include "filters/unweld_stage.h"

namespace isobrick::inline v0 {
namespace {

constexpr double kMaxPassBand = 0.8;  // beyond 0.87 what alternates would grow
constexpr int kMaxIterations = 10000;

bool chooses_components(const MeshFilterOptions& options) {
  return options.min_component > 1 || options.largest > 0;
}

/// Counts what it passes on.
class CountStage final : public FilterStage {
 public:
  CountStage(MeshSink& next, std::stop_token cancel, Indexing indexing)
      : FilterStage(next, std::move(cancel)), indexing_(indexing) {}

  Indexing indexing() const override { return indexing_; }
  bool takes_wide() const override { return next().takes_wide(); }
  void begin(const MeshHeader& header) override { next().begin(header); }
  void write(const MeshChunk& chunk) override {
    check_cancelled();
    size_.vertices += chunk.positions.size();
    size_.triangles += chunk.triangles.size() + chunk.wide_triangles.size();
    next().write(chunk);
  }
  void finish() override { next().finish(); }
  MeshSize size() const { return size_; }

 private:
  std::uint64_t own_bytes() const override { return 0; }
  std::uint64_t own_memory() const override { return 0; }

  Indexing indexing_;
  MeshSize size_;
};

/// Takes a mesh to nowhere.
class NoSink final : public MeshSink {
 public:
  Indexing indexing() const override { return Indexing::welded; }
  void begin(const MeshHeader&) override {}
  void write(const MeshChunk&) override {}
  void finish() override {}
  std::uint64_t bytes() const override { return 0; }
};

/// Room for all of a mesh that lies in memory itself.
constexpr std::uint64_t kAllMemory = std::uint64_t{1} << 60;

void check_numbers(const Mesh& mesh) {
  for (const Triangle& t : mesh.triangles)
    for (const std::uint32_t vertex : t)
      if (vertex >= mesh.positions.size())
        throw UsageError(fmt::format("a triangle names vertex {}, but the mesh has {} vertices",
                                     vertex, mesh.positions.size()));
}

}  // namespace

void check_filters(const MeshFilterOptions& options) {
  if (options.min_component > 0 && options.largest > 0)
    throw UsageError(
        "components are chosen by the triangles that each needs or as the largest ones: give one "
        "of both");
  if (options.smooth < 0 || options.smooth > kMaxIterations)
    throw UsageError(
        fmt::format("smoothing takes 0 to {} iterations, not {}", kMaxIterations, options.smooth));
  if (!(options.pass_band > 0 && options.pass_band <= kMaxPassBand))
    throw UsageError(fmt::format("the pass band must be above 0 and at most {}, not {}",
                                 kMaxPassBand, options.pass_band));
  if (!(options.simplify_ratio > 0 && options.simplify_ratio <= 1))
    throw UsageError(
        fmt::format("a mesh is simplified to a part of its triangles above 0 and at most 1, not {}",
                    options.simplify_ratio));
  if (!(options.max_error >= 0 && std::isfinite(options.max_error)))
    throw UsageError(
        fmt::format("the error of a simplification must be a length, not {}", options.max_error));
  if (!options.unit.empty() && unit_name(options.unit) != options.unit)
    throw UsageError(no_unit_text(options.unit));
}

std::uint64_t filter_scratch_bytes(const MeshFilterOptions& options, MeshSize mesh,
                                   bool has_normals) {
  const std::uint64_t v = mesh.vertices, number = v > kMaxNarrowVertices ? 8 : 4;
  const std::uint64_t triangles = mesh.triangles * 3 * number;
  const std::uint64_t row = (has_normals ? 2 : 1) * sizeof(Vec3f);
  std::uint64_t bytes = 0;
  // Two filters have the mesh at the same time while one passes it on.
  if (chooses_components(options)) bytes += v * (row + 8 + 2 * number) + triangles;
  if (options.smooth > 0) bytes += v * (row + 20) + triangles;
  if (options.simplifies()) bytes += v * (row + number + sizeof(Collapse)) + 2 * triangles;
  if (options.measure) bytes += v * (sizeof(Vec3f) + number);
  return bytes;
}

/// The filters, of which each writes to the one after it.
class MeshFilter::Stages {
 public:
  Stages(MeshSink& sink, const MeshFilterOptions& options)
      : sink_(sink), options_(options), place_{.beside = options.scratch_beside.string()} {
    check_filters(options);
    make<std::uint32_t>();
  }

  /// Filters for meshes of more vertices in place of those that were made.
  void widen() { make<std::uint64_t>(); }

  MeshSink& first() { return *first_; }
  MeshSize size() const { return count_->size(); }
  std::optional<MeshMeasure> measure() const {
    return measure_ ? std::optional(*measure_) : std::nullopt;
  }
  std::optional<std::uint64_t> simplify_goal() const {
    return simplify_goal_ ? *simplify_goal_ : std::nullopt;
  }

 private:
  template <class Number>
  void make() {
    const MeshFilterOptions& options = options_;
    stages_.clear();
    first_ = &sink_;
    const bool takes_welded = options.changes_mesh() || options.measure || options.takes_welded;
    const bool unwelds = takes_welded && sink_.indexing() == Indexing::chunk_local;
    const int shares = int{unwelds} + int{options.measure} + int{options.smooth > 0} +
                       int{options.simplifies()} + int{chooses_components(options)};
    const std::uint64_t memory = options.memory / static_cast<std::uint64_t>(std::max(1, shares));
    // From the sink back to the extraction.
    if (unwelds) add<UnweldStage<Number>>(place_, memory);
    count_ = &add<CountStage>(first_->indexing());
    if (options.measure) measure_ = &add<MeasureStage<Number>>(place_, memory).measure();
    if (!options.unit.empty()) add<UnitStage>(options.unit);
    if (options.simplifies())
      simplify_goal_ = &add<SimplifyStage<Number>>(
                            place_, memory,
                            Simplification{options.simplify_ratio, options.simplify_triangles,
                                           options.max_error, options.threads, options.progress})
                            .goal();
    if (options.smooth > 0)
      add<SmoothStage<Number>>(place_, memory,
                               Smoothing{options.smooth, options.pass_band, options.progress});
    if (chooses_components(options))
      add<ComponentStage<Number>>(place_, memory,
                                  ComponentChoice{options.min_component, options.largest});
  }

  /// Puts a filter before what is there.
  template <class Stage, class... Arguments>
  Stage& add(Arguments&&... arguments) {
    auto stage =
        std::make_unique<Stage>(*first_, options_.cancel, std::forward<Arguments>(arguments)...);
    Stage& added = *stage;
    first_ = stage.get();
    stages_.push_back(std::move(stage));
    return added;
  }

  MeshSink& sink_;
  MeshFilterOptions options_;
  ScratchPlace place_;
  std::vector<std::unique_ptr<FilterStage>> stages_;
  const CountStage* count_ = nullptr;
  const MeshMeasure* measure_ = nullptr;
  const std::optional<std::uint64_t>* simplify_goal_ = nullptr;
  MeshSink* first_ = nullptr;
};

MeshFilter::MeshFilter(MeshSink& sink, const MeshFilterOptions& options)
    : stages_(std::make_unique<Stages>(sink, options)) {}

MeshFilter::~MeshFilter() = default;

Indexing MeshFilter::indexing() const { return stages_->first().indexing(); }
bool MeshFilter::takes_wide() const { return stages_->first().takes_wide(); }
void MeshFilter::begin(const MeshHeader& header) {
  MeshHeader plain = header;
  plain.attributes.clear();
  if (plain.wide) stages_->widen();
  stages_->first().begin(plain);
}
void MeshFilter::write(const MeshChunk& chunk) {
  MeshChunk plain = chunk;
  plain.attributes = {};
  stages_->first().write(plain);
}
void MeshFilter::finish() { stages_->first().finish(); }
std::uint64_t MeshFilter::bytes() const { return stages_->first().bytes(); }
std::uint64_t MeshFilter::memory() const { return stages_->first().memory(); }
MeshSize MeshFilter::size() const { return stages_->size(); }
std::optional<MeshMeasure> MeshFilter::measure() const { return stages_->measure(); }
std::optional<std::uint64_t> MeshFilter::simplify_goal() const { return stages_->simplify_goal(); }

Mesh apply_filters(const Mesh& mesh, const MeshFilterOptions& options) {
  check_numbers(mesh);
  if (!mesh.normals.empty() && mesh.normals.size() != mesh.positions.size())
    throw UsageError(fmt::format("the mesh has {} normals, but {} vertices", mesh.normals.size(),
                                 mesh.positions.size()));
  MeshFilterOptions in_memory = options;
  in_memory.memory = kAllMemory;
  in_memory.measure = false;
  Mesh result;
  MemorySink sink(result);
  MeshFilter filter(sink, in_memory);
  filter.begin({.has_normals = !mesh.normals.empty(), .unit = mesh.unit});
  filter.write(mesh.chunk());
  filter.finish();
  return result;
}

MeshMeasure measure(const Mesh& mesh) {
  check_numbers(mesh);
  NoSink nowhere;
  MeasureStage<std::uint32_t> stage(nowhere, {}, {}, kAllMemory);
  stage.begin({.unit = mesh.unit});
  stage.write(mesh.chunk());
  stage.finish();
  return stage.measure();
}

}  // namespace isobrick
