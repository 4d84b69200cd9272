#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include <isobrick/progress.h>

namespace isobrick::tools {

/// Writes to standard error; a failure there cannot be reported.
void write_error(std::string_view text) noexcept;

/// How progress is written to standard error.
enum class ProgressForm : std::uint8_t {
  automatic,  ///< a bar on a terminal; elsewhere lines, of what takes long
  bar,        ///< one line that changes
  lines,      ///< a line a second, and one at the end of a stage
  json,       ///< the same as JSON objects
  none
};

/// "auto", "bar", "lines", "json" or "none". Throws UsageError.
ProgressForm parse_progress(std::string_view text);

/// Writes progress to standard error, and throws Interrupted after a signal.
class ConsoleProgress final : public Progress {
 public:
  explicit ConsoleProgress(ProgressForm form);
  ~ConsoleProgress() override { erase(); }

  void begin(std::string_view stage, std::uint64_t total) override;
  void advance(std::uint64_t done) override;
  void end() override;
  /// From now on it only throws.
  void mute();

 private:
  using Clock = std::chrono::steady_clock;
  void write(Clock::time_point now);
  void erase();

  ProgressForm form_;
  std::chrono::milliseconds period_{0};
  bool writes_end_ = false;  ///< also at the end of a stage that was short
  bool drawn_ = false;       ///< a bar is on the line
  bool is_running_ = false;  ///< a stage is; one that another began within has ended it
  std::string stage_;
  std::uint64_t total_ = 0, done_ = 0;
  Clock::time_point start_, last_;
};

/// The line of a bar: "stage  42% [#####....] 1.2 GiB/s, 12 s left", cut to `columns`.
std::string progress_line(std::string_view stage, std::uint64_t done, std::uint64_t total,
                          double seconds, int columns);
/// A line of a log: "stage 42 % (1.2 GiB/s, 12 s left)".
std::string progress_text(std::string_view stage, std::uint64_t done, std::uint64_t total,
                          double seconds);
/// The same as {"progress": {"stage", "done", "total", "seconds"}}.
std::string progress_json(std::string_view stage, std::uint64_t done, std::uint64_t total,
                          double seconds);

}  // namespace isobrick::tools
