#include <csignal>
#include <cstdio>
#include <memory>
#include <new>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "isobrick/core/error.h"
#include "isobrick/core/file_error.h"
#include "tools/console.h"
#include "tools/options.h"

namespace isobrick::tools {
namespace {

/// Help with defaults in brackets behind the description.
class HelpFormatter final : public CLI::Formatter {
 public:
  HelpFormatter() { column_width(30); }

  std::string make_option_opts(const CLI::Option* option) const override {
    if (option->get_type_size() == 0 || option->get_type_name().empty()) return "";
    return " " + option->get_type_name();
  }
  std::string make_option_desc(const CLI::Option* option) const override {
    std::string text = option->get_description();
    if (!option->get_default_str().empty()) text += " [" + option->get_default_str() + "]";
    if (option->get_required() && option->nonpositional()) text += " (required)";
    return text;
  }
};

void define(Program& program) {
  program.app.formatter(std::make_shared<HelpFormatter>());
  program.app.require_subcommand(1);
  program.app.set_version_flag("--version", "isobrick " ISOBRICK_VERSION,
                               "Print the version and exit");
  program.app.footer("Help on a subcommand: isobrick convert --help");
  add_convert(program);
  add_info(program);
  add_index(program);
  add_verify(program);
  add_extract(program);
  add_export(program);
  add_render(program);
  add_view(program);
  add_synth(program);
  add_completion(program);
  add_man(program);
}

const Command* parsed(const Program& program) {
  for (const Command& command : program.commands)
    if (command.app->parsed()) return &command;
  return nullptr;
}

std::string name_of(const Command* command) { return command ? command->app->get_name() : ""; }

/// What is wrong with a command line. A word that nobody knows comes first:
/// CLI11 would rather complain about what is missing.
std::string complaint(const Program& program, const CLI::ParseError& error) {
  const std::vector<std::string> unknown = program.app.remaining(true);
  return unknown.empty() ? error.what() : fmt::format("unknown argument '{}'", unknown.front());
}

/// Ends as the signal would have ended the process, so that shells see it.
int die_of(int signal) {
  std::signal(signal, SIG_DFL);
  std::raise(signal);
  return 1;
}

int run(Program& program, int argc, char** argv) {
  try {
    program.app.parse(argc, argv);
    set_up_signals();
    Console console(program.speech);
    return parsed(program)->run(console);
  } catch (const CLI::ParseError& error) {
    // --help and --version come this way too.
    if (error.get_exit_code() == 0) return program.app.exit(error);
    print_error(name_of(parsed(program)), complaint(program, error));
    return 2;
  } catch (const Interrupted& interrupted) {
    return die_of(interrupted.signal());
  } catch (const Cancelled&) {
    return die_of(interrupting_signal());
  } catch (const UsageError& error) {
    print_error(name_of(parsed(program)), error.what());
    return 2;
  } catch (const std::bad_alloc&) {
    print_error(name_of(parsed(program)), "out of memory; a smaller --memory may help");
    return 1;
  } catch (const std::exception& error) {
    print_error(name_of(parsed(program)), what_of(error));
    return 1;
  }
}

}  // namespace
}  // namespace isobrick::tools

int main(int argc, char** argv) {
  isobrick::tools::set_up_streams();
  CLI::App app("Isosurfaces of volumes larger than memory.", "isobrick");
  isobrick::tools::Program program{app, {}, {}};
  try {
    isobrick::tools::define(program);
  } catch (const std::exception& error) {
    isobrick::tools::print_error("", error.what());
    return 1;
  }
  return isobrick::tools::run(program, argc, argv);
}
