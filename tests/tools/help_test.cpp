#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

using Help = ProgramTest;

const Arguments kCommands{"convert", "info", "index", "verify",     "extract", "export", "recode",
                          "render",  "view", "synth", "completion", "man",     "help"};

/// A word of the first line that begins with "Usage".
std::string usage(const std::string& help) {
  const auto begin = help.find("Usage: ");
  return begin == std::string::npos ? "" : help.substr(begin, help.find('\n', begin) - begin);
}

TEST_F(Help, AnswersHoweverItIsAskedFor) {
  const std::string all = run({"--help"}).out;
  EXPECT_NE(all.find("Subcommands:\n"), std::string::npos);
  for (const Arguments& words : {Arguments{}, Arguments{"help"}}) {
    const Outcome outcome = run(words);
    EXPECT_EQ(outcome.exit_code, 0);
    EXPECT_EQ(outcome.out, all);
    EXPECT_EQ(outcome.err, "");
  }
  for (const std::string& command : kCommands)
    EXPECT_EQ(run({"help", command}).out, run({command, "--help"}).out) << command;
  EXPECT_EQ(run_json({"help", "info"})["text"], run({"info", "--help"}).out);
}

TEST_F(Help, MarksWhatIsNeeded) {
  EXPECT_EQ(usage(run({"--help"}).out), "Usage: isobrick SUBCOMMAND [OPTIONS]");
  EXPECT_EQ(usage(run({"extract", "--help"}).out), "Usage: isobrick extract INPUT [OPTIONS]");
  EXPECT_EQ(usage(run({"convert", "--help"}).out), "Usage: isobrick convert INPUT [OUT] [OPTIONS]");
  EXPECT_EQ(usage(run({"render", "--help"}).out).find("Usage: isobrick render MESH..."), 0u);
  EXPECT_EQ(usage(run({"help", "--help"}).out), "Usage: isobrick help [COMMAND] [OPTIONS]");
  const std::string synth = run({"synth", "--help"}).out;
  for (const char* option : {"--dims X,Y,Z ", "--type u8|i8|u16|i16|u32|i32|f32|f64|u64|i64 "})
    EXPECT_NE(usage(synth).find(option), std::string::npos) << option;
  EXPECT_NE(synth.find("Samples along x, y and z (required)\n"), std::string::npos);
  expect_refused(run({"synth", "gyroid", path("a.zarr"), "--type", "u8"}), 2,
                 {"--dims is required", "isobrick synth --help"});
}

TEST_F(Help, SuggestsWhatWasMeant) {
  expect_refused(run({"extrct", "a.zarr"}), 2, {"'extrct'", "did you mean 'extract'?"});
  expect_refused(run({"help", "covnert"}), 2, {"'covnert'", "did you mean 'convert'?"});
  expect_refused(run({"extract", "a.zarr", "--isovalu", "3"}), 2,
                 {"'--isovalu'", "did you mean '--isovalue'?"});
  expect_refused(run({"extract", "a.zarr", "--isoavlue=3"}), 2, {"did you mean '--isovalue'?"});
  expect_refused(run({"frobnicate"}), 2, {"'frobnicate'", "see 'isobrick --help'"});
  expect_refused(run({"info", "a.zarr", "b.zarr"}), 2, {"'b.zarr'", "see 'isobrick info --help'"});
}

TEST_F(Help, AnOptionIsNoValueOfTheOneBefore) {
  expect_refused(run({"extract", "a.zarr", "--isovalue", "3", "-o", "--preview", "a.png"}), 2,
                 {"--output", "a value is missing before '--preview'"});
  EXPECT_EQ(files(), Arguments{});
}

// Whatever the locale, a terminal shows it.
TEST_F(Help, IsPlainAscii) {
  const auto expect_ascii = [](const std::string& text, const std::string& name) {
    for (const char c : text) ASSERT_LT(static_cast<unsigned char>(c), 128) << name << ": " << text;
  };
  for (const std::string& command : kCommands) expect_ascii(run({command, "--help"}).out, command);
  expect_ascii(run({"man"}).out, "man page");
}

TEST_F(Help, TheManPageIsWellFormed) {
  const Outcome page = run({"man"});
  EXPECT_EQ(page.exit_code, 0);
  for (const std::string& command : kCommands)
    EXPECT_NE(page.out.find(".SS " + command + "\n"), std::string::npos) << command;
  if (!available("man")) GTEST_SKIP() << "no man";
  write_file(path("isobrick.1"), page.out);
  for (const std::string locale : {"LC_ALL=C", "LC_ALL=C.UTF-8"}) {
    const Outcome shown = run_process(
        {"env", locale, "MANROFFOPT=-ww", "man", "--warnings", "-l", path("isobrick.1")});
    EXPECT_EQ(shown.exit_code, 0);
    EXPECT_EQ(shown.err, "") << locale;
    EXPECT_NE(shown.out.find("--isovalue"), std::string::npos);
  }
}

}  // namespace
}  // namespace isobrick::test
