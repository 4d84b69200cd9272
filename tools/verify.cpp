#include <isobrick/verify.h>

#include <memory>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "tools/format.h"
#include "tools/interrupt.h"
#include "tools/open_store.h"
#include "tools/options.h"

namespace isobrick::tools {
namespace {

struct VerifyArguments {
  std::string store;
  Selection selection;
  std::uint64_t memory = std::uint64_t{1} << 30;
  int threads = 0;
};

/// ", octree and quadtree indices", after the bricks.
std::string indexes_text(const VerifyReport& report) {
  std::set<std::string> kinds;
  for (const VerifyReport::Index& index : report.indexes) kinds.insert(index.kind);
  if (kinds.empty()) return "";
  return fmt::format(", {} {}", fmt::join(kinds, " and "), kinds.size() == 1 ? "index" : "indices");
}

std::string text_of(const std::string& store, const VerifyReport& report) {
  std::string text;
  for (const std::string& damage : report.damages) text += damage + '\n';
  if (report.damage_count > report.damages.size())
    text +=
        fmt::format("... and {} more\n", human_count(report.damage_count - report.damages.size()));
  if (report.damage_count == 0)
    text += fmt::format("{} is whole: {} bricks{}, {} read\n", store, human_count(report.bricks),
                        indexes_text(report), human_bytes(report.bytes));
  return text;
}

nlohmann::ordered_json indexes_json(const VerifyReport& report) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const VerifyReport::Index& index : report.indexes)
    list.push_back({{"level", index.level}, {"kind", index.kind}});
  return list;
}

int run_verify(const VerifyArguments& arguments, Console& console) {
  check_store(arguments.store);
  set_interrupt_note([] { return "nobody knows whether the store is whole"; });
  const VerifyReport report = verify(
      arguments.store,
      {.threads = arguments.threads, .selection = arguments.selection, .memory = arguments.memory},
      console.progress());
  const nlohmann::ordered_json object{{"command", "verify"},
                                      {"input", arguments.store},
                                      {"whole", report.damage_count == 0},
                                      {"bricks", report.bricks},
                                      {"bytes_read", report.bytes},
                                      {"indexes", indexes_json(report)},
                                      {"damage_count", report.damage_count},
                                      {"damages", report.damages},
                                      {"peak_resident_bytes", peak_resident_bytes()}};
  console.result(object, text_of(arguments.store, report));
  if (report.damage_count == 0) return 0;
  throw DamageError(fmt::format("'{}' is damaged or cannot be looked at in {} place{}",
                                arguments.store, human_count(report.damage_count),
                                report.damage_count == 1 ? "" : "s"));
}

}  // namespace

void add_verify(Program& program) {
  auto arguments = std::make_shared<VerifyArguments>();
  CLI::App* app = add_subcommand(program, "verify",
                                 "Read all of a store; check every checksum, range and size.",
                                 "isobrick verify head.zarr");
  add_path(
      app, "STORE", arguments->store,
      "Store to check, also in a zip; levels of more than 2,097,152 chunk files are not looked at");
  add_selection(app, arguments->selection);
  add_memory(app, arguments->memory);
  add_threads(app, arguments->threads);
  add_run(program, app, arguments, run_verify);
}

}  // namespace isobrick::tools
