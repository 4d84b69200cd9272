#include "tools/progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include "tools/format.h"
#include "tools/interrupt.h"

namespace isobrick::tools {
namespace {

int terminal_columns() {
  winsize size{};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

double rate_of(std::uint64_t done, double seconds) {
  return seconds > 0 ? static_cast<double>(done) / seconds : 0;
}

/// ", 12 s left", or nothing where that is unknown.
std::string time_left(std::uint64_t done, std::uint64_t total, double seconds) {
  const double rate = rate_of(done, seconds);
  if (total <= done || !(rate > 0)) return {};
  return fmt::format(", {:.0f} s left", static_cast<double>(total - done) / rate);
}

double part_of(std::uint64_t done, std::uint64_t total) {
  return std::min(1.0, static_cast<double>(done) / static_cast<double>(total));
}

}  // namespace

void write_error(std::string_view text) noexcept {
  static_cast<void>(std::fwrite(text.data(), 1, text.size(), stderr));
}

ProgressForm parse_progress(std::string_view text) {
  constexpr std::array<std::string_view, 5> words{"auto", "bar", "lines", "json", "none"};
  const auto found = std::find(words.begin(), words.end(), text);
  if (found == words.end())
    throw UsageError(
        fmt::format("'{}' is no form of progress; it is {}", text, fmt::join(words, ", ")));
  return static_cast<ProgressForm>(found - words.begin());
}

std::string progress_line(std::string_view stage, std::uint64_t done, std::uint64_t total,
                          double seconds, int columns) {
  std::string line(stage);
  if (total > 0) {
    constexpr int width = 24;
    const double part = part_of(done, total);
    const int full = static_cast<int>(part * width);
    line += fmt::format(" {:3.0f}% [{:#<{}}{:.<{}}]", part * 100, "", full, "", width - full);
  } else {
    line += fmt::format(" {}", human_bytes(done));
  }
  line +=
      fmt::format(" {}/s{}", human_bytes(rate_of(done, seconds)), time_left(done, total, seconds));
  if (columns > 1 && line.size() >= static_cast<std::size_t>(columns))
    line.resize(static_cast<std::size_t>(columns) - 1);
  return line;
}

std::string progress_text(std::string_view stage, std::uint64_t done, std::uint64_t total,
                          double seconds) {
  const std::string amount =
      total > 0 ? fmt::format("{:.0f} %", part_of(done, total) * 100) : human_bytes(done);
  return fmt::format("{} {} ({}/s{})", stage, amount, human_bytes(rate_of(done, seconds)),
                     time_left(done, total, seconds));
}

std::string progress_json(std::string_view stage, std::uint64_t done, std::uint64_t total,
                          double seconds) {
  return nlohmann::ordered_json{
      {"progress", {{"stage", stage}, {"done", done}, {"total", total}, {"seconds", seconds}}}}
      .dump();
}

ConsoleProgress::ConsoleProgress(ProgressForm form) : form_(form) {
  using std::chrono::milliseconds;
  writes_end_ = form == ProgressForm::lines || form == ProgressForm::json;
  if (form_ == ProgressForm::automatic) {
    form_ = isatty(STDERR_FILENO) == 1 ? ProgressForm::bar : ProgressForm::lines;
    period_ = milliseconds(10'000);  // a log of hours stays readable
  }
  if (form_ == ProgressForm::bar)
    period_ = milliseconds(100);
  else if (writes_end_)
    period_ = milliseconds(1000);
}

void ConsoleProgress::begin(std::string_view stage, std::uint64_t total) {
  throw_if_interrupted();
  stage_ = stage;
  is_running_ = true;
  total_ = total;
  done_ = 0;
  start_ = last_ = Clock::now();
}

void ConsoleProgress::advance(std::uint64_t done) {
  throw_if_interrupted();
  done_ += done;
  if (form_ == ProgressForm::none) return;
  const auto now = Clock::now();
  if (now - last_ >= period_) write(now);
}

void ConsoleProgress::end() {
  erase();
  if (writes_end_ && is_running_) write(Clock::now());
  is_running_ = false;
  throw_if_interrupted();
}

void ConsoleProgress::mute() {
  erase();
  form_ = ProgressForm::none;
  writes_end_ = false;
}

void ConsoleProgress::write(Clock::time_point now) {
  last_ = now;
  const double seconds = std::chrono::duration<double>(now - start_).count();
  if (form_ == ProgressForm::bar) {
    drawn_ = true;
    write_error(fmt::format("\r{}\x1b[K",
                            progress_line(stage_, done_, total_, seconds, terminal_columns())));
  } else {
    const auto text = form_ == ProgressForm::json ? progress_json : progress_text;
    write_error(text(stage_, done_, total_, seconds) + '\n');
  }
}

void ConsoleProgress::erase() {
  if (drawn_) write_error("\r\x1b[K");
  drawn_ = false;
}

}  // namespace isobrick::tools
