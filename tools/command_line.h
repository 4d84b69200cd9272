#pragma once

#include <map>
#include <string>
#include <vector>

#include "tools/options.h"

namespace CLI {
class ParseError;
}

namespace isobrick::tools {

/// A command line as CLI11 takes it.
struct CommandLine {
  std::vector<std::string> words;              ///< the last first
  std::map<std::string, std::string> origins;  ///< of options that were not typed (Settings)
  bool json = false;                           ///< whether --json is among them
};

/// The words that were typed, with settings (find_settings()) added. An option that may be bare has
/// its value behind "=": CLI11 would take whatever follows for one. No words mean "help". Throws
/// what find_settings() does; `line.json` is set before.
void read_command_line(const CLI::App& program, int argc, char** argv, CommandLine& line);

/// What is wrong with a command line, and what to type next.
std::string complaint(const Program& program, const CLI::ParseError& error);

}  // namespace isobrick::tools
