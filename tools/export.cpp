#include "isobrick/pipeline/export.h"

#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tools/format.h"
#include "tools/options.h"
#include "tools/store_region.h"

namespace isobrick::tools {
namespace {

struct Arguments {
  std::string store, out;
  std::optional<ExportFormat> format;  ///< nothing: by the name
  std::optional<RoiText> roi;
  Selection selection;
  ExportOptions options;
};

int run(const Arguments& arguments, Console& console) {
  const StoreReader store(arguments.store, arguments.selection);
  ExportOptions options = arguments.options;
  const Box3 box = store_region(store, options.level, arguments.roi);
  options.roi = box;
  const bool named_nrrd = extension_of(arguments.out) == ".nrrd";
  options.format = arguments.format.value_or(named_nrrd ? ExportFormat::nrrd : ExportFormat::raw);
  const std::uint64_t bytes = export_volume(store, arguments.out, options, console.progress());
  const ScalarType type = store.info().type;
  const nlohmann::ordered_json object{
      {"command", "export"},
      {"store", arguments.store},
      {"output", arguments.out},
      {"format", options.format == ExportFormat::nrrd ? "nrrd" : "raw"},
      {"level", options.level},
      {"extent", to_json(box.extent())},
      {"type", zarr_name(type)},
      {"bytes_out", bytes},
      {"peak_resident_bytes", peak_resident_bytes()}};
  console.result(object,
                 fmt::format("{}: {} samples of {}, little endian, {}\n", arguments.out,
                             human_extent(box.extent()), zarr_name(type), human_bytes(bytes)));
  return 0;
}

ExportFormat parse_format(const std::string& text) {
  if (text == "raw") return ExportFormat::raw;
  if (text == "nrrd") return ExportFormat::nrrd;
  throw UsageError(fmt::format("'{}' is no format of a volume; it is raw or nrrd", text));
}

}  // namespace

void add_export(Program& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* app =
      add_subcommand(program, "export", "Write the samples of a store as a file, bit for bit.",
                     "isobrick export head.zarr jaw.nrrd --roi :,:,0:40");
  add_path(app, "STORE", arguments->store, "Store to read");
  add_path(
      app, "OUT", arguments->out,
      "File to write: NRRD if it ends in .nrrd, raw otherwise; C order [z, y, x], little endian");
  add_parsed(app, arguments->format, parse_format,
             {"--format", "raw|nrrd",
              "Format of the file; NRRD keeps spacing, origin and direction", "by its extension"});
  add_level(app, arguments->options.level);
  add_roi(app, arguments->roi);
  add_selection(app, arguments->selection);
  add_memory(app, arguments->options.memory);
  add_threads(app, arguments->options.threads);
  add_force(app, arguments->options.force);
  add_run(program, app, arguments, run);
}

}  // namespace isobrick::tools
