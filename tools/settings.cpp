#include "tools/settings.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include <isobrick/error.h>
#include "core/file_error.h"
#include "tools/spelling.h"

namespace isobrick::tools {
namespace {

/// A key of a file, or a variable, with its values.
struct Setting {
  std::string command;  ///< empty: for all that have the option
  std::string name;     ///< of the option, without "--"
  std::vector<std::string> values;
  std::string origin;
};

/// Of "-o,--output" the name "output"; empty where an option has no long name.
std::string long_name(const OptionView& option) {
  for (const std::string& name : option.names)
    if (name.starts_with("--")) return name.substr(2);
  return {};
}

/// Options that only make sense where they are typed.
bool is_settable(const std::string& name) {
  return !name.empty() && name != "help" && name != "version" && name != "config";
}

/// Whether one of the words is the option: "--output", "--output=a.ply", "-o" or "-oa.ply".
bool is_typed(const OptionView& option, const std::vector<std::string>& words) {
  const auto is_it = [&](const std::string& word) {
    return std::any_of(option.names.begin(), option.names.end(), [&](const std::string& name) {
      const bool is_long = name.starts_with("--");
      return word == name || (is_long ? word.starts_with(name + '=') : word.starts_with(name));
    });
  };
  return std::any_of(words.begin(), words.end(), is_it);
}

bool parse_flag(const std::string& text, const std::string& origin) {
  for (const char* yes : {"true", "1", "on", "yes"})
    if (text == yes) return true;
  for (const char* no : {"false", "0", "off", "no", ""})
    if (text == no) return false;
  throw UsageError(fmt::format("{}: '{}' is neither true nor false", origin, text));
}

std::string variable_name(const std::string& option) {
  std::string name = "ISOBRICK_" + option;
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) {
    return c == '-' ? '_' : static_cast<char>(std::toupper(c));
  });
  return name;
}

std::vector<Setting> settings_of_environment(const CommandView& command) {
  std::vector<Setting> settings;
  for (const OptionView& option : command.options) {
    const std::string name = long_name(option), variable = variable_name(name);
    if (!is_settable(name)) continue;
    // An empty variable counts as none, as a shell leaves it.
    if (const char* value = std::getenv(variable.c_str()); value != nullptr && *value != '\0')
      settings.push_back({command.name, name, {value}, variable});
  }
  return settings;
}

std::optional<std::string> config_file(const std::vector<std::string>& words) {
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (words[i].starts_with("--config=")) return words[i].substr(9);
    if (words[i] == "--config" && i + 1 < words.size()) return words[i + 1];
  }
  const char* variable = std::getenv("ISOBRICK_CONFIG");
  if (variable == nullptr || *variable == '\0') return std::nullopt;
  return variable;
}

/// The texts of a setting's values. An option that takes one value may be given an array of parts:
/// dims = [64, 64, 93].
std::vector<std::string> values_of(const Setting& setting, const OptionView& option) {
  std::vector<std::string> values = setting.values;
  if (!option.repeated && values.size() > 1) values = {fmt::format("{}", fmt::join(values, ","))};
  for (const std::string& value : values)
    if (value.empty() && !option.value.empty())
      throw UsageError(
          fmt::format("--{}: a value is missing (from {})", setting.name, setting.origin));
  return values;
}

/// Whether the command line says more than a setting could: a name that is typed has its format.
bool is_outdone(const Setting& setting, const CommandView& command,
                const std::vector<std::string>& words) {
  const OptionView* output = find_option(command, "--output");
  return setting.name == "format" && output != nullptr && is_typed(*output, words);
}

/// Every key of a file must be an option of its command, or of some command.
void check_key(const Setting& setting, const std::vector<CommandView>& commands) {
  std::vector<std::string> known, names;
  for (const CommandView& command : commands) {
    names.push_back(command.name);
    if (!setting.command.empty() && command.name != setting.command) continue;
    for (const OptionView& option : command.options)
      if (is_settable(long_name(option))) known.push_back(long_name(option));
  }
  if (!setting.command.empty() &&
      std::find(names.begin(), names.end(), setting.command) == names.end())
    throw UsageError(fmt::format("'{}': [{}] is no subcommand", setting.origin, setting.command));
  if (std::find(known.begin(), known.end(), setting.name) != known.end()) return;
  const std::string nearest = nearest_word(setting.name, known);
  throw UsageError(
      fmt::format("'{}': unknown option '{}'{}", setting.origin, setting.name,
                  nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest)));
}

std::vector<Setting> settings_of_file(const std::string& path,
                                      const std::vector<CommandView>& commands) {
  std::ifstream file(path);
  if (!file) throw system_error("open", path, errno);
  std::error_code none;
  if (std::filesystem::is_directory(path, none))
    throw UsageError(fmt::format("'{}' is a folder; --config takes a file", path));
  std::vector<CLI::ConfigItem> items;
  try {
    items = CLI::ConfigTOML().from_config(file);
  } catch (const CLI::Error& error) {
    throw UsageError(fmt::format("'{}': {}", path, error.what()));
  }
  std::vector<Setting> settings;
  for (const CLI::ConfigItem& item : items) {
    if (item.name == "++" || item.name == "--") continue;  // a section begins or ends
    if (item.parents.size() > 1)
      throw UsageError(
          fmt::format("'{}': '{}' lies too deep; sections are subcommands", path, item.fullname()));
    settings.push_back(
        {item.parents.empty() ? "" : item.parents.front(), item.name, item.inputs, path});
    check_key(settings.back(), commands);
  }
  // A command's own section goes before what holds for all.
  std::stable_sort(settings.begin(), settings.end(), [](const Setting& a, const Setting& b) {
    return !a.command.empty() && b.command.empty();
  });
  return settings;
}

}  // namespace

Settings find_settings(const std::vector<CommandView>& commands, const CommandView& command,
                       const std::vector<std::string>& words) {
  std::vector<Setting> all = settings_of_environment(command);
  if (const auto file = config_file(words)) {
    std::vector<Setting> of_file = settings_of_file(*file, commands);
    all.insert(all.end(), of_file.begin(), of_file.end());
  }
  Settings found;
  // What these print is for shells and readers.
  for (const char* name : {"completion", "man", "help"})
    if (command.name == name) return found;
  for (const Setting& setting : all) {
    const std::string name = "--" + setting.name;
    const OptionView* option = find_option(command, name);
    const bool is_other = !setting.command.empty() && setting.command != command.name;
    if (is_other || option == nullptr || is_typed(*option, words) ||
        is_outdone(setting, command, words) || found.origins.contains(name))
      continue;
    found.origins[name] = setting.origin;
    for (const std::string& value : values_of(setting, *option)) {
      if (!option->value.empty())
        found.words.push_back(fmt::format("{}={}", name, value));
      else if (parse_flag(value, fmt::format("{}: {}", setting.origin, name)))
        found.words.push_back(name);
    }
  }
  return found;
}

std::string with_origin(const std::string& message,
                        const std::map<std::string, std::string>& origins) {
  const auto found = origins.find(message.substr(0, message.find(':')));
  if (found == origins.end()) return message;
  return fmt::format("{} (from {})", message, found->second);
}

}  // namespace isobrick::tools
