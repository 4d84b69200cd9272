#include <isobrick/synth_source.h>

#include <algorithm>
#include <memory>
#include <span>

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <isobrick/error.h>
#include "core/stopwatch.h"
#include "io/bytes/output_file.h"
#include "tools/format.h"
#include "tools/mesh_space.h"
#include "tools/options.h"
#include "tools/output_name.h"

namespace isobrick::tools {
namespace {

struct SynthArguments {
  SynthOptions synth;
  std::optional<Int3> dims;
  std::optional<ScalarType> type;
  std::string out;
  ConvertOptions store;
};

SynthKind parse_kind(const std::string& text) {
  if (const auto kind = parse_synth_kind(text)) return *kind;
  throw UsageError(fmt::format(
      "unknown kind '{}'; the kinds are sphere, gyroid, marschner-lobb, mixing and cells", text));
}

/// Computes `box` into `out`, a few rows a task.
void compute(VolumeSource& source, Box3 box, std::byte* out) {
  constexpr Index rows_per_task = 16;
  const Int3 extent = box.extent();
  const std::size_t row_bytes = static_cast<std::size_t>(extent.x) * size_of(source.info().type);
  const Index groups = ceil_div(extent.y, rows_per_task);
  tbb::parallel_for(Index{0}, groups * extent.z, [&](Index task) {
    const Index y = task % groups * rows_per_task, z = task / groups;
    Box3 rows = box;
    rows.lo = box.lo + Int3{0, y, z};
    rows.hi.y = std::min(box.hi.y, rows.lo.y + rows_per_task);
    rows.hi.z = rows.lo.z + 1;
    source.read(rows, out + static_cast<std::size_t>(z * extent.y + y) * row_bytes);
  });
}

/// Rows of one plane, or whole planes, that fit `bytes`; at least one row.
Int3 piece_extent(Int3 extent, std::size_t sample_bytes, std::uint64_t bytes) {
  const auto budget = static_cast<Index>(bytes / sample_bytes);
  const Index rows = std::clamp<Index>(budget / extent.x, 1, extent.y);
  const Index planes =
      rows < extent.y ? 1 : std::clamp<Index>(budget / (extent.x * extent.y), 1, extent.z);
  return {extent.x, rows, planes};
}

/// A field takes hours to compute: that its disk is too small is known before.
void check_space(const std::string& path, std::uint64_t bytes) {
  const std::uint64_t free = free_space(path);
  if (free < bytes)
    throw Error(
        fmt::format("'{}' takes {}, and its disk has {} free: choose another, or smaller "
                    "--dims",
                    path, human_bytes(bytes), human_bytes(free)));
}

ConvertReport write_raw(VolumeSource& source, const std::string& path,
                        const ConvertOptions& options, Progress& progress) {
  if (options.resume) throw UsageError("--resume is for stores; a raw file is written anew");
  if (options.index || options.label_lists)
    throw UsageError("--build-index is for stores; a raw file has no index");
  const Int3 extent = source.info().extent;
  const std::size_t sample_bytes = size_of(source.info().type);
  const Int3 piece = piece_extent(extent, sample_bytes,
                                  std::min<std::uint64_t>(options.memory, std::uint64_t{1} << 26));
  check_space(path, static_cast<std::uint64_t>(volume(extent)) * sample_bytes);
  std::vector<std::byte> samples(static_cast<std::size_t>(volume(piece)) * sample_bytes);
  OutputFile out(path, options.force);
  Stopwatch watch;
  progress.begin("write", static_cast<std::uint64_t>(volume(extent)) * sample_bytes);
  tbb::task_arena arena(options.threads > 0 ? options.threads : tbb::task_arena::automatic);
  for_each_point({{0, 0, 0}, ceil_div(extent, piece)}, [&](Int3 p) {
    const Box3 box = intersect({p * piece, (p + Int3{1, 1, 1}) * piece}, {{0, 0, 0}, extent});
    const std::size_t bytes = static_cast<std::size_t>(volume(box.extent())) * sample_bytes;
    arena.execute([&] { compute(source, box, samples.data()); });
    out.writer().append(std::span(samples).first(bytes));
    progress.advance(bytes);
  });
  progress.end();
  out.publish();
  ConvertReport report;
  report.bytes_in = report.bytes_out = out.writer().size();
  report.seconds = watch.lap();
  return report;
}

int run_synth(const SynthArguments& arguments, Console& console) {
  SynthOptions synth = arguments.synth;
  synth.extent = *arguments.dims;
  synth.type = *arguments.type;
  const auto source = make_synth(synth);
  const ConvertOptions& options = arguments.store;
  const std::string out =
      arguments.out.empty() ? std::string(name_of(synth.kind)) + ".zarr" : arguments.out;
  const bool raw = extension_of(out) == ".raw";
  if (!raw) {
    check_store_name(out);
    note_conversion(out);
  }
  const ConvertReport report = raw ? write_raw(*source, out, options, console.progress())
                                   : convert(*source, out, options, console.progress());
  report_conversion(console, "synth", std::string(name_of(synth.kind)), out, source->info(),
                    report);
  return 0;
}

}  // namespace

void add_synth(Program& program) {
  auto arguments = std::make_shared<SynthArguments>();
  CLI::App* app = add_subcommand(program, "synth",
                                 "Make a procedural volume of any size, the same on every machine.",
                                 "isobrick synth gyroid gyroid.zarr --dims 256,256,256 --type u8");
  add_text(app,
           {"KIND", "sphere|gyroid|marschner-lobb|mixing|cells",
            "Which field; cells is a label image", "", true},
           [&kind = arguments->synth.kind](const std::string& text) { kind = parse_kind(text); });
  add_output_or_positional(app, arguments->out, "ZARR",
                           "Store to write, or a raw file if it ends in .raw",
                           "gyroid.zarr and so on");
  add_dims(app, arguments->dims, true);
  add_type(app, arguments->type, true);
  add_parsed(app, arguments->synth.seed, parse_offset,
             {"--seed", "N", "Of the random numbers", "1"});
  add_parsed(app, arguments->synth.frequency, parse_number,
             {"--frequency", "F", "Periods, largest eddies or cells along the longest edge",
              "2 of gyroid, 6 of mixing, 5 of cells"});
  add_parsed(app, arguments->synth.noise, parse_number,
             {"--noise", "A", "Amplitude of the gyroid's noise, as a part of the field's", "0.01"});
  add_store_options(app, arguments->store);
  add_run(program, app, arguments, run_synth);
}

}  // namespace isobrick::tools
