#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include <isobrick/sample_value.h>
#include <isobrick/vec.h>
#include "tools/progress.h"

namespace isobrick::tools {

/// The form of the result, and whether notes are written.
struct OutputMode {
  bool json = false;
  bool quiet = false;
  ProgressForm progress = ProgressForm::automatic;
};

/// Version of the JSON objects: the first member of each, "schema". docs/reference/json_output.md
/// says what they hold.
inline constexpr int kJsonSchema = 1;

/// Keeps files that are opened from becoming a standard stream that is closed,
/// which would send messages into them.
void set_up_streams();

/// Where a command's words go: its result to standard output, as text or as
/// one JSON object; everything else to standard error.
class Console {
 public:
  explicit Console(OutputMode mode);

  /// From now on standard output carries the command's output, and results go to standard error.
  /// A pipe that its reader closes is a write error from now on. Throws UsageError with --json, and
  /// where standard output is a terminal.
  void reserve_output();
  /// The command's result, once. Throws Error when it cannot be written.
  void result(const nlohmann::ordered_json& object, std::string_view text);
  /// A result that is a text: {"command": …, "text": …}.
  void result_text(std::string_view command, std::string_view text);
  /// From now on nothing is written but errors.
  void mute();
  /// Whether an object was written: a command writes one, also where it then fails.
  bool wrote_object() const { return wrote_object_; }
  /// A remark beside the result.
  void note(std::string_view text) const;
  Progress& progress() { return progress_; }

 private:
  OutputMode mode_;
  bool wrote_object_ = false;
  bool reserved_ = false;  ///< standard output is the command's output
  ConsoleProgress progress_;
};

/// One line on standard error: "isobrick COMMAND: what"; lost when that cannot be written.
void print_error(std::string_view command, std::string_view what);
/// The same as an object on standard output: {"schema", "command", "error": {"message",
/// "exit_code"}}.
void print_error_json(std::string_view command, std::string_view what, int exit_code);
/// The same where memory is short: takes none.
void print_out_of_memory(std::string_view command) noexcept;

nlohmann::ordered_json to_json(Int3 v);
nlohmann::ordered_json to_json(Vec3d v);
/// A number with a fraction where that is exact, else an integer.
nlohmann::ordered_json to_json(const SampleValue& value);

/// The most memory that this process ever held (VmHWM), 0 when unknown.
std::uint64_t peak_resident_bytes();

}  // namespace isobrick::tools
