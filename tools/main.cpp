#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>
#include <optional>

#include <CLI/CLI.hpp>

#include <isobrick/error.h>
#include "core/file_error.h"
#include "tools/command_line.h"
#include "tools/console.h"
#include "tools/help.h"
#include "tools/interrupt.h"
#include "tools/job.h"
#include "tools/options.h"
#include "tools/settings.h"

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
  add_merge(program);
  add_export(program);
  add_recode(program);
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

int die_of(int signal, const Program& program, const CommandLine& line) {
  if (line.json) print_error_json(name_of(parsed(program)), "interrupted", 128 + signal);
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

/// Reports a failure on standard error and, with --json, on standard output, too.
int report_failure(const Program& program, const CommandLine& line, const std::string& what,
                   int exit_code) {
  const std::string command = name_of(parsed(program));
  const std::string message = with_origin(what, line.origins);
  print_error(command, message);
  if (line.json) print_error_json(command, message, exit_code);
  return exit_code;
}

int run_parsed(Program& program, CommandLine& line) {
  std::optional<Console> console;
  const auto fail = [&](const std::string& what, int exit_code) {
    line.json = line.json && !(console && console->wrote_object());
    if (joined_job())
      end_job(exit_code, [&](const std::string& prefix) {
        report_failure(program, line, prefix + what, exit_code);
      });
    return report_failure(program, line, what, exit_code);
  };
  try {
    program.app.parse(std::move(line.words));
    set_up_signals(name_of(parsed(program)));
    console.emplace(program.mode);
    const int status = parsed(program)->run(*console);
    leave_job();
    end_interrupts();
    return status;
  } catch (const CLI::ParseError& error) {
    // --help and --version come this way too.
    if (error.get_exit_code() == 0) return program.app.exit(error);
    return fail(complaint(program, error), 2);
  } catch (const Interrupted& interrupted) {
    return die_of(interrupted.signal(), program, line);
  } catch (const Cancelled&) {
    return die_of(interrupting_signal(), program, line);
  } catch (const UsageError& error) {
    return fail(error.what(), 2);
  } catch (const std::bad_alloc&) {
    if (joined_job()) return fail("out of memory; a smaller --memory may help", 1);
    print_out_of_memory(name_of(parsed(program)));
    if (line.json) print_error_json(name_of(parsed(program)), "out of memory", 1);
    return 1;
  } catch (const std::exception& error) {
    return fail(error_message(error), 1);
  }
}

int run(Program& program, int argc, char** argv) {
  CommandLine line;
  try {
    read_command_line(program.app, argc, argv, line);
  } catch (const UsageError& error) {
    return report_failure(program, line, error.what(), 2);
  } catch (const Error& error) {
    return report_failure(program, line, error_message(error), 1);
  }
  return run_parsed(program, line);
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
