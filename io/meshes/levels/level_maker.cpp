#include "io/meshes/levels/level_maker.h"

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

/// The edge of a fragment, in edges of the mesh's triangles: a surface through it has some
/// thousands. 16 bits then tell positions apart to a thousandth of an edge.
constexpr double kFragmentEdges = 64;
/// A fragment with more triangles is divided, so that viewers load little at a time.
constexpr std::uint64_t kMaxFragmentTriangles = 200'000;
/// A quarter of the triangles doubles their edges, as a fragment's edge doubles.
constexpr double kLevelRatio = 0.25;
/// A level must have fewer triangles than this part of the one before.
constexpr double kWorthRatio = 0.8;

/// A triangle's, while it is cut, welded and encoded.
constexpr std::uint64_t kTriangleBytes = 400;

/// Takes a mesh into a spool.
template <class Number>
class SpoolSink final : public MeshSink {
 public:
  explicit SpoolSink(MeshSpool<Number>& spool) : spool_(spool) {}

  Indexing indexing() const override { return Indexing::welded; }
  bool takes_wide() const override { return true; }
  void begin(const MeshHeader& header) override { spool_.begin(header); }
  void write(const MeshChunk& chunk) override { spool_.append(chunk); }
  void finish() override {}
  std::uint64_t bytes() const override { return spool_.bytes(); }

 private:
  MeshSpool<Number>& spool_;
};

double area_of(const Vec3f& a, const Vec3f& b, const Vec3f& c) {
  const double ux = double{b.x} - a.x, uy = double{b.y} - a.y, uz = double{b.z} - a.z;
  const double vx = double{c.x} - a.x, vy = double{c.y} - a.y, vz = double{c.z} - a.z;
  return std::hypot(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx) / 2;
}

/// Takes a mesh into a spool, from its first level on.
template <class Number>
class Levels final : public LevelMaker {
 public:
  Levels(LevelWriter& writer, const LevelOptions& options, std::uint64_t work_bytes,
         const MeshHeader& header);

  void write(const MeshChunk& chunk) override;
  void finish() override;
  std::uint64_t bytes() const override { return mesh_.bytes(); }
  std::vector<WrittenLevel> levels() const override { return written_; }

 private:
  /// What a mesh measures, as far as its grid depends on it.
  struct Extent {
    MeshBounds bounds;
    double edge = 0;  ///< of an equilateral triangle of the mean area
  };

  MeshSpool<Number> make_spool() const;
  void make_normals();
  Extent measure(MeshSpool<Number>& mesh) const;
  void choose_grid(const Extent& extent);
  void write_level(int level, double edge);
  /// Replaces the mesh by a simpler one; false where there is none worth a level.
  bool simplify();

  LevelWriter& writer_;
  LevelNeeds needs_;
  bool lacks_normals_ = false;  ///< until they are made
  LevelOptions options_;
  std::uint64_t work_bytes_;
  ScratchPlace place_;
  MeshSpool<Number> mesh_;
  double error_ = 0;  ///< EncodedLevel::error
  ChunkGrid grid_;
  std::vector<EncodedLevel> encoded_;
  std::vector<WrittenLevel> written_;
};

template <class Number>
Levels<Number>::Levels(LevelWriter& writer, const LevelOptions& options, std::uint64_t work_bytes,
                       const MeshHeader& header)
    : writer_(writer),
      needs_(writer_.needs()),
      options_(options),
      work_bytes_(work_bytes),
      place_{.beside = options.scratch_beside.string()},
      mesh_(make_spool()) {
  lacks_normals_ = needs_.normals && !header.has_normals && options_.makes_normals;
  MeshHeader of_levels = header;
  of_levels.has_normals = needs_.normals && (header.has_normals || lacks_normals_);
  mesh_.begin(of_levels);
  writer_.begin(of_levels);
}

template <class Number>
MeshSpool<Number> Levels<Number>::make_spool() const {
  return MeshSpool<Number>(place_, options_.memory / 4);
}

template <class Number>
void Levels<Number>::write(const MeshChunk& chunk) {
  MeshChunk plain = chunk;
  if (!needs_.normals) plain.normals = {};
  mesh_.append(plain);
}

template <class Number>
void Levels<Number>::make_normals() {
  ScratchArray<Vec3f>&positions = mesh_.positions(), &normals = mesh_.normals();
  normals.resize(positions.size());
  mesh_.triangles().for_each_run([&](std::span<const TriangleOf<Number>> run, std::uint64_t) {
    for (const auto& t : run) {
      const Vec3d a = to_double(positions[t[0]]), b = to_double(positions[t[1]]),
                  c = to_double(positions[t[2]]);
      const Vec3f normal = to_float(cross(b - a, c - a));
      for (const Number v : t) {
        Vec3f& sum = normals.edit(v);
        sum = sum + normal;
      }
    }
  });
  normals.edit_runs([](std::span<Vec3f> run, std::uint64_t) {
    for (Vec3f& n : run) n = to_float(unit(to_double(n), {0, 0, 1}));
  });
}

template <class Number>
typename Levels<Number>::Extent Levels<Number>::measure(MeshSpool<Number>& mesh) const {
  constexpr double far = std::numeric_limits<double>::infinity();
  Extent extent{.bounds = {{far, far, far}, {-far, -far, -far}}};
  double area = 0;
  mesh.triangles().for_each_run([&](std::span<const TriangleOf<Number>> run, std::uint64_t) {
    for (const auto& t : run) {
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

template <class Number>
void Levels<Number>::choose_grid(const Extent& extent) {
  // Triangles of very different sizes may crowd in a fragment.
  constexpr int most_divisions = 6;
  double edge = kFragmentEdges * extent.edge;
  for (int i = 0;; ++i, edge /= 2) {
    grid_ = make_chunk_grid(extent.bounds, edge);
    if (i == most_divisions) return;
    const FragmentWork work{
        .place = place_, .memory = options_.memory / 8, .progress = &no_progress()};
    if (LevelFragments<Number>(mesh_, grid_, 0, work).largest() <= kMaxFragmentTriangles) return;
  }
}

template <class Number>
void Levels<Number>::write_level(int level, double edge) {
  Progress& progress = options_.progress ? *options_.progress : no_progress();
  const FragmentWork work{.place = place_,
                          .memory = options_.memory / 4,
                          .triangles_at_once = work_bytes_ / kTriangleBytes,
                          .threads = options_.threads,
                          .progress = &progress};
  progress.begin(fmt::format("level of detail {}", level),
                 3 * mesh_.triangles().size() * sizeof(Triangle));
  LevelFragments<Number> fragments(mesh_, grid_, level, work);
  EncodedLevel& encoded =
      encoded_.emplace_back(EncodedLevel{edge, error_, fragments.encode(writer_)});
  WrittenLevel& written = written_.emplace_back();
  written.triangles = mesh_.size().triangles;
  written.fragments = encoded.fragments.size();
  for (const EncodedFragment& fragment : encoded.fragments) written.bytes += fragment.bytes;
  progress.end();
}

template <class Number>
bool Levels<Number>::simplify() {
  const std::uint64_t before = mesh_.size().triangles;
  MeshSpool<Number> simpler = make_spool();
  SpoolSink<Number> sink(simpler);
  SimplifyStage<Number> stage(sink, {}, place_, options_.memory / 4,
                              {.ratio = kLevelRatio,
                               .threads = options_.threads,
                               .progress = options_.progress,
                               .measures_error = needs_.errors});
  stage.begin({.has_normals = mesh_.has_normals(), .wide = kIsWide<Number>});
  mesh_.replay_and_release(stage, kIsWide<Number>);
  stage.finish();
  error_ += stage.error();
  mesh_ = std::move(simpler);
  return static_cast<double>(mesh_.size().triangles) < kWorthRatio * static_cast<double>(before);
}

template <class Number>
void Levels<Number>::finish() {
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
  writer_.finish(grid_, std::move(encoded_));
}

}  // namespace

std::unique_ptr<LevelMaker> make_levels(LevelWriter& writer, const LevelOptions& options,
                                        std::uint64_t work_bytes, const MeshHeader& header) {
  if (header.wide)
    return std::make_unique<Levels<std::uint64_t>>(writer, options, work_bytes, header);
  return std::make_unique<Levels<std::uint32_t>>(writer, options, work_bytes, header);
}

}  // namespace isobrick
