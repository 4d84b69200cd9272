#include <fmt/format.h>

#include "tools/definitions.h"
#include "tools/options.h"

namespace isobrick::tools {
namespace {

/// Text as roff takes it: no control line, no escape, hyphens that can be copied.
std::string roff(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '\\')
      escaped += "\\e";
    else if (c == '-')
      escaped += "\\-";
    else
      escaped += c;
  }
  if (escaped.starts_with('.') || escaped.starts_with('\'')) escaped.insert(0, "\\&");
  return escaped;
}

std::string bold(const std::string& text) { return fmt::format("\\fB{}\\fR", roff(text)); }
std::string italic(const std::string& text) { return fmt::format("\\fI{}\\fR", roff(text)); }

std::string entry(const std::string& head, const OptionView& option) {
  std::string text = ".TP\n" + head + "\n" + roff(option.help) + ".";
  if (option.required && option.names[0].starts_with('-')) text += " Required.";
  if (!option.fallback.empty()) text += " Default: " + roff(option.fallback) + ".";
  return text + "\n";
}

std::string option_entry(const OptionView& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.names) names.push_back(bold(name));
  std::string head = fmt::format("{}", fmt::join(names, ", "));
  if (!option.value.empty()) head += ' ' + in_brackets_if(option.may_be_bare, italic(option.value));
  return entry(head, option);
}

std::string synopsis(const CommandView& command) {
  std::string line = bold("isobrick " + command.name);
  for (const OptionView& positional : command.positionals)
    line += ' ' + in_brackets_if(!positional.required, italic(positional.names[0])) +
            (positional.repeated ? " ..." : "");
  for (const OptionView& option : command.options)
    if (option.required)
      line += fmt::format(" {} {}", bold(option.names.back()), italic(option.value));
  return fmt::format("{} [{}]", line, italic("options"));
}

std::string command_section(const CommandView& command) {
  std::string text = ".SS " + command.name + "\n" + synopsis(command) + "\n.PP\n" +
                     roff(command.description) + "\n";
  for (const OptionView& positional : command.positionals)
    text += entry(italic(positional.names[0]), positional);
  for (const OptionView& option : command.options) text += option_entry(option);
  text += ".PP\nExample:\n.PP\n.nf\n.RS\n" + roff(command.example) + "\n.RE\n.fi\n";
  return text;
}

std::string man_page(const CLI::App& program) {
  std::string text = fmt::format(".TH ISOBRICK 1 \"\" \"isobrick {}\" \"User Commands\"\n.ad l\n",
                                 ISOBRICK_VERSION);
  text += ".SH NAME\nisobrick \\- isosurfaces of volumes larger than memory\n.SH SYNOPSIS\n";
  for (const CommandView& command : subcommands_of(program)) text += synopsis(command) + "\n.br\n";
  text +=
      ".SH DESCRIPTION\n" +
      roff(
          "isobrick cuts a volume into bricks, keeps them in a store (an OME-Zarr image) with the "
          "range of every brick, and extracts isosurfaces as triangle meshes while reading only "
          "the "
          "bricks that the surface touches. A mesh has no cracks between bricks; it is open where "
          "the surface leaves the volume or the region. Memory stays within a budget, whatever the "
          "volume's size.") +
      "\n";
  text += ".SH OPTIONS\n";
  for (const OptionView& option : view_of(program).options) text += option_entry(option);
  text += ".SH COMMANDS\n";
  for (const CommandView& command : subcommands_of(program)) text += command_section(command);
  text += R"(.SH EXIT STATUS
.TP
.B 0
Success.
.TP
.B 1
The command failed: a file cannot be read or written, a store is damaged, memory or disk ran out.
.TP
.B 2
The request makes no sense: an unknown option, a wrong size for the dimensions, an output that exists.
.PP
Either failure writes one line to standard error. Except for the damages that
.B verify
lists, nothing goes to standard output then. An output appears under its name only when it is whole;
SIGINT and SIGTERM end a command within a second, with a line that names the way to go on.
What an interrupted
.B convert
leaves under a name that ends in .partial serves
.BR \-\-resume .
)";
  return text;
}

}  // namespace

void add_man(Program& program) {
  CLI::App* app = add_subcommand(program, "man", "Print the man page.", "isobrick man | man -l -");
  program.commands.push_back({app, [&program](Console& console) {
                                console.result_text("man", man_page(program.app));
                                return 0;
                              }});
}

}  // namespace isobrick::tools
