#include "tools/definitions.h"

#include <algorithm>

#include <CLI/CLI.hpp>

namespace isobrick::tools {
namespace {

constexpr const char* kCapitals = "ABCDEFGHIJKLMNOPQRSTUVWXYZ";

/// "a|b:LEVEL|N" → {"a", "b"}: words in capitals stand for something to fill in and are no choices.
std::vector<std::string> choices_in(const std::string& type) {
  std::vector<std::string> choices;
  if (type.find('|') == std::string::npos) return choices;
  for (const std::string& part : CLI::detail::split(type, '|')) {
    const std::string word = part.substr(0, part.find(':'));
    if (word.find_first_of(kCapitals) == std::string::npos) choices.push_back(word);
  }
  return choices;
}

/// Whether a value of this name is a file or a folder.
bool is_path(const std::string& value) {
  return value == "MESH" || value == "PNG" || value == "DIR" || value == "FILE" ||
         value == "ZARR" || value == "VOLUME";
}

OptionView option_view_of(const CLI::Option& option) {
  OptionView view;
  for (const std::string& name : option.get_snames()) view.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) view.names.push_back("--" + name);
  if (option.get_positional()) view.names = {option.get_name(true)};
  if (option.get_type_size() != 0) view.value = option.get_type_name();
  const std::string type = option.get_type_name();
  view.choices = choices_in(type);
  view.takes_words = static_cast<std::size_t>(std::count(type.begin(), type.end(), '|')) + 1 >
                     std::max<std::size_t>(view.choices.size(), 1);
  view.help = option.get_description();
  view.fallback = option.get_default_str();
  view.required = option.get_required();
  const bool positional = option.get_positional();
  view.may_be_bare = !positional && view.choices.size() > 1 && option.get_expected_min() == 0;
  view.repeated = option.get_items_expected_max() > 1;
  view.path = positional ? view.choices.empty() : is_path(view.value);
  return view;
}

std::vector<OptionView> views_of(const CLI::App& app, bool positional) {
  std::vector<OptionView> views;
  for (const CLI::Option* option : app.get_options())
    if (option->get_positional() == positional) views.push_back(option_view_of(*option));
  return views;
}

}  // namespace

const OptionView* find_option(const CommandView& command, const std::string& name) {
  for (const OptionView& option : command.options)
    if (std::find(option.names.begin(), option.names.end(), name) != option.names.end())
      return &option;
  return nullptr;
}

std::string in_brackets_if(bool optional, const std::string& text) {
  return optional ? '[' + text + ']' : text;
}

CommandView view_of(const CLI::App& app) {
  const std::string footer = app.get_footer();  // "Example:" and a line
  return {app.get_name(), app.get_description(),
          CLI::detail::trim_copy(
              CLI::detail::find_and_replace(footer.substr(footer.find('\n') + 1), "\n  ", "\n")),
          views_of(app, false), views_of(app, true)};
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(command->get_name());
  return names;
}

std::vector<CommandView> subcommands_of(const CLI::App& app) {
  std::vector<CommandView> views;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    views.push_back(view_of(*command));
  return views;
}

}  // namespace isobrick::tools
