#pragma once

#include <exception>
#include <iostream>

namespace isobrick::bench {

/// What main() returns: run(argc, argv); or 1 where that throws, whose message goes to stderr
/// behind the program's name.
inline int guarded_main(const char* name, int (*run)(int, char**), int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& e) {
    std::cerr << name << ": " << e.what() << '\n';
    return 1;
  }
}

}  // namespace isobrick::bench
