#include "io/meshes/levels/detail_sink.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "core/vectors.h"
#include "filters/simplify_stage.h"
#include "io/meshes/levels/level_fragments.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;

/// The edge of a fragment, in edges of the mesh's triangles: a surface through it has some
/// thousands. 16 bits then tell positions apart to a thousandth of an edge.
constexpr double kFragmentEdges = 64;
/// A fragment with more triangles is divided, so that viewers load little at a time.
constexpr std::uint64_t kMaxFragmentTriangles = 200'000;
/// A quarter of the triangles doubles their edges, as a fragment's edge doubles.
constexpr double kLevelRatio = 0.25;
/// A level must have fewer triangles than this part of the one before.
constexpr double kWorthRatio = 0.8;

/// What the simplification takes beside the memory of its options, and what encoding takes in its
/// place: MeshFilterOptions::memory.
constexpr std::uint64_t kWorkBytes = 120 * kMiB;
/// A triangle's, while it is cut, welded and encoded.
constexpr std::uint64_t kTriangleBytes = 400;

/// Takes a mesh into a spool.
class SpoolSink final : public MeshSink {
 public:
  explicit SpoolSink(MeshSpool& spool) : spool_(spool) {}

  Indexing indexing() const override { return Indexing::welded; }
  void begin(const MeshHeader& header) override { spool_.begin(header); }
  void write(const MeshChunk& chunk) override { spool_.append(chunk); }
  void finish() override {}
  std::uint64_t bytes() const override { return spool_.bytes(); }

 private:
  MeshSpool& spool_;
};

double area_of(const Vec3f& a, const Vec3f& b, const Vec3f& c) {
  const double ux = double{b.x} - a.x, uy = double{b.y} - a.y, uz = double{b.z} - a.z;
  const double vx = double{c.x} - a.x, vy = double{c.y} - a.y, vz = double{c.z} - a.z;
  return std::hypot(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx) / 2;
}

}  // namespace

std::uint64_t level_memory(const LevelOptions& options) { return options.memory + kWorkBytes; }

std::uint64_t level_share(std::uint64_t budget) {
  // No more of a small budget, whatever it is: so a budget that is called enough is enough.
  return budget < 512 * kMiB ? 16 * kMiB : std::min(budget / 8, 1024 * kMiB);
}

DetailSink::DetailSink(std::unique_ptr<LevelWriter> writer, const LevelOptions& options)
    : writer_(std::move(writer)),
      needs_(writer_->needs()),
      options_(options),
      place_{.beside = options.scratch_beside.string()},
      mesh_(make_spool()) {}

MeshSpool DetailSink::make_spool() const { return MeshSpool(place_, options_.memory / 4); }

void DetailSink::begin(const MeshHeader& header) {
  lacks_normals_ = needs_.normals && !header.has_normals && options_.makes_normals;
  MeshHeader of_levels = header;
  of_levels.has_normals = needs_.normals && (header.has_normals || lacks_normals_);
  mesh_.begin(of_levels);
  writer_->begin(of_levels);
}

void DetailSink::write(const MeshChunk& chunk) {
  MeshChunk plain = chunk;
  if (!needs_.normals) plain.normals = {};
  mesh_.append(plain);
}

void DetailSink::make_normals() {
  ScratchArray<Vec3f>&positions = mesh_.positions(), &normals = mesh_.normals();
  normals.resize(positions.size());
  mesh_.triangles().for_each_run([&](std::span<const Triangle> run, std::uint64_t) {
    for (const Triangle& t : run) {
      const Vec3d a = to_double(positions[t[0]]), b = to_double(positions[t[1]]),
                  c = to_double(positions[t[2]]);
      const Vec3f normal = to_float(cross(b - a, c - a));
      for (const std::uint32_t v : t) {
        Vec3f& sum = normals.edit(v);
        sum = sum + normal;
      }
    }
  });
  normals.edit_runs([](std::span<Vec3f> run, std::uint64_t) {
    for (Vec3f& n : run) n = to_float(unit(to_double(n), {0, 0, 1}));
  });
}

DetailSink::Extent DetailSink::measure(MeshSpool& mesh) const {
  constexpr double far = std::numeric_limits<double>::infinity();
  Extent extent{.bounds = {{far, far, far}, {-far, -far, -far}}};
  double area = 0;
  mesh.triangles().for_each_run([&](std::span<const Triangle> run, std::uint64_t) {
    for (const Triangle& t : run) {
      const Vec3f corners[3] = {mesh.positions()[t[0]], mesh.positions()[t[1]],
                                mesh.positions()[t[2]]};
      area += area_of(corners[0], corners[1], corners[2]);
      for (const Vec3f& p : corners)
        for (int axis = 0; axis < 3; ++axis) {
          extent.bounds.lo[axis] = std::min<double>(extent.bounds.lo[axis], p[axis]);
          extent.bounds.hi[axis] = std::max<double>(extent.bounds.hi[axis], p[axis]);
        }
    }
  });
  const auto triangles = static_cast<double>(mesh.triangles().size());
  extent.edge = std::sqrt(area / std::max(1.0, triangles) * 4 / std::sqrt(3.0));
  return extent;
}

void DetailSink::choose_grid(const Extent& extent) {
  // Triangles of very different sizes may crowd in a fragment.
  constexpr int most_divisions = 6;
  double edge = kFragmentEdges * extent.edge;
  for (int i = 0;; ++i, edge /= 2) {
    grid_ = make_chunk_grid(extent.bounds, edge);
    if (i == most_divisions) return;
    const FragmentWork work{
        .place = place_, .memory = options_.memory / 8, .progress = &no_progress()};
    if (LevelFragments(mesh_, grid_, 0, work).largest() <= kMaxFragmentTriangles) return;
  }
}

void DetailSink::write_level(int level, double edge) {
  Progress& progress = options_.progress ? *options_.progress : no_progress();
  const FragmentWork work{.place = place_,
                          .memory = options_.memory / 4,
                          .triangles_at_once = kWorkBytes / kTriangleBytes,
                          .threads = options_.threads,
                          .progress = &progress};
  progress.begin(fmt::format("level of detail {}", level),
                 3 * mesh_.triangles().size() * sizeof(Triangle));
  LevelFragments fragments(mesh_, grid_, level, work);
  EncodedLevel& encoded =
      encoded_.emplace_back(EncodedLevel{edge, error_, fragments.encode(*writer_)});
  WrittenLevel& written = written_.emplace_back();
  written.triangles = mesh_.size().triangles;
  written.fragments = encoded.fragments.size();
  for (const EncodedFragment& fragment : encoded.fragments) written.bytes += fragment.bytes;
  progress.end();
}

bool DetailSink::simplify() {
  const std::uint64_t before = mesh_.size().triangles;
  MeshSpool simpler = make_spool();
  SpoolSink sink(simpler);
  SimplifyStage stage(sink, {}, place_, options_.memory / 4,
                      {.ratio = kLevelRatio,
                       .threads = options_.threads,
                       .progress = options_.progress,
                       .measures_error = needs_.errors});
  stage.begin({.has_normals = mesh_.has_normals()});
  mesh_.replay_and_release(stage);
  stage.finish();
  error_ += stage.error();
  mesh_ = std::move(simpler);
  return static_cast<double>(mesh_.size().triangles) < kWorthRatio * static_cast<double>(before);
}

void DetailSink::finish() {
  if (lacks_normals_) make_normals();
  if (mesh_.size().triangles > 0) {
    Extent extent = measure(mesh_);
    choose_grid(extent);
    const int levels = options_.levels > 0 ? options_.levels : grid_.levels();
    for (int level = 0;;) {
      write_level(level, extent.edge);
      if (++level == levels || !simplify()) break;
      extent = measure(mesh_);
    }
  }
  mesh_.release();
  writer_->finish(grid_, std::move(encoded_));
}

}  // namespace isobrick
