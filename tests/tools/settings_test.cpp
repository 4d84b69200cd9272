#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

class Settings : public ProgramTest {
 protected:
  /// Runs with a variable of the environment.
  static Outcome run_with(const std::string& variable, const Arguments& arguments) {
    Arguments words{"env", variable, ISOBRICK_PROGRAM};
    words.insert(words.end(), arguments.begin(), arguments.end());
    return run_process(words);
  }
};

TEST_F(Settings, VariablesStandForOptions) {
  const std::string store = make_store("a");
  const Outcome json = run_with("ISOBRICK_JSON=1", {"info", store});
  EXPECT_TRUE(nlohmann::json::accept(json.out)) << json.out;
  EXPECT_FALSE(nlohmann::json::accept(run_with("ISOBRICK_JSON=0", {"info", store}).out));
  expect_refused(run_with("ISOBRICK_MEMORY=1M", {"verify", store}), 2, {"--memory"});
  EXPECT_EQ(run_with("ISOBRICK_MEMORY=1M", {"verify", store, "--memory", "1G"}).exit_code, 0);
  EXPECT_EQ(run_with("ISOBRICK_MEMORY=1M", {"man"}).exit_code, 0) << "it has no such option";
  expect_refused(run_with("ISOBRICK_MEMORY=much", {"verify", store}), 2,
                 {"--memory: 'much'", "from ISOBRICK_MEMORY"});
  expect_refused(run_with("ISOBRICK_QUIET=maybe", {"verify", store}), 2,
                 {"ISOBRICK_QUIET", "neither true nor false"});
  // An empty value takes no word of the command line for itself.
  EXPECT_EQ(run_with("ISOBRICK_MEMORY=", {"verify", store}).exit_code, 0);
  expect_refused(run({"verify", store, "--memory="}), 2, {"--memory: a value is missing"});
  EXPECT_EQ(run_with("ISOBRICK_OUTPUT=", {"export", store, path("e.nrrd")}).exit_code, 0);
  EXPECT_EQ(run_with("ISOBRICK_JSON=1", {"man"}).out, run({"man"}).out);
  EXPECT_EQ(run_with("ISOBRICK_FORMAT=glb",
                     {"extract", store, "--isovalue", "127", "-o", path("typed.ply")})
                .exit_code,
            0)
      << "a name that is typed has its format";
  EXPECT_EQ(run_with("ISOBRICK_ISOVALUE=100,150", {"extract", store, "--estimate", "-q"}).exit_code,
            0);
}

TEST_F(Settings, AFileHasSectionsOfCommands) {
  const std::string store = make_store("a"), file = path("settings.toml");
  write_file(file,
             "json = true\n"
             "memory = \"1G\"\n"
             "[extract]\n"
             "isovalue = [\"100\", \"150\"]\n"
             "estimate = true\n"
             "[verify]\n"
             "memory = \"1M\"\n");
  const nlohmann::json extracted =
      nlohmann::json::parse(run({"extract", store, "--config", file}).out, nullptr, false);
  ASSERT_TRUE(extracted.is_object());
  EXPECT_EQ(extracted["surfaces"].size(), 2u);
  EXPECT_EQ(nlohmann::json::parse(
                run({"extract", store, "--config=" + file, "--isovalue", "120"}).out)["surfaces"]
                .size(),
            1u);
  EXPECT_EQ(run({"verify", store, "--config", file}).exit_code, 2) << "its own section goes first";
  EXPECT_EQ(run_with("ISOBRICK_MEMORY=1G", {"verify", store, "--config", file}).exit_code, 0);
  EXPECT_EQ(run_with("ISOBRICK_CONFIG=" + file, {"verify", store}).exit_code, 2);
}

TEST_F(Settings, FilesThatMakeNoSense) {
  const std::string store = make_store("a"), file = path("settings.toml");
  expect_refused(run({"info", store, "--config", file}), 1, {"settings.toml"});
  for (const auto& [text, part] :
       {std::pair{"memry = \"1G\"\n", "did you mean 'memory'"},
        std::pair{"[extrat]\nforce = true\n", "no subcommand"},
        std::pair{"[extract]\ndims = \"1,1\"\nkind = \"octree\"\n", "unknown option 'kind'"},
        std::pair{"[a.b]\nforce = true\n", "too deep"},
        std::pair{"memory = \"\"\n", "a value is missing"}}) {
    write_file(file, text);
    expect_refused(run({"info", store, "--config", file}), 2, {"settings.toml", part});
  }
  expect_refused(run({"info", store, "--config", path("")}), 2, {"is a folder"});
  write_file(file, "roi = [\"0:9\", \"\", \"\"]\nmemory = [1, 2]\n");
  expect_refused(run({"verify", store, "--config", file}), 2, {"--memory: '1,2'", "settings.toml"});
  write_file(file, "threads = \"0\"\n");
  expect_refused(run({"verify", store, "--config", file}), 2, {"--threads", "settings.toml"});
}

TEST_F(Settings, FailuresAreObjectsToo) {
  for (const auto& [arguments, code] :
       {std::pair{Arguments{"info", path("none"), "--json"}, 1},
        std::pair{Arguments{"synth", "sphere", path("a.zarr"), "--json"}, 2},
        std::pair{Arguments{"info", "--nonsense", "--json"}, 2},
        std::pair{Arguments{"verify", path("none"), "--memory", "x", "--json"}, 2}}) {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, code);
    const nlohmann::json object = nlohmann::json::parse(outcome.out, nullptr, false);
    ASSERT_TRUE(object.is_object()) << outcome.out;
    EXPECT_EQ(object["schema"], 1);
    EXPECT_EQ(object["command"], arguments[0]);
    EXPECT_EQ(object["error"]["exit_code"], code);
    const std::string message = object["error"]["message"];
    EXPECT_NE(outcome.err.find(message), std::string::npos) << outcome.err;
  }
}

TEST_F(Settings, ProgressAsLinesAndObjects) {
  const Arguments synth{"synth",    "sphere", path("a.zarr"), "--dims",
                        "64,64,64", "--type", "u8",           "--force"};
  const auto progress = [&](const std::string& form) {
    Arguments arguments = synth;
    arguments.insert(arguments.end(), {"--progress", form});
    return run(arguments).err;
  };
  EXPECT_NE(progress("lines").find("convert 100 % ("), std::string::npos);
  EXPECT_EQ(progress("none"), "");
  EXPECT_EQ(progress("auto"), "") << "what is quick";
  const std::string json = progress("json");
  const nlohmann::json line = nlohmann::json::parse(json.substr(0, json.find('\n')));
  EXPECT_EQ(line["progress"]["stage"], "convert");
  EXPECT_EQ(line["progress"]["done"], line["progress"]["total"]);
  EXPECT_EQ(run({"info", path("a.zarr"), "--progress", "x"}).exit_code, 2);
}

}  // namespace
}  // namespace isobrick::test
