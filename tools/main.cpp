#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>

#include <CLI/CLI.hpp>

#include <isobrick/error.h>
#include "core/file_error.h"
#include "tools/command_line.h"
#include "tools/console.h"
#include "tools/help.h"
#include "tools/interrupt.h"
#include "tools/options.h"

namespace isobrick::tools {
namespace {

void define(Program& program) {
  program.app.formatter(help_formatter());
  program.app.require_subcommand(1);
  program.app.set_version_flag("--version", "isobrick " ISOBRICK_VERSION,
                               "Print the version and exit");
  program.app.footer("Help on a subcommand: isobrick help convert");
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
  add_help(program);
}

const Command* parsed(const Program& program) {
  for (const Command& command : program.commands)
    if (command.app->parsed()) return &command;
  return nullptr;
}

std::string name_of(const Command* command) { return command ? command->app->get_name() : ""; }

int die_of(int signal) {
  end_by_signal(signal);
  return 1;
}

std::terminate_handler g_usual_end = nullptr;

/// Where memory is short even destructors of libraries throw, or give up without an exception: that
/// ends the program with a line.
[[noreturn]] void end_at_once() {
  const std::exception_ptr thrown = std::current_exception();
  try {
    if (thrown) std::rethrow_exception(thrown);
    print_error("", "a library ended the program; memory may be short: try a smaller --memory");
    ::_exit(1);
  } catch (const std::bad_alloc&) {
    print_out_of_memory("");
    ::_exit(1);
  } catch (...) {
  }
  g_usual_end();
  std::abort();
}

int run(Program& program, int argc, char** argv) {
  try {
    program.app.parse(words_to_parse(program.app, argc, argv));
    set_up_signals(name_of(parsed(program)));
    Console console(program.mode);
    const int status = parsed(program)->run(console);
    end_interrupts();
    return status;
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
    print_out_of_memory(name_of(parsed(program)));
    return 1;
  } catch (const std::exception& error) {
    print_error(name_of(parsed(program)), error_message(error));
    return 1;
  }
}

int run_program(int argc, char** argv) {
  set_up_streams();
  CLI::App app("Isosurfaces of volumes larger than memory.", "isobrick");
  Program program{app, {}, {}};
  define(program);
  return run(program, argc, argv);
}

}  // namespace
}  // namespace isobrick::tools

int main(int argc, char** argv) {
  isobrick::tools::g_usual_end = std::set_terminate(isobrick::tools::end_at_once);
  try {
    return isobrick::tools::run_program(argc, argv);
  } catch (const std::bad_alloc&) {  // also while an error was being reported
    isobrick::tools::print_out_of_memory("");
    return 1;
  } catch (const std::exception& error) {
    isobrick::tools::print_error("", error.what());
    return 1;
  }
}
