#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include <isobrick/progress.h>
#include <isobrick/vec.h>

namespace isobrick::tools {

/// The form of the result, and whether notes are written.
struct OutputMode {
  bool json = false;
  bool quiet = false;
};

/// Keeps files that are opened from becoming a standard stream that is closed,
/// which would send messages into them.
void set_up_streams();

/// A bar with rate and time left on standard error when that is a terminal.
class TerminalProgress final : public Progress {
 public:
  explicit TerminalProgress(bool draw) : draw_(draw) {}
  ~TerminalProgress() override { erase(); }

  void begin(std::string_view stage, std::uint64_t total) override;
  void advance(std::uint64_t done) override;
  void end() override;

 private:
  using Clock = std::chrono::steady_clock;
  void redraw(Clock::time_point now);
  void erase();

  bool draw_;
  bool drawn_ = false;
  std::string stage_;
  std::uint64_t total_ = 0, done_ = 0;
  Clock::time_point start_, last_;
};

/// The line of a bar: "stage  42% [#####....] 1.2 GiB/s, 12 s left", cut to `columns`.
std::string progress_line(std::string_view stage, std::uint64_t done, std::uint64_t total,
                          double seconds, int columns);

/// Where a command's words go: its result to standard output, as text or as
/// one JSON object; everything else to standard error.
class Console {
 public:
  explicit Console(OutputMode mode);

  /// From now on standard output carries the command's output, and results go to standard error.
  /// Throws UsageError with --json, and where standard output is a terminal.
  void reserve_output();
  /// The command's result, once. Throws Error when it cannot be written.
  void result(const nlohmann::ordered_json& object, std::string_view text) const;
  /// A result that is a text: {"command": …, "text": …}.
  void result_text(std::string_view command, std::string_view text) const;
  /// A remark beside the result.
  void note(std::string_view text) const;
  Progress& progress() { return progress_; }

 private:
  OutputMode mode_;
  bool reserved_ = false;  ///< standard output is the command's output
  TerminalProgress progress_;
};

/// One line on standard error: "isobrick COMMAND: what"; lost when that cannot be written.
void print_error(std::string_view command, std::string_view what);
/// The same where memory is short: takes none.
void print_out_of_memory(std::string_view command) noexcept;

nlohmann::ordered_json to_json(Int3 v);
nlohmann::ordered_json to_json(Vec3d v);

/// The most memory that this process ever held (VmHWM), 0 when unknown.
std::uint64_t peak_resident_bytes();

}  // namespace isobrick::tools
