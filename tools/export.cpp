#include <isobrick/export.h>

#include <array>
#include <filesystem>
#include <memory>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "bricks/zarr/metadata_files.h"
#include "io/bytes/output_guard.h"
#include "tools/bucket_output.h"
#include "tools/format.h"
#include "tools/input.h"
#include "tools/isovalues.h"
#include "tools/output_name.h"
#include "tools/parse.h"
#include "tools/store_region.h"
#include "tools/value_range.h"

namespace isobrick::tools {
namespace {

struct ExportArguments {
  InputArguments input;
  std::string out;
  std::optional<ExportFormat> format;  ///< nothing: by the name
  std::vector<IsovalueRequest> isovalues;
  RegionArguments region;
  std::optional<int> half_band;
  ExportOptions options;
};

struct NamedFormat {
  std::string_view word;
  ExportFormat format;
  std::vector<std::string_view> extensions;
};

const std::vector<NamedFormat>& formats() {
  static const std::vector<NamedFormat> all{{"raw", ExportFormat::raw, {".raw", ".bin", ""}},
                                            {"nrrd", ExportFormat::nrrd, {".nrrd"}},
                                            {"vdb", ExportFormat::vdb, {".vdb"}},
                                            {"zip", ExportFormat::zip, {".zip", ".ozx"}}};
  return all;
}

std::string_view name_of(ExportFormat format) {
  return formats()[static_cast<std::size_t>(format)].word;
}

/// By the option or the name, which must not contradict each other.
ExportFormat format_of(const std::string& path, std::optional<ExportFormat> option) {
  if (option) {
    const NamedFormat& format = formats()[static_cast<std::size_t>(*option)];
    refuse_misleading_name(path, format.extensions,
                           fmt::format("--format {} writes another format", format.word));
    return *option;
  }
  const std::string extension = extension_of(path);
  for (const NamedFormat& format : formats())
    for (const std::string_view known : format.extensions)
      if (extension == known) return format.format;
  throw UsageError(
      fmt::format("'{}' is no volume that can be written; name it .nrrd, .vdb, .raw or .bin (raw "
                  "samples with a .nhdr beside them), .zip for the whole store, or add --format",
                  path));
}

/// The name where none is given: by the format, which is OpenVDB for a level set, else NRRD.
std::string default_output(const ExportArguments& arguments) {
  const ExportFormat format = arguments.format.value_or(
      arguments.isovalues.empty() ? ExportFormat::nrrd : ExportFormat::vdb);
  return stem_of_input(arguments.input.path, arguments.input.volume) +
         std::string(formats()[static_cast<std::size_t>(format)].extensions.front());
}

void check(const ExportArguments& arguments) {
  if (arguments.half_band && arguments.isovalues.empty())
    throw UsageError("--half-band is the width of a level set: add its --isovalue");
  if (arguments.options.inside && arguments.isovalues.empty())
    throw UsageError("--inside is a side of an isosurface: add its --isovalue");
  if (arguments.isovalues.size() > 1)
    throw UsageError("a level set has one isosurface; give one --isovalue");
}

int run_export(const ExportArguments& arguments, Console& console) {
  check(arguments);
  std::string out = arguments.out.empty() ? default_output(arguments) : arguments.out;
  ExportOptions options = arguments.options;
  options.format = format_of(out, arguments.format);
  if (is_standard_output(out)) console.reserve_output();
  std::optional<BucketFile> bucket;
  if (is_url(out)) {
    bucket.emplace(out, options.force, options.memory);
    out = bucket->path().string();
  }
  const std::array<std::filesystem::path, 1> inputs{arguments.input.path};
  check_replaces_no_input(out, inputs);
  if (!is_zarr(arguments.input.path)) check_can_write(out, options.force);
  const OpenedVolume input = open_input(arguments.input, options.memory, options.threads, console,
                                        !arguments.isovalues.empty());
  const StoreReader& store = input.store();
  const Box3 box = store_region(store, options.level, arguments.region);
  if (options.format != ExportFormat::zip || arguments.region.roi || arguments.region.region)
    options.roi = box;
  if (!arguments.isovalues.empty())
    options.isovalue = resolve_isovalues(arguments.isovalues, store, console).front();
  options.half_band = arguments.half_band.value_or(options.half_band);
  const std::uint64_t bytes = export_volume(store, out, options, console.progress());
  if (bucket) {
    bucket->upload(console.progress());
    out = arguments.out;
  }
  if (options.isovalue)
    if (const std::string why = why_out_of_range(store, options.level, *options.isovalue);
        !why.empty())
      console.note(why);
  // OpenVDB has no 64-bit integers.
  const ScalarType type =
      options.format == ExportFormat::vdb ? store.info().type : store.info().stored_type;
  nlohmann::ordered_json object{{"command", "export"},
                                {"input", arguments.input.path},
                                {"output", out},
                                {"format", name_of(options.format)},
                                {"level", options.level},
                                {"extent", to_json(box.extent())},
                                {"type", zarr_name(type)},
                                {"bytes_out", bytes},
                                {"peak_resident_bytes", peak_resident_bytes()}};
  if (options.isovalue) {
    object["isovalue"] = *options.isovalue;
    object["half_band"] = options.half_band;
  }
  const std::string what =
      options.format == ExportFormat::zip ? std::string("the store")
      : options.isovalue
          ? fmt::format("level set of isovalue {} over {} samples", *options.isovalue,
                        human_extent(box.extent()))
          : fmt::format("{} samples of {}{}", human_extent(box.extent()), zarr_name(type),
                        options.format == ExportFormat::vdb ? "" : ", little endian");
  console.result(object, fmt::format("{}: {}, {}\n", out, what, human_bytes(bytes)));
  return 0;
}

ExportFormat parse_format(const std::string& text) {
  for (const NamedFormat& format : formats())
    if (text == format.word) return format.format;
  throw UsageError(fmt::format("'{}' is no format of a volume; it is raw, nrrd, vdb or zip", text));
}

}  // namespace

void add_export(Program& program) {
  auto arguments = std::make_shared<ExportArguments>();
  CLI::App* app = add_subcommand(
      program, "export",
      "Write the samples of a volume as a file, or its isosurface as an OpenVDB level set.",
      "isobrick export head.zarr jaw.nrrd --roi :,:,0:40\n"
      "  isobrick export head.zarr skull.vdb --isovalue 1150");
  add_input(app, arguments->input);
  add_output_or_positional(
      app, arguments->out, "VOLUME",
      "File to write: NRRD if it ends in .nrrd, OpenVDB if in .vdb; raw if in .raw, .bin or "
      "nothing (C order [z, y, x], little endian), with a header .nhdr beside it; the whole store "
      "if in .zip; - for raw samples, NRRD or a zip on standard output; also s3://BUCKET/NAME.nrrd "
      "and so on",
      "head.nrrd of head.zarr, or head.vdb with --isovalue");
  add_parsed(app, arguments->format, parse_format,
             {"--format", "raw|nrrd|vdb|zip",
              "Format of the file; NRRD and OpenVDB keep spacing, origin and direction",
              "by its extension"});
  add_isovalues(app, arguments->isovalues,
                "OpenVDB only: write a level set of this isosurface, negative inside, in place of "
                "the samples");
  add_parsed(app, arguments->half_band,
             [](const std::string& text) { return parse_int(text, 1, kWidestHalfBand); },
             {"--half-band", "N", "Voxels with distances on either side of a level set", "3"});
  add_inside(app, arguments->options.inside);
  add_level(app, arguments->options.level);
  add_region(app, arguments->region);
  add_memory(app, arguments->options.memory);
  add_threads(app, arguments->options.threads);
  add_force(app, arguments->options.force);
  add_run(program, app, arguments, run_export);
}

}  // namespace isobrick::tools
