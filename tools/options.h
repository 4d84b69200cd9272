#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <isobrick/convert.h>
#include <isobrick/error.h>
#include <isobrick/index_choice.h>
#include <isobrick/isovalue.h>
#include "tools/console.h"
#include "tools/parse.h"

namespace CLI {
class App;  // CLI11 is slow to compile, so few files see it
}

namespace isobrick::tools {

/// A subcommand: its definition and what it does.
struct Command {
  CLI::App* app;
  std::function<int(Console&)> run;
};

/// The program: from its definitions come parsing, help, completions and the
/// man page.
struct Program {
  CLI::App& app;
  OutputMode mode;
  std::vector<Command> commands;
};

// One a file of this folder.
void add_convert(Program& program);
void add_info(Program& program);
void add_index(Program& program);
void add_verify(Program& program);
void add_extract(Program& program);
void add_merge(Program& program);
void add_export(Program& program);
void add_recode(Program& program);
void add_synth(Program& program);
void add_render(Program& program);
void add_view(Program& program);
void add_completion(Program& program);
void add_man(Program& program);
void add_help(Program& program);

/// A new subcommand with what all of them have: --json, --quiet, an example.
CLI::App* add_subcommand(Program& program, const std::string& name, const std::string& description,
                         const std::string& example);

/// What the subcommand does with its arguments, which the options fill.
template <class Arguments>
void add_run(Program& program, CLI::App* app, std::shared_ptr<Arguments> arguments,
             int (*run)(const Arguments&, Console&)) {
  program.commands.push_back(
      {app, [arguments, run](Console& console) { return run(*arguments, console); }});
}

/// How an option is called and explained.
struct OptionText {
  std::string name;   ///< "--dims", "-o,--output", or "OUT" for a positional
  std::string value;  ///< what its value is called; "a|b|c" lists the choices, PNG is a file
  std::string help;
  std::string fallback = {};  ///< what holds when it is left out
  bool required = false;
  bool may_be_bare = false;  ///< without a value it means the first of its choices
};

/// An option that hands the text of its value to `take`.
void add_text(CLI::App* app, const OptionText& option,
              std::function<void(const std::string&)> take);
/// One that may be given several times: `take` is called for each.
void add_repeated(CLI::App* app, const OptionText& option,
                  std::function<void(const std::string&)> take);
void add_flag(CLI::App* app, const std::string& name, bool& flag, const std::string& help);

/// An option whose text goes through `parse` (text → value) into `target`.
template <class T, class Parse>
void add_parsed(CLI::App* app, T& target, Parse parse, const OptionText& option) {
  add_text(app, option, [&target, parse](const std::string& text) { target = parse(text); });
}

/// A required positional path.
void add_path(CLI::App* app, const std::string& name, std::string& target, const std::string& help);

/// One or more of them.
void add_paths(CLI::App* app, const std::string& name, std::vector<std::string>& targets,
               const std::string& help);

void add_dims(CLI::App* app, std::optional<Int3>& dims, bool required = false);
void add_type(CLI::App* app, std::optional<ScalarType>& type, bool required = false);
void add_level(CLI::App* app, int& level);
/// The part of a volume that a command works on.
struct RegionArguments {
  std::optional<RoiText> roi;         ///< samples of the level
  std::optional<WorldRegion> region;  ///< world space
};
/// --roi and --region.
void add_region(CLI::App* app, RegionArguments& region);
/// --region alone.
void add_world_region(CLI::App* app, std::optional<WorldRegion>& region);
/// --memory, of which the default is a share of what this machine allows.
void add_memory(CLI::App* app, std::uint64_t& memory);
/// -o, for what `value` ("MESH") names.
void add_output(CLI::App* app, std::string& output, const char* value, const std::string& help,
                const std::string& fallback);
void add_threads(CLI::App* app, int& threads);
void add_force(CLI::App* app, bool& force);
/// -o and, for commands that read one input, a positional OUT that means the same.
void add_output_or_positional(CLI::App* app, std::string& output, const char* value,
                              const std::string& help, const std::string& fallback);
/// --isovalue, which may be repeated.
void add_isovalues(CLI::App* app, std::vector<IsovalueRequest>& isovalues, const std::string& help,
                   const std::string& fallback = {});
/// --search.
void add_search(CLI::App* app, IndexChoice& search);

/// --clip, up to kMaxClipPlanes times.
void add_clip(CLI::App* app, std::vector<HalfSpace>& planes);
/// --inside.
void add_inside(CLI::App* app, std::optional<Inside>& inside);
/// --channel and --time.
void add_selection(CLI::App* app, Selection& selection);

/// --codec. The other three must live as long as the program's definitions.
void add_codec(CLI::App* app, BrickCodec& codec, int& zstd_level, double& packed_factor,
               const std::string& fallback);

/// How a store is written: what `convert` and `synth` share.
void add_store_options(CLI::App* app, ConvertOptions& options);

/// From now on an interrupt is reported with what it leaves of a conversion to `output`.
void note_conversion(const std::string& output);

/// Reports a conversion by `command`; `notes` are its source's.
void report_conversion(Console& console, const std::string& command, const std::string& input,
                       const std::string& output, const VolumeInfo& volume,
                       const ConvertReport& report, const std::vector<std::string>& notes = {});

}  // namespace isobrick::tools
