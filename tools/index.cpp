#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <isobrick/index_build.h>
#include "tools/format.h"
#include "tools/index_options.h"
#include "tools/interrupt.h"
#include "tools/open_store.h"

namespace isobrick::tools {
namespace {

struct IndexArguments {
  std::string store;
  IndexOptions index;
};

std::uint64_t total(const IndexReport& report) {
  std::uint64_t bytes = 0;
  for (const std::uint64_t of_level : report.level_bytes) bytes += of_level;
  return bytes;
}

std::string text_of(const IndexArguments& arguments, const IndexReport& report) {
  const std::size_t levels = report.level_bytes.size();
  std::string text = fmt::format("{}: {} index with leaf {} of {} level{}, {} in {}",
                                 arguments.store, name_of(arguments.index.kind),
                                 arguments.index.leaf, levels, levels == 1 ? "" : "s",
                                 human_bytes(total(report)), human_seconds(report.seconds));
  if (report.chunks_kept > 0)
    text += fmt::format(" ({} of {} files kept)", human_count(report.chunks_kept),
                        human_count(report.chunks));
  if (report.ranges_added)
    text += fmt::format("\nranges computed first, in {}", human_seconds(report.range_seconds));
  return text + '\n';
}

int run_index(const IndexArguments& arguments, Console& console) {
  check_store(arguments.store);
  set_interrupt_note([] { return "the same command with --resume goes on with what is done"; });
  const IndexReport report = add_index(arguments.store, arguments.index, console.progress());
  const nlohmann::ordered_json object{
      {"command", "index"},
      {"input", arguments.store},
      {"kind", name_of(arguments.index.kind)},
      {"leaf", arguments.index.leaf},
      {"bytes", total(report)},
      {"level_bytes", report.level_bytes},
      {"files", {{"total", report.chunks}, {"kept", report.chunks_kept}}},
      {"ranges_added", report.ranges_added},
      {"seconds", {{"total", report.seconds}, {"ranges", report.range_seconds}}},
      {"peak_resident_bytes", peak_resident_bytes()}};
  console.result(object, text_of(arguments, report));
  return 0;
}

}  // namespace

void add_index(Program& program) {
  auto arguments = std::make_shared<IndexArguments>();
  CLI::App* app = add_subcommand(
      program, "index",
      "Add a search structure to a store, and the ranges of samples that another program's image "
      "lacks.",
      "isobrick index head.zarr --kind octree");
  add_path(app, "STORE", arguments->store,
           "Store to add to, or another program's Zarr image or array");
  add_parsed(app, arguments->index.kind, parse_stored_kind,
             {"--kind", "interval|kdtree|quadtree|octree", "Which structure", "octree"});
  add_selection(app, arguments->index.selection);
  add_leaf(app, arguments->index.leaf);
  add_memory(app, arguments->index.memory);
  add_threads(app, arguments->index.threads);
  add_flag(app, "--resume", arguments->index.resume, "Go on with an interrupted build");
  add_flag(app, "-f,--force", arguments->index.force,
           "Replace an index of this kind, once the new one is whole, and compute the ranges of "
           "another program's image anew");
  program.commands.push_back(
      {app, [arguments](Console& console) { return run_index(*arguments, console); }});
}

}  // namespace isobrick::tools
