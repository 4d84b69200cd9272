#include <array>
#include <limits>
#include <string>
#include <thread>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

using OutputMode = ProgramTest;

constexpr std::array kCommands{"convert", "info",   "index",      "verify", "extract", "export",
                               "synth",   "recode", "completion", "man",    "help"};

TEST_F(OutputMode, Version) {
  const Outcome outcome = run({"--version"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.out, "isobrick " ISOBRICK_VERSION "\n");
}

TEST_F(OutputMode, EverySubcommandHasHelpWithAnExample) {
  const Outcome all = run({"--help"});
  EXPECT_EQ(all.exit_code, 0);
  for (const char* const name : kCommands) {
    const std::string command = name;
    EXPECT_NE(all.out.find("  " + command), std::string::npos) << command;
    const Outcome outcome = run({command, "--help"});
    EXPECT_EQ(outcome.exit_code, 0);
    EXPECT_EQ(outcome.err, "");
    for (const char* part : {"Example:\n", "--json", "--quiet", "--help"})
      EXPECT_NE(outcome.out.find(part), std::string::npos) << command << " " << part;
  }
}

TEST_F(OutputMode, MoreThreadsThanCoresAreNoReasonToWarn) {
  const std::string store = make_store("a");
  const std::string threads = std::to_string(4 * std::thread::hardware_concurrency());
  const auto expect_silent = [&](Arguments words) {
    words.insert(words.end(), {"--threads", threads, "--quiet"});
    const Outcome outcome = run(words);
    EXPECT_EQ(outcome.exit_code, 0) << words[0];
    EXPECT_EQ(outcome.err, "") << words[0] << " " << words.back();
  };
  for (const char* name : {"m.ply", "m.obj", "m.pvtp", "m.3dtiles"})
    expect_silent({"extract", store, "--isovalue", "127.5", "-o", path(name)});
  expect_silent({"extract", store, "--isovalue", "127.5", "--part", "1/1", "-o", path("m.piece")});
  expect_silent({"merge", path("m.piece"), "-o", path("n.obj")});
  expect_silent({"merge", path("m.piece"), "-o", path("n.ply"), "--simplify", "50%"});
  expect_silent({"convert", store, path("b.zarr")});
  expect_silent({"export", store, path("b.nrrd")});
}

TEST_F(OutputMode, InfoShowsTheStore) {
  const std::string store = make_store("a");
  const Outcome outcome = run({"info", store});
  EXPECT_EQ(outcome.err, "");
  for (const char* part : {"40 x 36 x 33", "uint8", "spacing", "level 0", "level 1", "value range",
                           "index kinds  none", "histogram", "█"})
    EXPECT_NE(outcome.out.find(part), std::string::npos) << part << "\n" << outcome.out;
  const nlohmann::json json = run_json({"info", store});
  for (const char* key : {"schema", "command", "input", "extent", "type", "spacing", "origin",
                          "direction", "unit", "codec", "fill_value", "levels", "bytes",
                          "raw_bytes", "ratio", "value_range", "histogram", "index_kinds"})
    EXPECT_TRUE(json.contains(key)) << key;
  std::uint64_t counted = 0;
  for (const auto& count : json["histogram"]["counts"]) counted += count.get<std::uint64_t>();
  EXPECT_EQ(counted, 40u * 36 * 33);
  EXPECT_EQ(json["levels"][0]["bricks"], 27);
}

// What takes longer the larger the store is comes only where it is requested.
TEST_F(OutputMode, InfoReadsNoMoreThanMetadataAndTheHistogram) {
  const std::string store = make_store("a", {"--build-index", "octree"});
  const nlohmann::json all = run_json({"info", store, "--stats"});
  EXPECT_GT(all["bytes"], 0);
  EXPECT_GT(all["ratio"], 0);
  EXPECT_EQ(all["levels"][0]["bricks_stored"], 27);
  EXPECT_GT(all["indexes"][0]["bytes"], 0);
  EXPECT_NE(run({"info", store, "--stats"}).out.find("0 absent"), std::string::npos);
  // Neither bricks nor ranges are looked at.
  for (const char* part : {"0", "isobrick/0/range/c", "isobrick/0/block_range/c"})
    for (const auto& entry : std::filesystem::recursive_directory_iterator(store + "/" + part))
      if (entry.is_regular_file() && entry.path().filename() != "zarr.json")
        write_file(entry.path(), "");
  const nlohmann::json json = run_json({"info", store});
  for (const char* key : {"bytes", "ratio"}) EXPECT_EQ(json[key], nullptr) << key;
  EXPECT_EQ(json["levels"][0]["bricks_stored"], nullptr);
  EXPECT_EQ(json["indexes"][0]["bytes"], nullptr);
  EXPECT_EQ(json["indexes"][0]["levels"][0]["bytes"], nullptr);
  for (const char* key : {"value_range", "histogram", "index_kinds", "raw_bytes"})
    EXPECT_EQ(json[key], all[key]) << key;
  const std::string text = run({"info", store}).out;
  for (const char* part :
       {"bytes        with --stats", "value range  1 to 254", "█", "octree, leaf"})
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
}

TEST_F(OutputMode, InfoOfOddVolumes) {
  const float special[] = {std::numeric_limits<float>::quiet_NaN(),
                           std::numeric_limits<float>::infinity(), 1, 2};
  write_file(path("a_2x2x1_float32.raw"),
             std::string(reinterpret_cast<const char*>(special), sizeof special));
  ASSERT_EQ(run({"convert", path("a_2x2x1_float32.raw"), path("a.zarr")}).exit_code, 0);
  const nlohmann::json json = run_json({"info", path("a.zarr")})["histogram"];
  EXPECT_EQ(json["not_a_number"], 1);
  EXPECT_EQ(json["infinite"], 1);
  EXPECT_EQ(json["lo"], 1.0);
  EXPECT_EQ(json["hi"], 2.0);
  write_file(path("b_3x1x1_uint8.raw"), "aaa");
  ASSERT_EQ(run({"convert", path("b_3x1x1_uint8.raw"), path("b.zarr")}).exit_code, 0);
  EXPECT_EQ(run_json({"info", path("b.zarr")})["histogram"]["counts"], nlohmann::json({3}));
}

// Rounded to six digits the largest sample would be 0.1, which no sample reaches.
TEST_F(OutputMode, InfoPrintsValuesThatReadBackExactly) {
  const float samples[] = {-1.00000012f, 0.100000001f, 0.0999999866f, 16777215.0f};
  write_file(path("a_4x1x1_float32.raw"),
             std::string(reinterpret_cast<const char*>(samples), sizeof samples));
  ASSERT_EQ(run({"convert", path("a_4x1x1_float32.raw"), path("a.zarr"), "--spacing",
                 "0.123456789,1,2", "--origin", "1234567.25,0,0"})
                .exit_code,
            0);
  const std::string info = run({"info", path("a.zarr")}).out;
  for (const char* line :
       {"value range  -1.0000001 to 16777215\n", "spacing      0.123456789 x 1 x 2 ",
        "origin       1234567.25, 0, 0\n", "direction    x (1, 0, 0), y (0, 1, 0), z (0, 0, 1)\n",
        "\n  -1.0000001"})
    EXPECT_NE(info.find(line), std::string::npos) << line << "is not in\n" << info;
}

TEST_F(OutputMode, JsonOfConversions) {
  write_file(path("in_20x20x20_uint8.raw"), noise(8000));
  for (const Arguments& arguments :
       {Arguments{"convert", path("in_20x20x20_uint8.raw"), path("a.zarr")},
        Arguments{"synth", "sphere", path("b.zarr"), "--dims", "20,20,20", "--type", "u8"},
        Arguments{"synth", "sphere", path("b.raw"), "--dims", "20,20,20", "--type", "u8"}}) {
    const nlohmann::json json = run_json(arguments);
    EXPECT_EQ(json["command"], arguments[0]);
    EXPECT_EQ(json["bytes_in"], 8000);
    for (const char* key : {"input", "output", "extent", "type", "levels", "bricks", "bytes_out",
                            "ratio", "seconds", "peak_resident_bytes"})
      EXPECT_TRUE(json.contains(key)) << key;
  }
}

TEST_F(OutputMode, ExtensionsInCapitals) {
  const Outcome synth =
      run({"synth", "sphere", path("S.RAW"), "--dims", "20,20,20", "--type", "u8"});
  EXPECT_EQ(synth.exit_code, 0) << synth.err;
  ASSERT_TRUE(std::filesystem::is_regular_file(path("S.RAW")));
  EXPECT_EQ(std::filesystem::file_size(path("S.RAW")), 8000u);
  const std::string store = make_store("a");
  for (const std::string name : {"X.PLY", "x.Stl"})
    EXPECT_EQ(run({"extract", store, "--isovalue", "127.5", "-o", path(name)}).exit_code, 0);
}

TEST_F(OutputMode, QuietSaysNothing) {
  if (!has_terminals()) GTEST_SKIP() << "no pseudo terminals here";
  const std::string store = make_store("a");
  for (const Arguments& arguments :
       {Arguments{"info", store}, Arguments{"verify", store},
        Arguments{"export", store, path("a.raw")},
        Arguments{"extract", store, "--isovalue", "1000", "-o", path("a.ply")},
        Arguments{"synth", "sphere", path("b.zarr"), "--dims", "9,9,9", "--type", "u8"}}) {
    Arguments quiet = arguments;
    quiet.push_back("--quiet");
    const Outcome outcome = run(quiet, {.terminal = true});
    EXPECT_EQ(outcome.exit_code, 0);
    EXPECT_EQ(outcome.out + outcome.err, "") << arguments[0];
  }
}

TEST_F(OutputMode, ABarOnATerminalAndNoneInAPipe) {
  if (!has_terminals()) GTEST_SKIP() << "no pseudo terminals here";
  const Arguments arguments{"synth",  "mixing", path("a.raw"), "--dims", "512,512,256",
                            "--type", "f32",    "--threads",   "1",      "--force"};
  const Outcome terminal = run(arguments, {.terminal = true});
  EXPECT_EQ(terminal.exit_code, 0);
  EXPECT_NE(terminal.err.find("% ["), std::string::npos) << terminal.err;
  EXPECT_NE(terminal.err.find("/s"), std::string::npos);
  EXPECT_TRUE(terminal.err.ends_with("\r\x1b[K")) << "the bar is wiped at the end";
  EXPECT_EQ(run(arguments).err, "");
}

}  // namespace
}  // namespace isobrick::test
