#pragma once

#include <map>
#include <string>
#include <vector>

#include "tools/definitions.h"

namespace isobrick::tools {

/// Values of options that the command line leaves to a configuration file or the environment.
struct Settings {
  std::vector<std::string> words;              ///< "--memory=2G"
  std::map<std::string, std::string> origins;  ///< of each option: "ISOBRICK_MEMORY", "a.toml"
};

/// The settings of `command`, of which `words` were typed. A typed option goes before a variable
/// ISOBRICK_NAME, and that before the file of --config or ISOBRICK_CONFIG. The file is TOML: keys
/// are names of options, in the section of a command or, for all commands that have the option,
/// before the sections. Throws UsageError for a file that cannot be read, a key that no command
/// has, and a flag that is neither true nor false.
Settings find_settings(const std::vector<CommandView>& commands, const CommandView& command,
                       const std::vector<std::string>& words);

/// `message`, and where the option that it begins with comes from, where that is not typed.
std::string with_origin(const std::string& message,
                        const std::map<std::string, std::string>& origins);

}  // namespace isobrick::tools
