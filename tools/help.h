#pragma once

#include <memory>

namespace CLI {
class FormatterBase;
}

namespace isobrick::tools {

/// Help with needed options in the usage line, and defaults in brackets behind the description.
std::shared_ptr<CLI::FormatterBase> help_formatter();

}  // namespace isobrick::tools
