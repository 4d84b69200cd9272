#include "tools/console.h"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <fstream>

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

void put(std::FILE* file, std::string_view text) {
  errno = 0;
  const bool whole = std::fwrite(text.data(), 1, text.size(), file) == text.size();
  if (!whole || std::fflush(file) != 0) throw system_error("write to", "standard output", errno);
}

/// A failure here cannot be reported.
void write_error(std::string_view text) noexcept {
  static_cast<void>(std::fwrite(text.data(), 1, text.size(), stderr));
}

}  // namespace

void set_up_streams() {
  // Each takes the lowest number free; the direction makes every use fail as
  // it would have failed on the closed stream.
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (fcntl(fd, F_GETFD) < 0 && errno == EBADF &&
        open("/dev/null", fd == STDIN_FILENO ? O_WRONLY : O_RDONLY) < 0)
      return;
}

std::string progress_line(std::string_view stage, std::uint64_t done, std::uint64_t total,
                          double seconds, int columns) {
  const double rate = seconds > 0 ? static_cast<double>(done) / seconds : 0;
  std::string line(stage);
  if (total > 0) {
    constexpr int width = 24;
    const double part = std::min(1.0, static_cast<double>(done) / static_cast<double>(total));
    const int full = static_cast<int>(part * width);
    line += fmt::format(" {:3.0f}% [{:#<{}}{:.<{}}]", part * 100, "", full, "", width - full);
  } else {
    line += fmt::format(" {}", human_bytes(done));
  }
  line += fmt::format(" {}/s", human_bytes(rate));
  if (total > done && rate > 0)
    line += fmt::format(", {:.0f} s left", static_cast<double>(total - done) / rate);
  if (columns > 1 && line.size() >= static_cast<std::size_t>(columns))
    line.resize(static_cast<std::size_t>(columns) - 1);
  return line;
}

void TerminalProgress::begin(std::string_view stage, std::uint64_t total) {
  throw_if_interrupted();
  stage_ = stage;
  total_ = total;
  done_ = 0;
  start_ = last_ = Clock::now();
}

void TerminalProgress::advance(std::uint64_t done) {
  throw_if_interrupted();
  done_ += done;
  if (!draw_) return;
  const auto now = Clock::now();
  if (now - last_ >= std::chrono::milliseconds(100)) redraw(now);
}

void TerminalProgress::end() {
  erase();
  throw_if_interrupted();
}

void TerminalProgress::redraw(Clock::time_point now) {
  last_ = now;
  drawn_ = true;
  const double seconds = std::chrono::duration<double>(now - start_).count();
  write_error(
      fmt::format("\r{}\x1b[K", progress_line(stage_, done_, total_, seconds, terminal_columns())));
}

void TerminalProgress::erase() {
  if (drawn_) write_error("\r\x1b[K");
  drawn_ = false;
}

Console::Console(OutputMode mode)
    : mode_(mode), progress_(!mode.quiet && isatty(STDERR_FILENO) == 1) {}

void Console::reserve_output() {
  if (mode_.json)
    throw UsageError("--json and the output '-' would both be on standard output; name a file");
  if (isatty(STDOUT_FILENO) == 1)
    throw UsageError("standard output is a terminal; redirect it, or name a file");
  reserved_ = true;
}

void Console::result(const nlohmann::ordered_json& object, std::string_view text) const {
  using nlohmann::ordered_json;
  if (reserved_) return note(text);
  if (mode_.json)
    put(stdout, object.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + '\n');
  else if (!mode_.quiet)
    put(stdout, text);
}

void Console::result_text(std::string_view command, std::string_view text) const {
  result({{"command", command}, {"text", text}}, text);
}

void Console::note(std::string_view text) const {
  if (!mode_.quiet) write_error(fmt::format("{}{}", text, text.ends_with('\n') ? "" : "\n"));
}

void print_error(std::string_view command, std::string_view what) {
  std::string line = command.empty() ? "isobrick: " : fmt::format("isobrick {}: ", command);
  line += what;
  std::replace(line.begin(), line.end(), '\n', ' ');
  line += '\n';
  write_error(line);
}

void print_out_of_memory(std::string_view command) noexcept {
  write_error(command.empty() ? "isobrick" : "isobrick ");
  write_error(command);
  write_error(": out of memory; a smaller --memory may help\n");
}

nlohmann::ordered_json to_json(Int3 v) { return {v.x, v.y, v.z}; }
nlohmann::ordered_json to_json(Vec3d v) { return {v.x, v.y, v.z}; }

std::uint64_t peak_resident_bytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmHWM:")) return std::strtoull(line.c_str() + 6, nullptr, 10) * 1024;
  return 0;
}

}  // namespace isobrick::tools
