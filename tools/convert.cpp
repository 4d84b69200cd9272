#include <isobrick/convert.h>

#include <algorithm>
#include <filesystem>
#include <memory>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/stopwatch.h"
#include "io/bytes/output_folder.h"
#include "io/bytes/url.h"
#include "pipeline/convert/convert_staging.h"
#include "pipeline/convert/store_source.h"
#include "tools/bucket_output.h"
#include "tools/input.h"
#include "tools/interrupt.h"
#include "tools/job.h"
#include "tools/output_name.h"

namespace isobrick::tools {
namespace {

struct ConvertArguments {
  std::string in, out;
  VolumeRequest volume;
  RegionArguments region;
  ConvertOptions store;
  CacheOptions cache;  ///< of an input behind a URL
  bool mpi = true;     ///< the ranks of a job share the work
};

/// Samples of a part that ranks share, as many as a unit of parts has. By the volume alone, so that
/// the next run finds the same parts.
constexpr std::uint64_t kPartSamples = std::uint64_t{512} * 512 * 512;
constexpr std::uint64_t kMostParts = 4096;

std::unique_ptr<VolumeSource> open_input(const ConvertArguments& arguments,
                                         const ConvertOptions& options, Console& console) {
  VolumeRequest volume = arguments.volume;
  volume.roi = arguments.region.roi;
  volume.region = arguments.region.region;
  volume.memory = options.memory;
  volume.threads = options.threads;
  return open_any_source(arguments.in, volume, remote_options(arguments.cache, console));
}

/// What the input's name means on the disk: of FILE:/NAME the file, of standard input nothing.
std::vector<std::filesystem::path> input_paths(const std::string& name) {
  std::error_code none;
  for (std::size_t end = name.size(); end != std::string::npos && end > 0;
       end = name.rfind(":/", end - 1))
    if (std::filesystem::exists(name.substr(0, end), none)) return {name.substr(0, end)};
  return {};
}

/// Standard input cannot be read again: where its length differs from the options, nothing
/// is kept for a resume.
ConvertReport convert_stream(VolumeSource& source, const std::string& out,
                             const ConvertOptions& options, Console& console) {
  namespace fs = std::filesystem;
  const fs::path partial = staging_path(out);
  const auto is_there = [&] { return fs::exists(fs::symlink_status(partial)); };
  const bool earlier = is_there();
  try {
    return convert(source, out, options, console.progress());
  } catch (const UsageError& error) {
    // Options and output are checked before the folder is made: this is about the samples.
    if (earlier || !is_there()) throw;
    OutputFolder(partial.has_parent_path() ? partial.parent_path() : ".").remove_folder(partial);
    const VolumeInfo& info = source.info();
    throw UsageError(fmt::format("{}; --dims {},{},{}, --type {} and --offset give their number",
                                 error.what(), info.extent.x, info.extent.y, info.extent.z,
                                 short_name(info.type)));
  }
}

/// The ranks make all parts, and the first one joins them.
ConvertReport convert_by_ranks(VolumeSource& source, const std::string& out, ConvertOptions options,
                               Ranks& job, Console& console) {
  const auto samples = static_cast<std::uint64_t>(volume(source.info().extent));
  const auto parts = static_cast<std::uint32_t>(
      std::clamp<std::uint64_t>((samples + kPartSamples - 1) / kPartSamples, 1, kMostParts));
  ConvertReport report;
  double seconds = 0;
  {
    const Stopwatch watch(seconds);
    deal(job, parts, [&](std::uint64_t i) {
      options.part = Part{static_cast<std::uint32_t>(i + 1), parts};
      convert(source, out, options, console.progress());
    });
    job.wait_for_all();
    options.part.reset();
    options.join = parts;
    if (job.rank() == 0) report = convert(source, out, options, console.progress());
    job.wait_for_all();
  }
  report.seconds = seconds;
  return report;
}

void note_downsampling(const VolumeSource& source, const ConvertOptions& options,
                       Console& console) {
  if (source.info().labels && options.downsampling && *options.downsampling == Downsampling::mean)
    console.note(
        "it is a label image, and --downsample mean makes labels of coarser levels that none of "
        "its samples has; mode, the default, does not");
}

/// By way of a temporary folder: nothing can be appended to an object.
int convert_to_bucket(const ConvertArguments& arguments, const std::string& out, Console& console) {
  ConvertOptions options = arguments.store;
  if (options.part || options.join > 0 || options.resume)
    throw UsageError(fmt::format(
        "'{}': --part, --join and --resume need a folder; convert to one and upload its store with "
        "the tools of the bucket",
        out));
  if (join_job(arguments.mpi, console) != nullptr)
    throw UsageError(fmt::format(
        "'{}': the ranks of a job write to a folder; convert to one, or with one process", out));
  BucketOutput bucket(out, options.force, options.memory);
  const auto source = open_input(arguments, options, console);
  note_downsampling(*source, options, console);
  set_interrupt_note([] { return "the same command with --force begins anew"; });
  const ConvertReport report = convert(*source, bucket.folder(), options, console.progress());
  bucket.upload(console.progress());
  report_conversion(console, "convert", arguments.in, out, source->info(), report, source->notes());
  return 0;
}

int run_convert(const ConvertArguments& arguments, Console& console) {
  const std::string out = arguments.out.empty()
                              ? stem_of_input(arguments.in, arguments.volume) + ".zarr"
                              : arguments.out;
  if (is_url(out)) return convert_to_bucket(arguments, out, console);
  check_store_name(out);
  ConvertOptions options = arguments.store;
  const bool is_whole = !options.part && options.join == 0;
  Ranks* const job = is_whole ? join_job(arguments.mpi, console) : nullptr;
  if (job != nullptr) share_machine(*job, options.memory, options.threads);
  const auto source = open_input(arguments, options, console);
  options.inputs = input_paths(arguments.in);
  if (options.part || job != nullptr)
    set_interrupt_note([] { return "the same command goes on with what is done"; });
  else
    note_conversion(out);
  note_downsampling(*source, options, console);
  const ConvertReport report =
      job != nullptr        ? convert_by_ranks(*source, out, options, *job, console)
      : arguments.in == "-" ? convert_stream(*source, out, options, console)
                            : convert(*source, out, options, console.progress());
  const std::string made =
      options.part ? fmt::format("{}.parts/{}of{}", out, options.part->number, options.part->count)
                   : out;
  report_conversion(console, "convert", arguments.in, made, source->info(), report,
                    source->notes());
  return 0;
}

}  // namespace

void add_convert(Program& program) {
  auto arguments = std::make_shared<ConvertArguments>();
  CLI::App* app = add_subcommand(
      program, "convert", "Turn a volume into a store, within a memory budget.",
      "isobrick convert head.raw --dims 64,64,93 --type i16 --spacing 3.2,3.2,1.5   # head.zarr\n"
      "  isobrick convert head_64x64x93_int16.raw ct.zarr   # extent and type are in the name");
  add_path(app, "INPUT", arguments->in,
           "Volume of a known format, FILE:/NAME for an array in it, folder of slices, Zarr, raw "
           "file, or - for raw samples on standard input");
  add_output_or_positional(
      app, arguments->out, "ZARR", "Store to write, such as OUT.zarr or s3://BUCKET/OUT.zarr",
      "head.zarr of head.nrrd, run_data.zarr of run.h5:/data, in the current folder");
  add_volume_options(app, arguments->volume);
  add_region(app, arguments->region);
  add_remote_cache(app, arguments->cache, "Where parts of an input behind a URL are kept");
  add_store_options(app, arguments->store);
  add_parsed(
      app, arguments->store.part,
      [](const std::string& text) { return std::optional(parse_part(text)); },
      {"--part", "I/N",
       "Convert only part I of N, beside the output in OUT.zarr.parts; what is whole there is "
       "kept"});
  add_parsed(app, arguments->store.join,
             [](const std::string& text) {
               return static_cast<std::uint32_t>(parse_int(text, 1, kMaxParts));
             },
             {"--join", "N", "Make the store of all N parts, which are there; reads no samples"});
  add_mpi(app, arguments->mpi);
  add_run(program, app, arguments, run_convert);
}

}  // namespace isobrick::tools
