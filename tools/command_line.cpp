#include "tools/command_line.h"

#include <algorithm>
#include <cctype>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <isobrick/error.h>
#include "tools/definitions.h"
#include "tools/settings.h"
#include "tools/spelling.h"

namespace isobrick::tools {
namespace {

/// Whether a word behind an option that may be bare is its value.
bool is_value(const OptionView& option, const std::string& word) {
  const auto is_letter = [](unsigned char c) { return std::isalpha(c) != 0 || c >= 0x80; };
  return std::find(option.choices.begin(), option.choices.end(), word) != option.choices.end() ||
         (option.takes_words && !word.empty() && std::all_of(word.begin(), word.end(), is_letter));
}

/// Puts the values of options that may be bare behind "=".
std::vector<std::string> with_values(const CommandView& command,
                                     const std::vector<std::string>& words) {
  std::vector<std::string> all;
  for (std::size_t i = 0; i < words.size(); ++i) {
    all.push_back(words[i]);
    const OptionView* option = find_option(command, words[i]);
    if (option == nullptr || !option->may_be_bare) continue;
    const bool has_value = i + 1 < words.size() && is_value(*option, words[i + 1]);
    all.back() += '=' + (has_value ? words[++i] : option->choices.front());
  }
  return all;
}

/// Behind "--output=" CLI11 would take the next word for the value.
void check_values(const CommandView& command, const std::vector<std::string>& words) {
  for (const std::string& word : words) {
    if (word.size() < 2 || word.back() != '=') continue;
    const std::string name = word.substr(0, word.size() - 1);
    if (find_option(command, name) != nullptr)
      throw UsageError(fmt::format("{}: a value is missing", name));
  }
}

/// The subcommand of a command line, or the program.
const CLI::App& parsed_app(const CLI::App& program) {
  const auto parsed = program.get_subcommands();
  return parsed.empty() ? program : *parsed.front();
}

/// Where to read on.
std::string help_hint(const CLI::App& program, const CLI::App& app) {
  return fmt::format("see 'isobrick {}'", &app == &program ? "--help" : app.get_name() + " --help");
}

std::string unknown_word(const CLI::App& program, const std::string& word) {
  const CLI::App& app = parsed_app(program);
  const bool option = word.starts_with('-');
  std::vector<std::string> known;
  if (option)
    for (const OptionView& view : view_of(app).options)
      known.insert(known.end(), view.names.begin(), view.names.end());
  else if (&app == &program)
    known = command_names(program);
  const std::string nearest = nearest_word(word.substr(0, word.find('=')), known);
  const char* what = !option && &app == &program ? "subcommand" : "argument";
  return fmt::format(
      "unknown {} '{}'; {}", what, word,
      nearest.empty() ? help_hint(program, app) : fmt::format("did you mean '{}'?", nearest));
}

}  // namespace

void read_command_line(const CLI::App& program, int argc, char** argv, CommandLine& line) {
  std::vector<std::string>& words = line.words;
  words.assign(argv + std::min(argc, 1), argv + argc);
  line.json = std::find(words.begin(), words.end(), "--json") != words.end();
  if (words.empty()) words.emplace_back("help");
  const std::vector<CommandView> commands = subcommands_of(program);
  const auto command = std::find_if(commands.begin(), commands.end(), [&](const CommandView& view) {
    return view.name == words.front();
  });
  if (command != commands.end()) {
    words = with_values(*command, words);
    check_values(*command, words);
    Settings settings = find_settings(commands, *command, words);
    words.insert(words.begin() + 1, settings.words.begin(), settings.words.end());
    line.origins = std::move(settings.origins);
    line.json = std::find(words.begin(), words.end(), "--json") != words.end();
  }
  std::reverse(words.begin(), words.end());
}

// A word that nobody knows comes first: CLI11 would rather complain about what is missing.
std::string complaint(const Program& program, const CLI::ParseError& error) {
  const std::vector<std::string> unknown = program.app.remaining(true);
  if (!unknown.empty()) return unknown_word(program.app, unknown.front());
  return fmt::format("{}; {}", error.what(), help_hint(program.app, parsed_app(program.app)));
}

}  // namespace isobrick::tools
