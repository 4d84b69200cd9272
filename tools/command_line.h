#pragma once

#include <string>
#include <vector>

#include "tools/options.h"

namespace CLI {
class ParseError;
}

namespace isobrick::tools {

/// The words of a command line, the last first, as CLI11 takes them. An option that may be bare
/// has its value behind "=": CLI11 would take whatever follows for one. No words mean "help".
std::vector<std::string> words_to_parse(const CLI::App& program, int argc, char** argv);

/// What is wrong with a command line, and what to type next.
std::string complaint(const Program& program, const CLI::ParseError& error);

}  // namespace isobrick::tools
