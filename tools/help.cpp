#include "tools/help.h"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "tools/definitions.h"
#include "tools/options.h"
#include "tools/spelling.h"

namespace isobrick::tools {
namespace {

class HelpFormatter final : public CLI::Formatter {
 public:
  HelpFormatter() { column_width(30); }

  std::string make_usage(const CLI::App* app, std::string name) const override {
    std::string line = "Usage: " + name;
    const CommandView command = view_of(*app);
    for (const OptionView& positional : command.positionals)
      line += ' ' + in_brackets_if(!positional.required,
                                   positional.names[0] + (positional.repeated ? "..." : ""));
    for (const OptionView& option : command.options)
      if (option.required) line += fmt::format(" {} {}", option.names[0], option.value);
    if (!app->get_subcommands({}).empty()) line += " SUBCOMMAND";
    return line + " [OPTIONS]\n";
  }
  std::string make_option_opts(const CLI::Option* option) const override {
    if (option->get_type_size() == 0 || option->get_type_name().empty()) return "";
    const bool may_be_bare = option->nonpositional() && option->get_expected_min() == 0;
    return ' ' + in_brackets_if(may_be_bare, option->get_type_name());
  }
  std::string make_option_desc(const CLI::Option* option) const override {
    std::string text = option->get_description();
    if (!option->get_default_str().empty()) text += " [" + option->get_default_str() + "]";
    if (option->get_required() && option->nonpositional()) text += " (required)";
    return text;
  }
};

std::string help_on(const std::string& name, const CLI::App& program) {
  if (name.empty())
    return program.get_formatter()->make_help(&program, program.get_name(),
                                              CLI::AppFormatMode::Normal);
  const auto commands =
      program.get_subcommands([&](const CLI::App* command) { return command->get_name() == name; });
  if (!commands.empty()) return commands.front()->help(program.get_name());
  const std::string nearest = nearest_word(name, command_names(program));
  throw UsageError(fmt::format(
      "unknown subcommand '{}'; {}", name,
      nearest.empty() ? "'isobrick help' lists them" : fmt::format("did you mean '{}'?", nearest)));
}

}  // namespace

std::shared_ptr<CLI::FormatterBase> help_formatter() { return std::make_shared<HelpFormatter>(); }

void add_help(Program& program) {
  auto name = std::make_shared<std::string>();
  CLI::App* app = add_subcommand(program, "help", "Print help on the program or a subcommand.",
                                 "isobrick help extract");
  add_text(app,
           {"COMMAND", fmt::format("{}", fmt::join(command_names(program.app), "|")),
            "Which subcommand; none: the program"},
           [name](const std::string& text) { *name = text; });
  program.commands.push_back({app, [name, &program](Console& console) {
                                console.result_text("help", help_on(*name, program.app));
                                return 0;
                              }});
}

}  // namespace isobrick::tools
