#include <isobrick/export.h>

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <memory>
#include <optional>
#include <span>

#include <isobrick/error.h>
#include <isobrick/storage.h>
#include "core/budget_error.h"
#include "core/cancellable_progress.h"
#include "io/bytes/file.h"
#include "io/bytes/leftovers.h"
#include "io/bytes/output_file.h"
#include "io/bytes/output_guard.h"
#include "io/volumes/raw/nrrd_writer.h"
#include "io/volumes/vdb/vdb_writer.h"
#include "pipeline/export/export_level_set.h"
#include "pipeline/export/vdb_budget.h"
#include "pipeline/program_memory.h"
#include "pipeline/slab_file.h"
#include "pipeline/slab_piece.h"
#include "pipeline/slab_reader.h"
#include "pipeline/stored_bricks.h"
#include "pipeline/workers.h"

namespace isobrick::inline v0 {
namespace {

static_assert(std::endian::native == std::endian::little, "raw files are written as they are");

/// Larger pieces are no faster.
constexpr std::size_t kPieceBytes = 256 * kMiB;

Box3 region(const StoreReader& store, int level, const std::optional<Box3>& roi) {
  const StoreInfo& info = store.info();
  if (level < 0 || level >= static_cast<int>(info.levels.size()))
    throw UsageError(
        fmt::format("there is no level {}: '{}' has {}", level, info.name, info.levels.size()));
  const Box3 all = info.levels[static_cast<std::size_t>(level)].lattice.box();
  if (!roi) return all;
  if (roi->empty() || intersect(*roi, all) != *roi)
    throw UsageError(
        fmt::format("the region [{}, {}) × [{}, {}) × [{}, {}) does not lie in the level's {} × {} "
                    "× {} samples",
                    roi->lo.x, roi->hi.x, roi->lo.y, roi->hi.y, roi->lo.z, roi->hi.z, all.hi.x,
                    all.hi.y, all.hi.z));
  return *roi;
}

/// What there is beside the samples of a piece.
std::uint64_t fixed_bytes(const StoreInfo& store, int level, int threads) {
  return kProgramBytes + slab_memory(store, level, threads);
}

/// The box of bricks to hold at a time; `fixed` bytes go for other things.
Int3 piece_within(const Lattice& lattice, Int3 extent, std::uint64_t memory, std::uint64_t fixed) {
  const std::uint64_t least = fixed + lattice.brick_bytes();
  if (memory < least)
    throw UsageError(fmt::format(
        "a memory budget of {:.1f} MiB is too small: at least --memory {}M is needed, {} "
        "MiB of it for the program and its libraries, the rest for bricks and for "
        "decoding them on all threads",
        in_mib(memory), mib_above(least), kProgramBytes / kMiB));
  const std::size_t room = std::min(static_cast<std::size_t>(memory - fixed), kPieceBytes);
  return largest_piece(extent, lattice.brick, room / lattice.sample_bytes());
}

/// Bricks of `piece` samples over `box`, aligned to the lattice of bricks.
template <class F>
void for_each_piece(Box3 box, Int3 brick, Int3 piece, F&& f) {
  const Int3 start = floor_div(box.lo, brick) * brick;
  for_each_point({{0, 0, 0}, ceil_div(box.hi - start, piece)}, [&](Int3 p) {
    const Int3 lo = start + p * piece;
    f(intersect({lo, lo + piece}, box));
  });
}

/// The exported box as a volume of its own.
VolumeInfo describe(const LevelInfo& level, Box3 box, const std::string& name) {
  VolumeInfo info;
  info.extent = box.extent();
  info.type = level.lattice.type;
  info.transform = level.transform;
  info.name = name;
  info.transform.origin =
      level.transform.apply({static_cast<double>(box.lo.x), static_cast<double>(box.lo.y),
                             static_cast<double>(box.lo.z)});
  return info;
}

/// What a reader of the file sees: the samples of a box of the store.
struct Piece {
  const StoreReader& store;
  int level;
  Box3 box;
  const Lattice& lattice() const {
    return store.info().levels[static_cast<std::size_t>(level)].lattice;
  }
};

/// The most that the grid of a box takes: all that is stored of it.
std::uint64_t max_grid(const Piece& in) {
  const Lattice& lattice = in.lattice();
  std::uint64_t leaves = 0;
  NoProgress silent;
  for_each_stored_brick(in.store, in.level, in.box, silent, [&](Int3 brick) {
    const Box3 part = intersect(lattice.brick_box(brick), in.box);
    const Box3 in_grid{part.lo - in.box.lo, part.hi - in.box.lo};
    constexpr Int3 leaf{8, 8, 8};
    leaves += static_cast<std::uint64_t>(
        volume(ceil_div(in_grid.hi, leaf) - floor_div(in_grid.lo, leaf)));
  });
  const bool wide = lattice.type == ScalarType::f64 || lattice.type == ScalarType::u32;
  return vdb_grid_bytes(in.box.extent(), leaves, wide ? 8 : 4);
}

void export_vdb(const Piece& in, const VolumeInfo& info, std::uint64_t memory, Workers& workers,
                OutputFile& output, Progress& progress) {
  const Lattice& lattice = in.lattice();
  const std::string& name = info.grid_name;
  const std::uint64_t others = fixed_bytes(in.store.info(), in.level, workers.threads()) +
                               lattice.brick_bytes() + kVdbLibraryBytes;
  const auto refuse = [&] {
    const std::uint64_t most = max_grid(in);
    refuse_vdb_budget(memory, others + most, most);
  };
  if (memory < others + vdb_grid_bytes({1, 1, 1}, 1, 8)) refuse();
  const auto grid =
      make_vdb_writer_if_built(info, name.empty() ? "density" : name, memory - others);
  const auto buffer = std::make_unique_for_overwrite<std::byte[]>(lattice.brick_bytes());
  progress.begin("export", static_cast<std::uint64_t>(volume(lattice.bricks_of(in.box).extent())) *
                               lattice.brick_bytes());
  try {
    for_each_stored_brick(in.store, in.level, in.box, progress, [&](Int3 brick) {
      const Box3 part = intersect(lattice.brick_box(brick), in.box);
      workers.execute([&] { read_slab(in.store, in.level, part, buffer.get()); });
      grid->put({part.lo - in.box.lo, part.hi - in.box.lo}, buffer.get());
    });
  } catch (const BudgetError&) {
    refuse();
  }
  progress.end();
  grid->write(output);
}

bool exists_unfollowed(const std::filesystem::path& path) {
  std::error_code none;
  return std::filesystem::exists(std::filesystem::symlink_status(path, none));
}

/// The header beside the samples of a raw file.
class DetachedHeader {
 public:
  /// `left`: a process was killed while it wrote the same output.
  DetachedHeader(const std::filesystem::path& raw, const VolumeInfo& info, bool force, bool left)
      : raw_(raw),
        force_(force),
        text_(nrrd_header_text(info, raw.filename().string())),
        file_(name_of(raw), force || is_left(left)) {
    file_.writer().append(text_);
  }

  /// Gives the header and the samples their names; what else may fail comes before. The header goes
  /// first, so that a killed process leaves no samples without one, unless it would describe older
  /// samples then.
  void publish_with(OutputFile& samples) {
    file_.writer().finish();
    std::error_code none;
    if (exists_unfollowed(raw_)) {
      if (force_) std::filesystem::remove(file_.path(), none);
      samples.publish();
      return file_.publish();
    }
    file_.publish();
    try {
      samples.publish();
    } catch (...) {
      std::filesystem::remove(file_.path(), none);
      throw;
    }
  }

  static std::string name_of(std::filesystem::path raw) {
    return raw.replace_extension(".nhdr").string();
  }

 private:
  /// Whether a header that is there is what a killed process left of this output: it comes before
  /// its samples.
  bool is_left(bool left) const {
    if (exists_unfollowed(raw_)) return false;
    try {
      return left || read_small_file(name_of(raw_), text_.size()) == text_;
    } catch (const Error&) {
      return false;  // larger, or no file
    }
  }

  std::filesystem::path raw_;
  bool force_;
  std::string text_;
  OutputFile file_;
};

/// Where dense samples go: pieces of any box into a file, or one after the other into a stream.
class DenseOutput {
 public:
  DenseOutput(OutputFile& output, Int3 extent, std::size_t sample_bytes)
      : output_(output), sample_bytes_(sample_bytes) {
    if (output.path() == kStandardOutput) return;
    output.writer().flush();
    file_.emplace(output.writer().share(), extent, sample_bytes, output.writer().size());
    file_->reserve();
  }

  /// Pieces of a stream follow each other in the order of its samples.
  bool is_stream() const { return !file_; }

  void write(Box3 box, const std::byte* samples) {
    if (file_) return file_->write(box, samples);
    const auto bytes = static_cast<std::size_t>(volume(box.extent())) * sample_bytes_;
    output_.writer().append(std::span(samples, bytes));
  }

 private:
  OutputFile& output_;
  std::size_t sample_bytes_;
  std::optional<SlabFile> file_;
};

/// The largest piece of whole rows, or of whole planes, that has no more samples than `piece`.
/// Bricks may be read more than once then; at worst a piece is a part of a row.
Int3 piece_in_order(Int3 extent, Int3 brick, Int3 piece) {
  const Index samples = volume(piece);
  if (const Index planes = samples / (extent.x * extent.y); planes > 0)
    return {extent.x, extent.y, planes >= brick.z ? planes / brick.z * brick.z : planes};
  if (const Index rows = samples / extent.x; rows > 0) return {extent.x, rows, 1};
  return {samples, 1, 1};
}

void export_dense(const Piece& in, Int3 piece, Workers& workers, OutputFile& output,
                  Progress& progress) {
  const Lattice& lattice = in.lattice();
  const Int3 extent = in.box.extent();
  DenseOutput out(output, extent, lattice.sample_bytes());
  // Planes of a stream begin where the box does; bricks are met where they are.
  const Int3 grid = out.is_stream() ? Int3{1, 1, 1} : lattice.brick;
  if (out.is_stream()) piece = piece_in_order(extent, lattice.brick, min(piece, extent));
  const auto buffer = std::make_unique_for_overwrite<std::byte[]>(
      static_cast<std::size_t>(volume(min(piece, extent))) * lattice.sample_bytes());
  progress.begin("export", static_cast<std::uint64_t>(volume(extent)) * lattice.sample_bytes());
  for_each_piece(in.box, grid, piece, [&](Box3 part) {
    workers.execute([&] { read_slab(in.store, in.level, part, buffer.get()); });
    out.write({part.lo - in.box.lo, part.hi - in.box.lo}, buffer.get());
    progress.advance(static_cast<std::uint64_t>(volume(part.extent())) * lattice.sample_bytes());
  });
  progress.end();
}

void check_is_not_input(const StoreReader& store, const std::filesystem::path& out) {
  const std::filesystem::path input = store.storage()->local_path();
  if (!input.empty()) check_replaces_no_input(out, {&input, 1});
}

std::uint64_t export_zip(const StoreReader& store, const std::filesystem::path& out,
                         const ExportOptions& options, Progress& progress) {
  if (options.level != 0 || options.roi || options.isovalue)
    throw UsageError("a zip holds the whole store: no level, region or isosurface of it");
  check_is_not_input(store, out);
  return write_zip(*store.storage(), out, {.force = options.force, .cancel = options.cancel},
                   progress);
}

}  // namespace

std::uint64_t export_volume(const StoreReader& reader, const std::filesystem::path& out,
                            const ExportOptions& options, Progress& listener) {
  CancellableProgress progress(listener, options.cancel);
  // OpenVDB has no 64-bit integers.
  const bool is_native = options.format != ExportFormat::vdb;
  const StoreReader native = reader.native();
  const StoreReader& store = is_native ? native : reader;
  if (options.format == ExportFormat::zip) return export_zip(store, out, options, progress);
  if (options.isovalue && options.format != ExportFormat::vdb)
    throw UsageError("a level set can only be written as an OpenVDB file");
  const bool streamed = out == kStandardOutput;
  if (streamed && options.format == ExportFormat::vdb)
    throw UsageError(
        "an OpenVDB file cannot go to standard output, because its beginning is written last: "
        "name a file, or add --format nrrd");
  const Box3 box = region(store, options.level, options.roi);
  const LevelInfo& level = store.info().levels[static_cast<std::size_t>(options.level)];
  VolumeInfo info = describe(level, box, out.string());
  check_is_not_input(store, out);
  bool left = !streamed && remove_leftovers(out.string());
  if (!streamed && options.format == ExportFormat::raw)
    left |= remove_leftovers(DetachedHeader::name_of(out));
  OutputFile output(out.string(), options.force);
  if (options.isovalue) {
    export_level_set(store, box, info, options, output, progress);
    output.publish();
    return output.writer().size();
  }
  info.fill_value = store.info().fill_value;
  info.grid_class = store.info().grid_class;
  info.grid_name = store.info().grid_name;
  Workers workers(options.threads);
  const Piece samples{store, options.level, box};
  if (options.format == ExportFormat::vdb) {
    export_vdb(samples, info, options.memory, workers, output, progress);
    output.publish();
    return output.writer().size();
  }
  const Int3 piece = piece_within(level.lattice, box.extent(), options.memory,
                                  fixed_bytes(store.info(), options.level, workers.threads()));
  std::optional<DetachedHeader> header;
  if (options.format == ExportFormat::nrrd)
    output.writer().append(nrrd_header_text(info));
  else if (!streamed)
    header.emplace(out, info, options.force, left);
  export_dense(samples, piece, workers, output, progress);
  output.writer().finish();
  const Publication turn;
  if (header)
    header->publish_with(output);
  else
    output.publish();
  // Samples of a file are written at their places, not appended.
  const auto samples_bytes =
      static_cast<std::uint64_t>(volume(box.extent())) * level.lattice.sample_bytes();
  return output.writer().size() + (streamed ? 0 : samples_bytes);
}

}  // namespace isobrick
