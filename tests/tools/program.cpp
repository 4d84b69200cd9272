#include "tests/tools/program.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <fstream>
#include <iterator>
#include <random>
#include <stdexcept>
#include <thread>

#include <fmt/format.h>

extern char** environ;

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

/// Two ends to read what a process writes: a pipe or a pseudo terminal.
struct Channel {
  int ours = -1, theirs = -1;
};

Channel open_pipe() {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error("pipe2");
  return {ends[0], ends[1]};
}

Channel open_terminal() {
  const int ours = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  if (ours < 0) throw std::runtime_error("openpt");
  if (grantpt(ours) != 0 || unlockpt(ours) != 0 || ptsname(ours) == nullptr) {
    close(ours);
    throw std::runtime_error("openpt");
  }
  const int theirs = ::open(ptsname(ours), O_RDWR | O_NOCTTY | O_CLOEXEC);
  if (theirs < 0) {
    close(ours);
    throw std::runtime_error("open of the terminal");
  }
  return {ours, theirs};
}

/// Reads until the other side closes; a terminal ends with EIO.
std::string drain(int fd) {
  std::string text;
  std::array<char, 4096> buffer{};
  for (ssize_t got; (got = read(fd, buffer.data(), buffer.size())) > 0;)
    text.append(buffer.data(), static_cast<std::size_t>(got));
  close(fd);
  return text;
}

/// The words that run `words` under a file size limit. The signal stays as it
/// is by default, so that the program has to deal with it.
Arguments limited(const Arguments& words, long file_blocks) {
  Arguments all{"/bin/sh", "-c", fmt::format("ulimit -f {}; exec \"$@\"", file_blocks), "sh"};
  all.insert(all.end(), words.begin(), words.end());
  return all;
}

pid_t spawn(const Arguments& words, const Surroundings& surroundings, int out, int err) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, surroundings.input.c_str(), O_RDONLY, 0);
  if (surroundings.output.empty())
    posix_spawn_file_actions_adddup2(&actions, out, 1);
  else
    posix_spawn_file_actions_addopen(&actions, 1, surroundings.output.c_str(), O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, err, 2);
  std::vector<char*> argv;
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  pid_t pid = 0;
  const int result = posix_spawnp(&pid, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (result != 0) throw std::runtime_error("cannot run " + words[0]);
  return pid;
}

}  // namespace

bool available(const std::string& program) {
  return run_process({"/bin/sh", "-c", "command -v " + program}).exit_code == 0;
}

bool has_terminals() {
  try {
    const Channel terminal = open_terminal();
    close(terminal.ours);
    close(terminal.theirs);
    return true;
  } catch (const std::runtime_error&) {
    return false;
  }
}

Outcome run_process(const Arguments& words, const Surroundings& surroundings) {
  const Channel out = open_pipe();
  const Channel err = surroundings.terminal ? open_terminal() : open_pipe();
  const pid_t pid =
      spawn(surroundings.file_blocks > 0 ? limited(words, surroundings.file_blocks) : words,
            surroundings, out.theirs, err.theirs);
  close(out.theirs);
  close(err.theirs);
  Outcome outcome;
  std::thread listener([&] { outcome.err = drain(err.ours); });
  std::thread second([&] { outcome.out = drain(out.ours); });
  if (surroundings.interrupt_after > 0) {
    std::this_thread::sleep_for(std::chrono::duration<double>(surroundings.interrupt_after));
    kill(pid, surroundings.interrupt_by);
  }
  const auto signalled = std::chrono::steady_clock::now();
  int status = 0;
  rusage usage{};
  wait4(pid, &status, 0, &usage);
  outcome.peak_bytes = static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
  outcome.seconds_since_signal =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - signalled).count();
  listener.join();
  second.join();
  if (WIFEXITED(status)) outcome.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) outcome.signal = WTERMSIG(status);
  return outcome;
}

std::string read_file(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  EXPECT_TRUE(file) << path;
  return {std::istreambuf_iterator<char>(file), {}};
}

void write_file(const fs::path& path, const std::string& bytes) {
  std::ofstream file(path, std::ios::binary);
  file << bytes;
  EXPECT_TRUE(file) << path;
}

std::string noise(std::size_t bytes, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::string text(bytes, '\0');
  for (char& c : text) c = static_cast<char>(random() & 0xff);
  return text;
}

ProgramTest::ProgramTest() {
  std::string pattern = (fs::temp_directory_path() / "isobrick-test-XXXXXX").string();
  if (!mkdtemp(pattern.data())) throw std::runtime_error("mkdtemp");
  folder_ = pattern;
  // Beside the folder, whose files tests list.
  ::setenv("XDG_CACHE_HOME", (pattern + ".cache").c_str(), 1);
}

ProgramTest::~ProgramTest() {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
  fs::remove_all(folder_.string() + ".cache", ignored);
}

std::vector<std::string> ProgramTest::files() const {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder_))
    names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

Outcome ProgramTest::run(const Arguments& arguments, const Surroundings& surroundings) {
  Arguments words{ISOBRICK_PROGRAM};
  words.insert(words.end(), arguments.begin(), arguments.end());
  return run_process(words, surroundings);
}

nlohmann::json ProgramTest::run_json(Arguments arguments, const Surroundings& surroundings) {
  arguments.push_back("--json");
  const Outcome outcome = run(arguments, surroundings);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  const nlohmann::json object = nlohmann::json::parse(outcome.out, nullptr, false);
  EXPECT_TRUE(object.is_object()) << outcome.out;
  return object.is_object() ? object : nlohmann::json::object();
}

std::string ProgramTest::make_store(const std::string& name, const Arguments& more) {
  const std::string store = path(name + ".zarr");
  Arguments arguments{"synth", "gyroid",  store, "--dims",  "40,36,33", "--type",
                      "u8",    "--brick", "16",  "--shard", "32"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const Outcome outcome = run(arguments);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  return store;
}

void expect_refused(const Outcome& outcome, int exit_code,
                    std::initializer_list<std::string> parts) {
  EXPECT_EQ(outcome.exit_code, exit_code) << outcome.err;
  EXPECT_EQ(outcome.out, "");
  EXPECT_EQ(outcome.err.find("cannot cannot"), std::string::npos) << outcome.err;
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  EXPECT_TRUE(outcome.err.starts_with("isobrick")) << outcome.err;
  EXPECT_TRUE(outcome.err.ends_with("\n")) << outcome.err;
  for (const std::string& part : parts)
    EXPECT_NE(outcome.err.find(part), std::string::npos) << part << "\nis not in\n" << outcome.err;
}

}  // namespace isobrick::test
