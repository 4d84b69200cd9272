#include "tools/options.h"

#include <fmt/format.h>

#include <filesystem>
#include <limits>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "bricks/ranges/index_layout.h"
#include "bricks/zarr/store_names.h"
#include "core/machine_memory.h"
#include "pipeline/convert/convert_staging.h"
#include "tools/codec_report.h"
#include "tools/format.h"
#include "tools/index_options.h"
#include "tools/interrupt.h"
#include "tools/job.h"

namespace isobrick::tools {

namespace {

/// Complaints about a value begin with the option's name. CLI11 takes the next word for a value
/// even where that is an option.
void take_named(const CLI::App* app, const std::string& name,
                const std::function<void(const std::string&)>& take, const std::string& text) {
  if (text.starts_with('-') && app->get_option_no_throw(text) != nullptr)
    throw UsageError(fmt::format("{}: a value is missing before '{}'", name, text));
  try {
    take(text);
  } catch (const UsageError& error) {
    throw UsageError(name + ": " + error.what());
  }
}

/// Of "-o,--output" the name that messages use.
std::string long_name(const std::string& names) { return names.substr(names.rfind(',') + 1); }

void describe(CLI::Option* option, const OptionText& text) {
  option->type_name(text.value)->required(text.required);
  if (!text.fallback.empty()) option->default_str(text.fallback);
  if (text.may_be_bare) option->expected(0, 1);
}

}  // namespace

CLI::App* add_subcommand(Program& program, const std::string& name, const std::string& description,
                         const std::string& example) {
  CLI::App* app = program.app.add_subcommand(name, description);
  app->footer("Example:\n  " + example);
  add_flag(app, "--json", program.mode.json, "Write the result as one JSON object");
  add_flag(app, "-q,--quiet", program.mode.quiet, "Write nothing but errors (and the JSON)");
  add_parsed(app, program.mode.progress, parse_progress,
             {"--progress", "auto|bar|lines|json|none",
              "Progress on standard error; auto: a bar on a terminal, elsewhere a line every 10 s",
              "auto"});
  // The words are read before CLI11 gets them.
  add_text(app,
           {"--config", "FILE", "Take options that are not given from this TOML file",
            "$ISOBRICK_CONFIG"},
           [](const std::string&) {});
  return app;
}

void add_text(CLI::App* app, const OptionText& option,
              std::function<void(const std::string&)> take) {
  const std::string name = long_name(option.name);
  describe(app->add_option_function<std::string>(
               option.name,
               [app, name, take](const std::string& text) { take_named(app, name, take, text); },
               option.help),
           option);
}

void add_repeated(CLI::App* app, const OptionText& option,
                  std::function<void(const std::string&)> take) {
  const std::string name = long_name(option.name);
  const auto take_all = [app, name, take](const std::vector<std::string>& texts) {
    for (const std::string& text : texts) take_named(app, name, take, text);
  };
  CLI::Option* added =
      app->add_option_function<std::vector<std::string>>(option.name, take_all, option.help);
  describe(added->allow_extra_args(false), option);
}

void add_flag(CLI::App* app, const std::string& name, bool& flag, const std::string& help) {
  app->add_flag(name, flag, help);
}

void add_path(CLI::App* app, const std::string& name, std::string& target,
              const std::string& help) {
  add_text(app, {name, "", help, "", true}, [&target](const std::string& text) { target = text; });
}

void add_paths(CLI::App* app, const std::string& name, std::vector<std::string>& targets,
               const std::string& help) {
  describe(app->add_option(name, targets, help)->expected(1, CLI::detail::expected_max_vector_size),
           {name, "", help, "", true});
}

void add_dims(CLI::App* app, std::optional<Int3>& dims, bool required) {
  add_parsed(app, dims, parse_dims, {"--dims", "X,Y,Z", "Samples along x, y and z", "", required});
}

void add_type(CLI::App* app, std::optional<ScalarType>& type, bool required) {
  add_parsed(app, type, parse_type,
             {"--type", "u8|i8|u16|i16|u32|i32|f32|f64|u64|i64", "Type of a sample", "", required});
}

void add_level(CLI::App* app, int& level) {
  add_parsed(app, level, [](const std::string& text) { return parse_int(text, 0, 64); },
             {"--level", "L", "Level of the pyramid, 0 the finest", "0"});
}

void add_region(CLI::App* app, RegionArguments& region) {
  add_parsed(app, region.roi, parse_roi,
             {"--roi", "X0:X1,Y0:Y1,Z0:Z1",
              "Only these samples of the level (of what --stride leaves), half-open; parts may be "
              "left out"});
  add_world_region(app, region.region);
}

void add_world_region(CLI::App* app, std::optional<WorldRegion>& region) {
  add_parsed(app, region,
             [](const std::string& text) { return std::optional(parse_world_region(text)); },
             {"--region", "X0:X1,Y0:Y1,Z0:Z1",
              "Only this box, world units; of samples the fewest that cover it"});
}

void add_memory(CLI::App* app, std::uint64_t& memory) {
  static const std::uint64_t fallback = default_memory_budget(allowed_memory());
  memory = fallback;
  add_parsed(app, memory, parse_bytes,
             {"--memory", "BYTES", "Budget of memory, such as 512M or 1.5G",
              "a quarter of what the machine or its control group allows"});
}

void add_output(CLI::App* app, std::string& output, const char* value, const std::string& help,
                const std::string& fallback) {
  add_text(app, {"-o,--output", value, help, fallback},
           [&output](const std::string& text) { output = text; });
}

void add_output_or_positional(CLI::App* app, std::string& output, const char* value,
                              const std::string& help, const std::string& fallback) {
  const auto take = [&output](const std::string& text) {
    if (!output.empty() && output != text)
      throw UsageError(fmt::format("two outputs, '{}' and '{}'", output, text));
    output = text;
  };
  add_text(app, {"OUT", "", help + "; the same as -o", fallback}, take);
  add_text(app, {"-o,--output", value, help, fallback}, take);
}

void add_isovalues(CLI::App* app, std::vector<IsovalueRequest>& isovalues, const std::string& help,
                   const std::string& fallback) {
  add_repeated(app,
               {"--isovalue", "V,...",
                help + "; a number, otsu, p99.5 (percentile), 50% (of the range), 300HU, ct-bone "
                       "and the like, FROM:TO:STEP; may be repeated",
                fallback},
               [&isovalues](const std::string& text) {
                 const std::vector<IsovalueRequest> more = parse_isovalues(text);
                 isovalues.insert(isovalues.end(), more.begin(), more.end());
                 if (isovalues.size() > kMaxIsovalues)
                   throw UsageError(fmt::format("{} isovalues at most", kMaxIsovalues));
               });
}

void add_search(CLI::App* app, IndexChoice& search) {
  add_parsed(app, search, parse_index_choice,
             {"--search", "auto|linear|interval|kdtree|quadtree|octree",
              "What finds active blocks: a stored index, or linear, all ranges; never shows in the "
              "surface",
              "auto"});
}

void add_threads(CLI::App* app, int& threads) {
  add_parsed(app, threads, [](const std::string& text) { return parse_int(text, 1, 4096); },
             {"-j,--threads", "N", "Worker threads", "all cores"});
}

void add_force(CLI::App* app, bool& force) {
  add_flag(app, "-f,--force", force, "Replace an output that exists, once the new one is whole");
}

void add_clip(CLI::App* app, std::vector<HalfSpace>& planes) {
  add_repeated(app,
               {"--clip", "NX,NY,NZ,D",
                fmt::format("Show only where NX*x + NY*y + NZ*z >= D, world units; up to {} times",
                            kMaxClipPlanes)},
               [&planes](const std::string& text) {
                 planes.push_back(parse_half_space(text));
                 if (planes.size() > kMaxClipPlanes)
                   throw UsageError(fmt::format("{} planes at most", kMaxClipPlanes));
               });
}

void add_inside(CLI::App* app, std::optional<Inside>& inside) {
  add_parsed(app, inside, [](const std::string& text) { return std::optional(parse_inside(text)); },
             {"--inside", "above|below",
              "Which samples the surface encloses: those of at least the isovalue, or those less "
              "than it",
              "below in a level set, else above"});
}

void add_selection(CLI::App* app, Selection& selection) {
  const auto place = [](const std::string& text) {
    return std::optional(parse_whole(text, 0, std::numeric_limits<Index>::max()));
  };
  add_parsed(app, selection.channel, place,
             {"--channel", "C", "Which channel of an input that has several, from 0"});
  add_parsed(app, selection.time, place,
             {"--time", "T", "Which time of an input that has several, from 0"});
}

void add_codec(CLI::App* app, BrickCodec& codec, int& zstd_level, double& packed_factor,
               const std::string& fallback) {
  add_text(
      app,
      {"--codec", "zstd:LEVEL|packed|none|auto:FACTOR",
       "Compression of bricks; packed: decoded many times faster, but by Isobrick alone; auto: "
       "packed where it takes at most FACTOR (1.1) times the bytes of zstd in some bricks",
       fallback},
      [&](const std::string& text) {
        const Compression compression = parse_codec(text);
        codec = compression.codec;
        zstd_level = compression.zstd_level;
        packed_factor = compression.packed_factor;
      });
}

void add_store_options(CLI::App* app, ConvertOptions& options) {
  add_parsed(app, options.brick, [](const std::string& text) { return parse_whole(text, 16, 256); },
             {"--brick", "N", "Samples along each edge of a brick, 16 to 256",
              "64; in thin volumes as many samples in longer bricks"});
  add_parsed(app, options.shard,
             [](const std::string& text) { return parse_whole(text, 16, 1 << 20); },
             {"--shard", "N", "Samples along each edge of a shard, cut to a multiple of the brick",
              "512; in thin volumes as many bricks in longer shards"});
  add_codec(app, options.codec, options.zstd_level, options.packed_factor, "zstd:3");
  add_parsed(app, options.levels, parse_levels,
             {"--levels", "auto|N", "Levels of the pyramid; auto: until one brick holds the last",
              "auto"});
  add_repeated(
      app,
      {"--factors", "FX,FY,FZ",
       "Samples along x, y and z, 1 or 2, that become one of the next level; given several "
       "times, of one step each, the last for all further ones",
       "by spacing, towards cubes"},
      [&options](const std::string& text) { options.factors.push_back(parse_dims(text)); });
  add_parsed(app, options.downsampling, parse_downsampling_name,
             {"--downsample", "mean|max|min|mode|stride",
              "What such samples become; mode suits labels", "mean, of a label image mode"});
  add_parsed(
      app, options.ome,
      [](const std::string& text) {
        if (text != "0.4" && text != "0.5")
          throw UsageError(fmt::format("unknown version '{}'; it is 0.4 or 0.5", text));
        return text == "0.4" ? OmeVersion::v04 : OmeVersion::v05;
      },
      {"--ome", "0.4|0.5",
       "Version of OME-Zarr; 0.4, with a file for each brick, for readers without Zarr 3", "0.5"});
  add_text(app,
           {"--build-index", "none|interval|kdtree|quadtree|octree|labels",
            "Also add a search structure, as 'isobrick index' does", "none"},
           [&options](const std::string& text) {
             options.label_lists = text == kLabelIndex;
             options.index.reset();
             if (text != "none" && !options.label_lists) options.index = parse_stored_kind(text);
           });
  add_leaf(app, options.leaf);
  add_memory(app, options.memory);
  add_threads(app, options.threads);
  add_flag(app, "--resume", options.resume, "Go on with an interrupted conversion of this input");
  add_force(app, options.force);
}

void note_conversion(const std::string& output) {
  set_interrupt_note([output]() -> std::string {
    const std::filesystem::path folder = staging_path(output);
    std::error_code none;
    if (!std::filesystem::exists(folder / kLayoutMarker, none))
      return "the same command begins anew";
    return fmt::format("what is done is in '{}': the same command with --resume goes on with it",
                       folder.string());
  });
}

void report_conversion(Console& console, const std::string& command, const std::string& input,
                       const std::string& output, const VolumeInfo& volume,
                       const ConvertReport& report, const std::vector<std::string>& notes) {
  const double ratio = report.bytes_out == 0 ? 0
                                             : static_cast<double>(report.bytes_in) /
                                                   static_cast<double>(report.bytes_out);
  const double rate =
      report.seconds > 0 ? static_cast<double>(report.bytes_in) / report.seconds : 0;
  nlohmann::ordered_json object{
      {"command", command},
      {"input", input},
      {"output", output},
      {"extent", to_json(volume.extent)},
      {"type", zarr_name(volume.type)},
      {"levels", report.levels},
      {"bricks",
       {{"total", report.bricks}, {"absent", report.bricks_absent}, {"kept", report.bricks_kept}}},
      {"bytes_in", report.bytes_in},
      {"bytes_out", report.bytes_out},
      {"index_bytes", report.index_bytes},
      {"ratio", ratio},
      {"codec", report.codec.empty() ? nlohmann::ordered_json(nullptr)
                                     : nlohmann::ordered_json(report.codec)},
      {"codec_sample", codec_sample_json(report.codec_sample)},
      {"seconds", report.seconds},
      {"index_seconds", report.index_seconds},
      {"notes", notes}};
  add_peak(joined_job(), object);
  std::string text = fmt::format("{}: {} samples of {}", output, human_extent(volume.extent),
                                 zarr_name(volume.type));
  if (report.levels > 0)  // a store and no raw file
    text += fmt::format(", {} level{}, {} brick{} ({} absent, {} kept)", report.levels,
                        report.levels == 1 ? "" : "s", human_count(report.bricks),
                        report.bricks == 1 ? "" : "s", human_count(report.bricks_absent),
                        human_count(report.bricks_kept));
  text += fmt::format("\n{} in, {} out ({:.2f} to 1) in {}, {}/s\n", human_bytes(report.bytes_in),
                      human_bytes(report.bytes_out), ratio, human_seconds(report.seconds),
                      human_bytes(rate));
  if (report.codec_sample)
    text += fmt::format("codec {}: {}\n", report.codec, codec_sample_text(*report.codec_sample));
  if (report.index_bytes > 0)
    text += fmt::format("of that {} for the index, in {}\n", human_bytes(report.index_bytes),
                        human_seconds(report.index_seconds));
  console.result(object, text);
  for (const std::string& note : notes) console.note(note);
}

}  // namespace isobrick::tools
