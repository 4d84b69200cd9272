#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <isobrick/scalar.h>
#include <isobrick/vec.h>

namespace isobrick::test {

/// How a process ended and what it wrote.
struct Outcome {
  int exit_code = -1;  ///< -1: a signal ended it
  int signal = 0;
  std::string out, err;
  std::uint64_t peak_bytes = 0;     ///< most of its memory that was resident, as the kernel counts
  double seconds_since_signal = 0;  ///< from `interrupt_after` to the end
};

/// How to run a process, where that is unusual.
struct Surroundings {
  std::filesystem::path input = "/dev/null";  ///< standard input
  std::filesystem::path output = {};          ///< standard output; empty: captured
  bool terminal = false;                      ///< standard error is a terminal
  long file_blocks = 0;                       ///< no file may grow beyond these × 512 bytes
  double interrupt_after = 0;                 ///< seconds until the signal
  int interrupt_by = 2;                       ///< SIGINT
};

using Arguments = std::vector<std::string>;

/// Whether the program was built with what compresses GLB.
#ifdef ISOBRICK_WITH_MESHOPT
inline constexpr bool kCanCompress = true;
#else
inline constexpr bool kCanCompress = false;
#endif

/// Whether the system has a program of this name.
bool available(const std::string& program);
/// Whether it has pseudo terminals: a container may lack /dev/pts.
bool has_terminals();

Outcome run_process(const Arguments& words, const Surroundings& surroundings = {});

std::string read_file(const std::filesystem::path& path);
void write_file(const std::filesystem::path& path, const std::string& bytes);

/// Samples that look random, the same on every run.
std::string noise(std::size_t bytes, std::uint32_t seed = 1);

/// A test in a folder of its own, which goes when the test ends.
class ProgramTest : public testing::Test {
 protected:
  ProgramTest();
  ~ProgramTest() override;

  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  std::vector<std::string> files() const;  ///< names in the folder, sorted

  /// Runs isobrick.
  static Outcome run(const Arguments& arguments, const Surroundings& surroundings = {});
  /// Runs it with --json, expects success and one object on standard output.
  static nlohmann::json run_json(Arguments arguments, const Surroundings& surroundings = {});

  /// Makes NAME.zarr of smooth samples, extent 40 x 36 x 33, bricks of 16.
  std::string make_store(const std::string& name, const Arguments& more = {});

 private:
  std::filesystem::path folder_;
};

/// Exit code as given, nothing on standard output, one line on standard error
/// that has all of `parts`.
void expect_refused(const Outcome& outcome, int exit_code,
                    std::initializer_list<std::string> parts);

}  // namespace isobrick::test
