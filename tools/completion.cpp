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

/// For a shell's single quotes.
std::string single_quoted(const std::string& text) {
  return fmt::format("'{}'", replaced(text, "'", R"('\'')"));
}

// bash ------------------------------------------------------------------------

/// What may follow an option or stand at a place: "FILES", words, or nothing that is known.
std::string bash_words(const OptionView& option) {
  return option.path ? "FILES" : joined(option.choices);
}

/// A branch of `case "$command"`: the options (names of one with commas between), those that may be
/// repeated, those that need a value, and what each place takes; the last holds for further ones.
std::string bash_command(const CommandView& command) {
  std::vector<std::string> options, again, valued;
  std::string places;
  for (const OptionView& option : command.options) {
    options.push_back(fmt::format("{}", fmt::join(option.names, ",")));
    if (option.repeated) again.push_back(options.back());
    if (!option.value.empty() && !option.may_be_bare)
      valued.insert(valued.end(), option.names.begin(), option.names.end());
  }
  for (const OptionView& positional : command.positionals)
    places += single_quoted(bash_words(positional)) + ' ';
  if (command.positionals.empty() || !command.positionals.back().repeated) places += "''";
  return fmt::format("    {}) options='{}'; again='{}'; valued='{}'; places=({}) ;;\n",
                     command.name, joined(options), joined(again), joined(valued), places);
}

/// Branches of `case "$command $before"`: what the value of an option may be.
std::string bash_values(const CommandView& command) {
  std::string branches;
  for (const OptionView& option : command.options)
    for (const std::string& name : option.names)
      if (!option.value.empty())
        branches +=
            fmt::format("    '{} {}') value='{}' ;;\n", command.name, name, bash_words(option));
  return branches;
}

constexpr const char* kBashScript = R"(# bash completion for isobrick
_isobrick() {
  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} command=${COMP_WORDS[1]}
  local options='' again='' valued='' places=() value=NONE option name given place=0 i
  COMPREPLY=()
  if ((COMP_CWORD == 1)); then
    COMPREPLY=($(compgen -W '@COMMANDS@' -- "$word"))
    return
  fi
  case "$command" in
@OPTIONS@    *) return ;;
  esac
  case "$command $before" in
@VALUES@  esac
  if [[ $value == NONE && $word == -* ]]; then
    value=''
    for option in $options; do
      given=''
      for name in ${option//,/ }; do
        for ((i = 2; i < COMP_CWORD; ++i)); do
          if [[ ${COMP_WORDS[i]} == "$name" ]]; then given=1; fi
        done
      done
      if [[ -z $given || " $again " == *" $option "* ]]; then value+=" ${option//,/ }"; fi
    done
  elif [[ $value == NONE ]]; then
    for ((i = 2; i < COMP_CWORD; ++i)); do
      if [[ " $valued " == *" ${COMP_WORDS[i]} "* ]]; then
        ((++i))
      elif [[ ${COMP_WORDS[i]} != -?* ]]; then
        ((++place))
      fi
    done
    if ((place >= ${#places[@]})); then place=$((${#places[@]} - 1)); fi
    value=${places[place]}
  fi
  if [[ $value == FILES ]]; then
    COMPREPLY=($(compgen -f -- "$word"))
  else
    COMPREPLY=($(compgen -W "$value" -- "$word"))
  fi
}
complete -o filenames -F _isobrick isobrick
)";

std::string bash_completion(const CLI::App& program) {
  std::string options, values;
  for (const CommandView& command : subcommands_of(program)) {
    options += bash_command(command);
    values += bash_values(command);
  }
  std::string script = replaced(kBashScript, "@OPTIONS@", options);
  script = replaced(script, "@VALUES@", values);
  return replaced(script, "@COMMANDS@",
                  joined(command_names(program)) + ' ' + option_words(view_of(program)));
}

// zsh -------------------------------------------------------------------------

std::string zsh_message(const std::string& text) {
  std::string escaped = replaced(text, "[", "(");
  escaped = replaced(escaped, "]", ")");
  return replaced(escaped, ":", "\\:");
}

/// What follows an option or a positional: a choice, a file, or something to type.
std::string zsh_value(const OptionView& option) {
  const std::string message = zsh_message(option.path ? "file" : option.value);
  if (!option.choices.empty()) return fmt::format(":{}:({})", message, joined(option.choices));
  return fmt::format(":{}:{}", message, option.path ? "_files" : " ");
}

std::string zsh_option(const OptionView& option, const std::string& name) {
  const std::string value = option.value.empty() ? "" : zsh_value(option);
  const std::string times = option.repeated ? "*" : fmt::format("({})", joined(option.names));
  return single_quoted(fmt::format("{}{}[{}]{}{}", times, name, zsh_message(option.help),
                                   option.may_be_bare ? ":" : "", value));
}

std::string zsh_arguments(const CommandView& command) {
  std::string specs;
  for (const OptionView& option : command.options)
    for (const std::string& name : option.names)
      specs += " \\\n        " + zsh_option(option, name);
  for (const OptionView& positional : command.positionals)
    specs += " \\\n        " + single_quoted(fmt::format("{}{}", positional.repeated ? "*" : "",
                                                         zsh_value(positional)));
  return specs;
}

std::string zsh_completion(const CLI::App& program) {
  std::string list, cases;
  for (const CommandView& command : subcommands_of(program)) {
    list += "    " + single_quoted(command.name + ":" + zsh_message(command.description)) + "\n";
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
    text += name.starts_with("--") ? fmt::format(" -l {}", name.substr(2))
                                   : fmt::format(" -s {}", name.substr(1));
  return text;
}

std::string fish_option(const std::string& condition, const OptionView& option) {
  std::string line = fmt::format("complete -c isobrick -n {}{} -d {}", single_quoted(condition),
                                 fish_names(option), single_quoted(option.help));
  if (option.value.empty()) return line + "\n";
  line += option.path ? " -r -F" : " -x";
  if (!option.choices.empty()) line += " -a " + single_quoted(joined(option.choices));
  return line + "\n";
}

/// The words of the first place, and files only where a place takes them.
std::string fish_places(const CommandView& command, const std::string& inside) {
  std::string text;
  const auto& places = command.positionals;
  if (!places.empty() && !places[0].choices.empty())
    text += fmt::format("complete -c isobrick -f -n {} -a {}\n",
                        single_quoted(inside + "; and test (count (commandline -opc)) -eq 2"),
                        single_quoted(joined(places[0].choices)));
  if (places.empty() || !places.back().path)
    text += fmt::format("complete -c isobrick -f -n {}\n", single_quoted(inside));
  return text;
}

std::string fish_completion(const CLI::App& program) {
  std::string text = R"(# fish completion for isobrick
function __isobrick_command
  set -l words (commandline -opc)
  test (count $words) -ge 2; and test $words[2] = $argv[1]
end
)";
  const std::string first = "__fish_use_subcommand";
  for (const OptionView& option : view_of(program).options) text += fish_option(first, option);
  for (const CommandView& command : subcommands_of(program)) {
    text += fmt::format("complete -c isobrick -f -n {} -a {} -d {}\n", single_quoted(first),
                        command.name, single_quoted(command.description));
    const std::string inside = "__isobrick_command " + command.name;
    for (const OptionView& option : command.options) text += fish_option(inside, option);
    text += fish_places(command, inside);
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
  CLI::App* app = add_subcommand(
      program, "completion", "Print the completion script of a shell.",
      "source <(isobrick completion bash)   # in ~/.bashrc\n"
      "  mkdir -p ~/.zfunc && isobrick completion zsh > ~/.zfunc/_isobrick   # zsh: with "
      "fpath+=(~/.zfunc) before compinit\n"
      "  mkdir -p ~/.config/fish/completions && isobrick completion fish > "
      "~/.config/fish/completions/isobrick.fish");
  add_text(app, {"SHELL", "bash|zsh|fish", "Which shell", "", true},
           [shell](const std::string& text) { *shell = text; });
  program.commands.push_back({app, [shell, &program](Console& console) {
                                console.result_text("completion",
                                                    completion_for(*shell, program.app));
                                return 0;
                              }});
}

}  // namespace isobrick::tools
