#include <isobrick/recode.h>

#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "bricks/zarr/label_metadata.h"
#include "tools/open_store.h"
#include "tools/options.h"
#include "tools/output_name.h"

namespace isobrick::tools {
namespace {

struct RecodeArguments {
  std::string in, out;
  RecodeOptions options;
};

/// NAME_packed.zarr, or as the codec is called.
std::string default_output(const RecodeArguments& arguments) {
  constexpr const char* kWords[] = {"plain", "zstd", "packed", "auto"};
  return fmt::format("{}_{}.zarr", stem_of_input(arguments.in),
                     kWords[static_cast<int>(arguments.options.codec)]);
}

/// What recode() leaves out.
std::vector<std::string> notes_of(const StoreReader& store) {
  const std::vector<std::string> labels = label_image_names(*store.storage());
  if (labels.empty()) return {};
  return {fmt::format("its label image{} {} {} not copied: recode each by itself",
                      labels.size() == 1 ? "" : "s", fmt::join(labels, ", "),
                      labels.size() == 1 ? "was" : "were")};
}

int run_recode(const RecodeArguments& arguments, Console& console) {
  const std::string out = arguments.out.empty() ? default_output(arguments) : arguments.out;
  check_store_name(out);
  const StoreReader store = open_store(arguments.in);
  note_conversion(out);
  const ConvertReport report = recode(store, out, arguments.options, console.progress());
  VolumeInfo volume;
  volume.extent = store.info().levels.front().lattice.extent;
  volume.type = store.info().stored_type;
  report_conversion(console, "recode", arguments.in, out, volume, report, notes_of(store));
  return 0;
}

}  // namespace

void add_recode(Program& program) {
  auto arguments = std::make_shared<RecodeArguments>();
  RecodeOptions& options = arguments->options;
  CLI::App* app = add_subcommand(
      program, "recode",
      "Write a store once more with another codec; samples, ranges and indices stay as they are.",
      "isobrick recode head.zarr fast.zarr --codec packed");
  add_path(app, "INPUT", arguments->in, "Store: a folder, a zip of one, or the URL of either");
  add_output_or_positional(app, arguments->out, "ZARR", "Store to write, such as OUT.zarr",
                           "head_packed.zarr of head.zarr, in the current folder");
  add_codec(app, options.codec, options.zstd_level, options.packed_factor, "auto");
  add_memory(app, options.memory);
  add_threads(app, options.threads);
  add_flag(app, "--resume", options.resume, "Go on with an interrupted run on this input");
  add_force(app, options.force);
  add_run(program, app, arguments, run_recode);
}

}  // namespace isobrick::tools
