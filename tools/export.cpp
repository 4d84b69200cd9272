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
  int level = 0;
  std::optional<RoiText> roi;
  bool force = false;
  std::uint64_t memory = std::uint64_t{1} << 30;
  int threads = 0;
};

int run(const Arguments& arguments, Console& console) {
  const StoreReader store(arguments.store);
  const Box3 box = store_region(store, arguments.level, arguments.roi);
  const std::uint64_t bytes =
      export_raw(store, arguments.level, box, arguments.out, arguments.force, arguments.memory,
                 arguments.threads, console.progress());
  const ScalarType type = store.info().type;
  const nlohmann::ordered_json object{{"command", "export"},
                                      {"store", arguments.store},
                                      {"output", arguments.out},
                                      {"level", arguments.level},
                                      {"extent", to_json(box.extent())},
                                      {"type", zarr_name(type)},
                                      {"bytes_out", bytes},
                                      {"peak_resident_bytes", peak_resident_bytes()}};
  console.result(object,
                 fmt::format("{}: {} samples of {}, little endian, {}\n", arguments.out,
                             human_extent(box.extent()), zarr_name(type), human_bytes(bytes)));
  return 0;
}

}  // namespace

void add_export(Program& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* app =
      add_subcommand(program, "export", "Write the samples of a store as a raw file, bit for bit.",
                     "isobrick export head.zarr jaw.raw --roi :,:,0:40");
  add_path(app, "STORE", arguments->store, "Store to read");
  add_path(app, "OUT", arguments->out, "Raw file to write: C order [z, y, x], little endian");
  add_level(app, arguments->level);
  add_roi(app, arguments->roi);
  add_memory(app, arguments->memory);
  add_threads(app, arguments->threads);
  add_force(app, arguments->force);
  add_run(program, app, arguments, run);
}

}  // namespace isobrick::tools
