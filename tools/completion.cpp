#include <memory>

#include <fmt/format.h>

#include "tools/definitions.h"
#include "tools/options.h"

namespace isobrick::tools {
namespace {

std::string replaced(std::string text, std::string_view from, std::string_view to) {
  for (auto at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
  return text;
}

std::string joined(const std::vector<std::string>& words) {
  return fmt::format("{}", fmt::join(words, " "));
}

/// Names of all options, in a row.
std::string option_words(const CommandView& command) {
  std::vector<std::string> words;
  for (const OptionView& option : command.options)
    words.insert(words.end(), option.names.begin(), option.names.end());
  return joined(words);
}

std::string command_words(const CLI::App& program) {
  std::vector<std::string> words;
  for (const CommandView& command : subcommands_of(program)) words.push_back(command.name);
  return joined(words);
}

/// What a positional argument may be, where that is a choice of words.
std::string positional_words(const CommandView& command) {
  std::vector<std::string> words;
  for (const OptionView& positional : command.positionals)
    words.insert(words.end(), positional.choices.begin(), positional.choices.end());
  return joined(words);
}

/// For a shell's single quotes.
std::string quoted(const std::string& text) {
  return fmt::format("'{}'", replaced(text, "'", R"('\'')"));
}

// bash ------------------------------------------------------------------------

/// Branches of a bash `case "$command $before"` that offer an option's choices.
std::string bash_choices(const CommandView& command) {
  std::string branches;
  for (const OptionView& option : command.options)
    for (const std::string& name : option.names)
      if (!option.choices.empty())
        branches += fmt::format("    '{} {}') words='{}'; options=$words ;;\n", command.name, name,
                                joined(option.choices));
  return branches;
}

std::string bash_completion(const CLI::App& program) {
  std::string choices, options;
  for (const CommandView& command : subcommands_of(program)) {
    choices += bash_choices(command);
    options += fmt::format("    {}) options='{}'; words='{}' ;;\n", command.name,
                           option_words(command), positional_words(command));
  }
  return fmt::format(R"(# bash completion for isobrick
_isobrick() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}}
  local command=${{COMP_WORDS[1]}} options='' words=''
  COMPREPLY=()
  if ((COMP_CWORD == 1)); then
    COMPREPLY=($(compgen -W '{} {}' -- "$word"))
    return
  fi
  case "$command" in
{}  esac
  case "$command $before" in
{}  esac
  if [[ $word == -* ]]; then
    COMPREPLY=($(compgen -W "$options" -- "$word"))
  else
    COMPREPLY=($(compgen -W "$words" -- "$word") $(compgen -f -- "$word"))
  fi
}}
complete -o filenames -F _isobrick isobrick
)",
                     command_words(program), option_words(view_of(program)), options, choices);
}

// zsh -------------------------------------------------------------------------

std::string zsh_message(const std::string& text) {
  std::string escaped = replaced(text, "[", "(");
  escaped = replaced(escaped, "]", ")");
  return replaced(escaped, ":", "\\:");
}

/// What follows an option or a positional: nothing, a choice, or a file.
std::string zsh_value(const OptionView& option) {
  if (!option.choices.empty())
    return fmt::format(":{}:({})", zsh_message(option.value), joined(option.choices));
  return fmt::format(":{}:_files",
                     zsh_message(option.value.empty() ? option.names[0] : option.value));
}

std::string zsh_arguments(const CommandView& command) {
  std::string specs;
  for (const OptionView& option : command.options)
    for (const std::string& name : option.names)
      specs += " \\\n        " + quoted(fmt::format("*{}[{}]{}", name, zsh_message(option.help),
                                                    option.value.empty() ? "" : zsh_value(option)));
  for (const OptionView& positional : command.positionals)
    specs += " \\\n        " + quoted(zsh_value(positional));
  return specs;
}

std::string zsh_completion(const CLI::App& program) {
  std::string list, cases;
  for (const CommandView& command : subcommands_of(program)) {
    list += "    " + quoted(command.name + ":" + zsh_message(command.description)) + "\n";
    cases +=
        fmt::format("      {})\n        _arguments{} ;;\n", command.name, zsh_arguments(command));
  }
  return fmt::format(R"(#compdef isobrick
_isobrick() {{
  local -a commands
  commands=(
{}  )
  if ((CURRENT == 2)); then
    _describe command commands
    compadd -- {}
  else
    local command=$words[2]
    shift words
    ((CURRENT--))
    case $command in
{}    esac
  fi
}}
if [ "$funcstack[1]" = _isobrick ]; then
  _isobrick "$@"
else
  compdef _isobrick isobrick
fi
)",
                     list, option_words(view_of(program)), cases);
}

// fish ------------------------------------------------------------------------

std::string fish_names(const OptionView& option) {
  std::string text;
  for (const std::string& name : option.names)
    text += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
  return text;
}

std::string fish_option(const std::string& condition, const OptionView& option) {
  std::string line = fmt::format("complete -c isobrick -n {}{} -d {}", quoted(condition),
                                 fish_names(option), quoted(option.help));
  if (!option.value.empty()) line += " -r";
  if (!option.choices.empty()) line += " -f -a " + quoted(joined(option.choices));
  return line + "\n";
}

std::string fish_completion(const CLI::App& program) {
  std::string text = "# fish completion for isobrick\n";
  const std::string first = "__fish_use_subcommand";
  for (const OptionView& option : view_of(program).options) text += fish_option(first, option);
  for (const CommandView& command : subcommands_of(program)) {
    text += fmt::format("complete -c isobrick -f -n {} -a {} -d {}\n", quoted(first), command.name,
                        quoted(command.description));
    const std::string inside = "__fish_seen_subcommand_from " + command.name;
    for (const OptionView& option : command.options) text += fish_option(inside, option);
    const std::string words = positional_words(command);
    if (!words.empty())
      text += fmt::format("complete -c isobrick -n {} -a {}\n", quoted(inside), quoted(words));
  }
  return text;
}

std::string completion_for(const std::string& shell, const CLI::App& program) {
  if (shell == "bash") return bash_completion(program);
  if (shell == "zsh") return zsh_completion(program);
  if (shell == "fish") return fish_completion(program);
  throw UsageError(
      fmt::format("no completion for '{}'; there is one for bash, zsh and fish", shell));
}

}  // namespace

void add_completion(Program& program) {
  auto shell = std::make_shared<std::string>();
  CLI::App* app = add_subcommand(program, "completion", "Print the completion script of a shell.",
                                 "source <(isobrick completion bash)");
  add_text(app, {"SHELL", "bash|zsh|fish", "Which shell", "", true},
           [shell](const std::string& text) { *shell = text; });
  program.commands.push_back({app, [shell, &program](Console& console) {
                                console.result_text("completion",
                                                    completion_for(*shell, program.app));
                                return 0;
                              }});
}

}  // namespace isobrick::tools
