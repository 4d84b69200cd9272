#include <fmt/format.h>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

using Completion = ProgramTest;

TEST_F(Completion, IsAScript) {
  for (const std::string shell : {"bash", "zsh", "fish"}) {
    const Outcome outcome = run({"completion", shell});
    EXPECT_EQ(outcome.exit_code, 0);
    for (const std::string word : {"convert", "extract", "view", "help", "isovalue"})
      EXPECT_NE(outcome.out.find(word), std::string::npos) << shell << " " << word;
    if (!available(shell)) continue;
    write_file(path(shell), outcome.out);
    const Outcome checked = run_process({shell, "-n", path(shell)});
    EXPECT_EQ(checked.exit_code, 0) << checked.err;
  }
}

TEST_F(Completion, HelpSaysWhereShellsLook) {
  const std::string help = run({"completion", "--help"}).out;
  for (const char* place :
       {"~/.bashrc", "~/.zfunc/_isobrick", "fpath", "~/.config/fish/completions/isobrick.fish"})
    EXPECT_NE(help.find(place), std::string::npos) << place;
}

// Only words that fit are offered: files where a file may stand, values of the option, options that
// are not there yet.
TEST_F(Completion, OfBash) {
  if (!available("bash")) GTEST_SKIP() << "no bash";
  write_file(path("script"), run({"completion", "bash"}).out);
  const auto completed = [&](const std::string& words, int at) {
    return run_process({"bash", "-c",
                        fmt::format("cd {}; source {}; COMP_WORDS=({}); COMP_CWORD={}; _isobrick; "
                                    "echo \"${{COMPREPLY[@]}}\"",
                                    path("."), path("script"), words, at)})
        .out;
  };
  EXPECT_EQ(completed("isobrick ex", 1), "extract export\n");
  EXPECT_EQ(completed("isobrick convert --type f", 3), "f32 f64\n");
  EXPECT_EQ(completed("isobrick convert --codec ''", 3), "zstd packed none auto\n");
  EXPECT_EQ(completed("isobrick extract --iso", 2), "--isovalue\n");
  EXPECT_EQ(completed("isobrick extract --isovalue 5 --iso", 4), "--isovalue\n");
  EXPECT_EQ(completed("isobrick extract --level 0 --lev", 4), "--levels\n");
  EXPECT_EQ(completed("isobrick extract -o a.ply --outp", 4), "\n");
  EXPECT_EQ(completed("isobrick extract --level ''", 3), "auto\n");
  EXPECT_EQ(completed("isobrick extract -o ''", 3), "script\n");
  EXPECT_EQ(completed("isobrick extract ''", 2), "script\n");
  EXPECT_EQ(completed("isobrick extract a.zarr ''", 3), "\n");
  EXPECT_EQ(completed("isobrick extract --isovalue 5 ''", 4), "script\n");
  EXPECT_EQ(completed("isobrick render a.ply b.ply ''", 4), "script\n");
  EXPECT_EQ(completed("isobrick synth gy", 2), "gyroid\n");
  EXPECT_EQ(completed("isobrick synth gyroid ''", 3), "script\n");
  EXPECT_EQ(completed("isobrick man ''", 2), "\n");
  EXPECT_EQ(completed("isobrick completion bash ''", 3), "\n");
}

TEST_F(Completion, OfFish) {
  if (!available("fish")) GTEST_SKIP() << "no fish";
  write_file(path("script"), run({"completion", "fish"}).out);
  const auto completed = [&](const std::string& line) {
    return run_process(
               {"fish", "--no-config", "-c",
                fmt::format("cd {}; source script; complete -C '{}' | cut -f 1 | string join ' '",
                            path("."), line)})
        .out;
  };
  EXPECT_EQ(completed("isobrick synth gyroid a.zarr --type f"), "f32 f64\n");
  EXPECT_EQ(completed("isobrick synth gy"), "gyroid\n");
  EXPECT_EQ(completed("isobrick synth gyroid s"), "script\n");
  EXPECT_EQ(completed("isobrick extract s"), "script\n");
  EXPECT_EQ(completed("isobrick extract --level s"), "");
  EXPECT_EQ(completed("isobrick man s"), "");
}

}  // namespace
}  // namespace isobrick::test
