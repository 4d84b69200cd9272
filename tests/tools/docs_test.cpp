#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <sstream>

#include "tests/tools/program.h"

// Every command line of README, of the guide, of --help and of the quickstart runs from top to
// bottom in one folder, with relative names, on the volume that comes with the sources.
namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> lines_of(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

bool calls_isobrick(const std::string& line) {
  return line.starts_with("isobrick ") || line.find("| isobrick ") != std::string::npos ||
         line.find("<(isobrick ") != std::string::npos ||
         line.find("&& isobrick ") != std::string::npos;
}

/// The spans between backquotes in a line of Markdown.
std::vector<std::string> spans_of(const std::string& line) {
  std::vector<std::string> spans;
  for (auto begin = line.find('`'); begin != std::string::npos;) {
    const auto end = line.find('`', begin + 1);
    if (end == std::string::npos) break;
    std::string span = line.substr(begin + 1, end - begin - 1);
    if (const auto bar = span.find("\\|"); bar != std::string::npos) span.erase(bar, 1);
    spans.push_back(span);
    begin = line.find('`', end + 1);
  }
  return spans;
}

/// The first line of a block of examples that need files of the reader's.
constexpr std::string_view kOwnFiles = "# with files of your own";

/// Command lines of a Markdown file in their order: whole lines of its blocks, spans elsewhere.
/// Leaves out the blocks that begin with kOwnFiles.
std::vector<std::string> commands_of_markdown(const std::string& text) {
  std::vector<std::string> commands;
  bool in_block = false, own_files = false;
  for (const std::string& line : lines_of(text)) {
    if (line.starts_with("```")) {
      in_block = !in_block;
      own_files = false;
    } else if (in_block) {
      own_files = own_files || line.starts_with(kOwnFiles);
      if (!own_files && (calls_isobrick(line) || line.starts_with("zstd ")))
        commands.push_back(line);
    } else {
      for (const std::string& span : spans_of(line))
        if (calls_isobrick(span) && span != "isobrick completion --help") commands.push_back(span);
    }
  }
  return commands;
}

class Docs : public ProgramTest {
 protected:
  void SetUp() override {
    if (!available("zstd")) GTEST_SKIP() << "no zstd";
    fs::create_directory(path("data"));
    fs::copy(fs::path(ISOBRICK_SOURCE) / "data", path("data"));
    has_pictures_ = run({"help", "view"}).out.find("not in this program") == std::string::npos;
  }

  /// Runs a line as a user's shell does, in the scratch folder. False where the program was built
  /// without what the line needs.
  bool expect_runs(std::string line) const {
    SCOPED_TRACE(line);
    line = line.substr(0, line.find(" #"));
    const bool draws = line.find("isobrick render") != std::string::npos ||
                       line.find("isobrick view") != std::string::npos ||
                       line.find("--preview") != std::string::npos;
    if (draws && !has_pictures_) return true;
    if (line.find("man -l") != std::string::npos && !available("man")) return true;
    if (line.starts_with("parallel ") && !available("parallel")) return true;
    if (line.starts_with("mpirun ") && !available("mpirun")) return true;
    // There is no display here.
    if (line.starts_with("isobrick view ") && line.find(" --screenshot") == std::string::npos &&
        line.find(" --turntable") == std::string::npos)
      line += " --screenshot view.png --force";
    const std::string folder = path("");
    const Outcome outcome =
        run_process({"env", fmt::format("HOME={}", folder), "OMPI_ALLOW_RUN_AS_ROOT=1",
                     "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1", "OMPI_MCA_rmaps_base_oversubscribe=1",
                     "bash", "-o", "pipefail", "-c",
                     fmt::format("cd '{}'; PATH='{}':$PATH; {}", folder,
                                 fs::path(ISOBRICK_PROGRAM).parent_path().string(), line)});
    if (outcome.err.find("built without") != std::string::npos) return false;
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return true;
  }

  /// Runs the lines of a page of the guide, up to one that needs what this program lacks.
  int expect_page_runs(const fs::path& page) const {
    SCOPED_TRACE(page.filename());
    int lines = 0;
    for (const std::string& command : commands_of_markdown(read_file(page))) {
      if (!expect_runs(command)) break;
      ++lines;
    }
    return lines;
  }

  void unpack(const std::string& name) const {
    expect_runs("zstd -dq data/headsq_quarter_64x64x93_int16.raw.zst -o " + name);
  }

 private:
  bool has_pictures_ = true;
};

// In the folder that scripts/quickstart leaves.
TEST_F(Docs, LinesOfTheReadmeRun) {
  unpack("headsq_quarter_64x64x93_int16.raw");
  expect_runs("isobrick convert headsq_quarter_64x64x93_int16.raw head.zarr --spacing 3.2,3.2,1.5");
  const auto commands = commands_of_markdown(read_file(fs::path(ISOBRICK_SOURCE) / "README.md"));
  ASSERT_GT(commands.size(), 15u);
  std::set<std::string> subcommands;
  for (const std::string& command : commands) {
    expect_runs(command);
    const std::string rest = command.substr(command.find("isobrick ") + 9);
    subcommands.insert(rest.substr(0, rest.find(' ')));
  }
  for (const char* name : {"convert", "info", "extract", "render", "view", "index", "export",
                           "recode", "verify", "synth", "man", "completion"})
    EXPECT_TRUE(subcommands.contains(name)) << name;
  EXPECT_TRUE(fs::exists(path("skull.pvtp")));
}

TEST_F(Docs, ExamplesOfHelpRun) {
  unpack("head.raw");
  unpack("head_64x64x93_int16.raw");
  for (const char* command : {"convert", "info", "index", "verify", "extract", "merge", "export",
                              "recode", "render", "view", "synth", "completion", "man", "help"}) {
    const std::string help = run({"help", command}).out;
    int examples = 0;
    const auto begin = help.find("Example:\n");
    ASSERT_NE(begin, std::string::npos) << command;
    for (std::string line : lines_of(help.substr(begin))) {
      line.erase(0, line.find_first_not_of(' '));
      if (!calls_isobrick(line)) continue;
      expect_runs(line);
      ++examples;
    }
    EXPECT_GT(examples, 0) << command;
  }
}

// What scripts/quickstart writes after it has made its store.
TEST_F(Docs, NextLinesOfTheQuickstartRun) {
  unpack("head_64x64x93_int16.raw");
  expect_runs("mkdir -p out && isobrick convert head_64x64x93_int16.raw out/head.zarr");
  int commands = 0;
  for (std::string line : lines_of(read_file(fs::path(ISOBRICK_SOURCE) / "scripts/quickstart"))) {
    if (!line.starts_with("  $isobrick ")) continue;
    line.replace(0, 11, "isobrick");
    for (auto at = line.find("$out"); at != std::string::npos; at = line.find("$out"))
      line.replace(at, 4, "out");
    expect_runs(line);
    ++commands;
  }
  EXPECT_GE(commands, 3);
}

// With stand-ins for the set-up, the build and the program.
TEST_F(Docs, TheQuickstartGoesOnWithoutAViewer) {
  const auto add = [&](const std::string& name, const std::string& script) {
    fs::create_directories(fs::path(path(name)).parent_path());
    write_file(path(name), "#!/bin/sh\n" + script + "\n");
    fs::permissions(path(name), fs::perms::owner_all);
  };
  const auto quickstart = [&](const std::string& help_of_view) {
    add("build/release/bin/isobrick",
        "[ \"$*\" = 'help view' ] && echo '" + help_of_view + "' || echo \"ran $*\"");
    return run_process(
        {"env", "PATH=" + path("bin") + ":/usr/bin:/bin", path("scripts/quickstart")});
  };
  add("scripts/setup", "");
  add("bin/cmake", "");
  fs::copy_file(fs::path(ISOBRICK_SOURCE) / "scripts/quickstart", path("scripts/quickstart"));
  const Outcome with = quickstart("Look at a store");
  EXPECT_EQ(with.exit_code, 0) << with.err;
  EXPECT_NE(with.out.find(" --preview "), std::string::npos) << with.out;
  const Outcome without = quickstart("(not in this program)");
  EXPECT_EQ(without.exit_code, 0) << without.err;
  EXPECT_NE(without.out.find("ran extract build/quickstart/head.zarr"), std::string::npos)
      << without.out;
  EXPECT_EQ(without.out.find(" --preview"), std::string::npos) << without.out;
  EXPECT_EQ(without.out.find("head_500.png"), std::string::npos) << without.out;
}

std::vector<std::string> pages_of_guide() {
  std::set<std::string> pages;
  for (const auto& entry : fs::directory_iterator(fs::path(ISOBRICK_SOURCE) / "docs/guide"))
    pages.insert(entry.path().stem().string());
  return {pages.begin(), pages.end()};
}

class Guide : public Docs, public testing::WithParamInterface<std::string> {};

// In the folder that the first steps leave.
TEST_P(Guide, LinesRun) {
  const fs::path guide = fs::path(ISOBRICK_SOURCE) / "docs/guide";
  const int first_steps = expect_page_runs(guide / "first_steps.md");
  EXPECT_GT(first_steps, 5);
  if (GetParam() != "first_steps") expect_page_runs(guide / (GetParam() + ".md"));
}
INSTANTIATE_TEST_SUITE_P(Page, Guide, testing::ValuesIn(pages_of_guide()),
                         [](const auto& page) { return page.param; });

TEST_F(Docs, BenchesSayHowTheyAreBuilt) {
  int benches = 0;
  for (const auto& entry : fs::recursive_directory_iterator(fs::path(ISOBRICK_SOURCE) / "bench")) {
    if (entry.path().extension() != ".cpp") continue;
    const std::string text = read_file(entry.path());
    if (text.find("int main(") == std::string::npos &&
        text.find("guarded_main(") == std::string::npos)
      continue;
    EXPECT_NE(text.find("bench/README.md"), std::string::npos) << entry.path();
    ++benches;
  }
  EXPECT_GE(benches, 8);
  EXPECT_NE(
      read_file(fs::path(ISOBRICK_SOURCE) / "bench/README.md").find("-DISOBRICK_BUILD_BENCH=ON"),
      std::string::npos);
}

}  // namespace
}  // namespace isobrick::test
