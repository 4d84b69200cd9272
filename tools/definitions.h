#pragma once

#include <string>
#include <vector>

#include "tools/options.h"

// Reads the program's definitions back, for the completions and the man page.
namespace isobrick::tools {

/// An option or a positional argument as it can be typed.
struct OptionView {
  std::vector<std::string> names;    ///< {"-o", "--output"}, or {"OUT"} for a positional
  std::string value;                 ///< what its value is called; empty for a flag
  std::vector<std::string> choices;  ///< the values it takes, when they are few
  std::string help;
  std::string fallback;  ///< what holds when it is left out
  bool required = false;
  bool may_be_bare = false;  ///< without a value it means the first of its choices
  bool takes_words = false;  ///< besides its choices it takes other words, of letters
  bool repeated = false;     ///< it may be given several times
  bool path = false;         ///< its value is a file or a folder
};

/// The program or one of its subcommands.
struct CommandView {
  std::string name, description, example;
  std::vector<OptionView> options, positionals;
};

CommandView view_of(const CLI::App& app);

/// The option that is called `name`, such as "--output" or "-o"; null where there is none.
const OptionView* find_option(const CommandView& command, const std::string& name);

/// What may be left out, as usage lines write it: "[TEXT]".
std::string in_brackets_if(bool optional, const std::string& text);

/// Names of the subcommands in the order of their definition.
std::vector<std::string> command_names(const CLI::App& app);

/// The subcommands in the order of their definition.
std::vector<CommandView> subcommands_of(const CLI::App& app);

}  // namespace isobrick::tools
