#include "tools/console.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>

namespace isobrick::tools {
namespace {

void put(std::FILE* file, std::string_view text) {
  errno = 0;
  const bool whole = std::fwrite(text.data(), 1, text.size(), file) == text.size();
  if (!whole || std::fflush(file) != 0) throw system_error("write to", "standard output", errno);
}

/// An object on a line, after the version of its members.
std::string json_line(const nlohmann::ordered_json& object) {
  using nlohmann::ordered_json;
  ordered_json all{{"schema", kJsonSchema}};
  all.update(object);
  return all.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + '\n';
}

}  // namespace

void set_up_streams() {
  // Each takes the lowest number free; the direction makes every use fail as
  // it would have failed on the closed stream.
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (fcntl(fd, F_GETFD) < 0 && errno == EBADF &&
        ::open("/dev/null", fd == STDIN_FILENO ? O_WRONLY : O_RDONLY) < 0)
      return;
}

Console::Console(OutputMode mode)
    : mode_(mode), progress_(mode.quiet ? ProgressForm::none : mode.progress) {}

void Console::mute() {
  mode_ = {.json = false, .quiet = true, .progress = ProgressForm::none};
  progress_.mute();
}

void Console::reserve_output() {
  if (mode_.json)
    throw UsageError("--json and the output '-' would both be on standard output; name a file");
  if (isatty(STDOUT_FILENO) == 1)
    throw UsageError("standard output is a terminal; redirect it, or name a file");
  // A reader that goes away is an error with a line, so that other outputs leave nothing behind.
  std::signal(SIGPIPE, SIG_IGN);
  reserved_ = true;
}

void Console::result(const nlohmann::ordered_json& object, std::string_view text) {
  if (reserved_) return note(text);
  if (mode_.json) {
    wrote_object_ = true;
    put(stdout, json_line(object));
  } else if (!mode_.quiet)
    put(stdout, text);
}

void Console::result_text(std::string_view command, std::string_view text) {
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

void print_error_json(std::string_view command, std::string_view what, int exit_code) {
  put(stdout,
      json_line({{"command", command}, {"error", {{"message", what}, {"exit_code", exit_code}}}}));
}

void print_out_of_memory(std::string_view command) noexcept {
  write_error(command.empty() ? "isobrick" : "isobrick ");
  write_error(command);
  write_error(": out of memory; a smaller --memory may help\n");
}

nlohmann::ordered_json to_json(Int3 v) { return {v.x, v.y, v.z}; }
nlohmann::ordered_json to_json(Vec3d v) { return {v.x, v.y, v.z}; }

nlohmann::ordered_json to_json(const SampleValue& value) {
  const double number = value;
  if (value == number || std::isnan(number)) return number;
  if (const auto integer = value.as_signed()) return *integer;
  return value.as_unsigned().value_or(0);
}

std::uint64_t peak_resident_bytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmHWM:")) return std::strtoull(line.c_str() + 6, nullptr, 10) * 1024;
  return 0;
}

}  // namespace isobrick::tools
