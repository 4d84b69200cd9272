#include "isobrick/pipeline/convert.h"

#include <memory>

#include "isobrick/io/open_source.h"
#include "tools/options.h"

namespace isobrick::tools {
namespace {

struct Arguments {
  std::string in, out;
  RawDescription raw;
  ConvertOptions store;
};

void add_raw_options(CLI::App* app, RawDescription& raw) {
  add_dims(app, raw.extent);
  add_type(app, raw.type);
  add_parsed(app, raw.order, parse_byte_order,
             {"--endian", "little|big", "Byte order of the samples", "little"});
  add_parsed(app, raw.offset, parse_offset,
             {"--offset", "BYTES", "Bytes before the first sample", "0"});
  add_parsed(app, raw.spacing, parse_vector,
             {"--spacing", "X,Y,Z", "World distance between samples", "1,1,1"});
  add_parsed(app, raw.origin, parse_vector,
             {"--origin", "X,Y,Z", "World position of the first sample", "0,0,0"});
  add_parsed(app, raw.unit, [](const std::string& text) { return text; },
             {"--unit", "NAME", "Unit of world space, such as micrometer"});
}

int run(const Arguments& arguments, Console& console) {
  const auto source = open_source(arguments.in, arguments.raw);
  const ConvertReport report = convert(*source, arguments.out, arguments.store, console.progress());
  report_conversion(console, "convert", arguments.in, arguments.out, source->info(), report);
  return 0;
}

}  // namespace

void add_convert(Program& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* app = add_subcommand(
      program, "convert", "Turn a volume into a store, within a memory budget.",
      "isobrick convert head.raw head.zarr --dims 64,64,93 --type i16 --spacing 3.2,3.2,1.5\n"
      "  isobrick convert engine_256x256x128_uint8.raw engine.zarr   # the name says it all");
  add_path(app, "IN", arguments->in, "Raw file, .nhdr or .mhd header, or - for standard input");
  add_path(app, "OUT", arguments->out, "Store to write, such as OUT.zarr");
  add_raw_options(app, arguments->raw);
  add_store_options(app, arguments->store);
  add_run(program, app, arguments, run);
}

}  // namespace isobrick::tools
