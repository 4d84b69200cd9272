#include <algorithm>
#include <regex>

#include "tests/tools/program.h"

// Several isovalues, or a mesh and its picture, in one command: the files are those of a command
// for each, and the store is read once.

namespace isobrick::test {
namespace {

class ExtractTogether : public ProgramTest {
 protected:
  void SetUp() override {
    run_json({"synth", "gyroid", store(), "--dims", "150,131,97", "--type", "u8", "--brick", "32"});
  }
  std::string store() const { return path("g.zarr"); }

  /// `extract` of the store at 110 and so on with more arguments; outputs are replaced.
  Arguments extract(const Arguments& isovalues, const Arguments& more) const {
    Arguments arguments{"extract", store(), "--force", "--threads", "2"};
    for (const std::string& isovalue : isovalues)
      arguments.insert(arguments.end(), {"--isovalue", isovalue});
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }

  /// One of several files of a command is that of a command for it alone.
  void expect_same(const std::string& together, const std::string& alone) const {
    SCOPED_TRACE(together);
    const std::string bytes = read_file(path(together));
    EXPECT_FALSE(bytes.empty());
    EXPECT_TRUE(bytes == read_file(path(alone)));
  }
};

const Arguments kIsovalues{"110", "127.5", "250", "140"};

TEST_F(ExtractTogether, MeshesOfSeveralIsovaluesAreThoseOfSingleRuns) {
  for (const std::string extension : {".ply", ".stl", ".obj", ".glb", ".vtp", ".pvtp"}) {
    run_json(extract(kIsovalues, {"-o", path("m" + extension)}));
    for (const std::string& isovalue : kIsovalues) {
      // Parts are named after their mesh: it has the same name in another folder.
      const std::string name = "m_" + isovalue + extension;
      std::filesystem::create_directories(path("alone"));
      run_json(extract({isovalue}, {"-o", path("alone/" + name)}));
      expect_same(name, "alone/" + name);
      const std::string part = name + ".parts/part_0.vtp";
      if (extension == ".pvtp" && isovalue != "250") expect_same(part, "alone/" + part);
    }
  }
}

TEST_F(ExtractTogether, PicturesAreThoseOfSingleRuns) {
  const Arguments picture{"--preview", path("p.png"), "--size", "320x240"};
  const Outcome drawn = run(extract({"110"}, {"--preview", path("p.png")}));
  if (drawn.exit_code != 0) GTEST_SKIP() << drawn.err;  // nothing can draw here
  Arguments both = picture;
  both.insert(both.end(), {"-o", path("m.ply"), "--normals", "none"});
  run_json(extract(kIsovalues, both));
  for (const std::string& isovalue : kIsovalues) {
    run_json(extract({isovalue}, picture));
    expect_same("p_" + isovalue + ".png", "p.png");
    run_json(extract({isovalue}, {"-o", path("m.ply"), "--normals", "none"}));
    expect_same("m_" + isovalue + ".ply", "m.ply");
  }
}

TEST_F(ExtractTogether, TheStoreIsReadOnce) {
  const nlohmann::json alone = run_json(extract({"127.5"}, {"-o", path("a.ply")}));
  ASSERT_EQ(alone["passes"].size(), 1u);
  EXPECT_EQ(alone["passes"][0]["outputs"], (Arguments{path("a.ply")}));
  EXPECT_EQ(alone["passes"][0]["bytes_read"], alone["surfaces"][0]["bytes_read"]);
  const nlohmann::json together = run_json(extract(kIsovalues, {"-o", path("m.ply")}));
  ASSERT_EQ(together["passes"].size(), 1u);
  const nlohmann::json& pass = together["passes"][0];
  EXPECT_EQ(pass["outputs"], (Arguments{path("m_110.ply"), path("m_127.5.ply"), path("m_250.ply"),
                                        path("m_140.ply")}));
  EXPECT_EQ(pass["brick_reads"], pass["bricks_read"]);
  EXPECT_EQ(together["surfaces"].size(), 4u);
  std::uint64_t most = 0;
  for (const nlohmann::json& surface : together["surfaces"]) {
    EXPECT_EQ(surface["bricks"]["read"], pass["bricks_read"]);
    EXPECT_EQ(surface["bytes_read"], pass["bytes_read"]);
    most = std::max(most, surface["bricks"]["active"].get<std::uint64_t>());
  }
  EXPECT_LE(pass["bricks_read"].get<std::uint64_t>(),
            together["surfaces"][0]["bricks"]["total"].get<std::uint64_t>());
  EXPECT_GE(pass["bricks_read"].get<std::uint64_t>(), most);
  EXPECT_FALSE(run_json(extract({"110"}, {"--estimate"})).contains("passes"));
}

TEST_F(ExtractTogether, TheTextSaysWhatAllTookTogether) {
  const Outcome one = run(extract({"127.5"}, {"-o", path("a.ply")}));
  EXPECT_TRUE(std::regex_search(
      one.out, std::regex("^isovalue 127.5: .* vertices from [0-9]+ of [0-9]+ bricks in ")))
      << one.out;
  const Outcome two = run(extract({"110", "127.5"}, {"-o", path("m.ply")}));
  EXPECT_TRUE(
      std::regex_search(two.out, std::regex("\n2 files from [0-9]+ of [0-9]+ bricks in [^\n]*\n$")))
      << two.out;
  EXPECT_TRUE(std::regex_search(two.out, std::regex("isovalue 110: [^\n]* vertices\n"))) << two.out;
}

/// The budget that one surface needs is enough for any number of them.
TEST_F(ExtractTogether, ASmallBudgetTakesMorePassesAndIsKept) {
  const auto refused = run(extract({"110"}, {"-o", path("m.ply"), "--memory", "1M"}));
  std::smatch found;
  ASSERT_TRUE(std::regex_search(refused.err, found, std::regex("--memory ([0-9]+)M")))
      << refused.err;
  const std::string least = found.str(1) + "M";
  run_json(extract(kIsovalues, {"-o", path("all.ply")}));
  for (const std::string& memory :
       {least, std::to_string(std::stoi(least) + 14) + "M", std::string("256M")}) {
    const Outcome outcome =
        run(extract(kIsovalues, {"-o", path("m.ply"), "--memory", memory, "--json"}));
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    const auto made = nlohmann::json::parse(outcome.out);
    const std::size_t passes = made["passes"].size();
    EXPECT_EQ(passes, memory == least ? 4u : memory == "256M" ? 1u : 2u) << memory;
    for (const std::string& isovalue : kIsovalues)
      expect_same("m_" + isovalue + ".ply", "all_" + isovalue + ".ply");
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    EXPECT_LE(made["peak_resident_bytes"].get<std::uint64_t>(), std::stoull(memory) << 20)
        << memory;
#endif
  }
  const Outcome reported = run(extract(kIsovalues, {"-o", path("m.ply"), "--memory", least}));
  EXPECT_NE(reported.out.find("4 passes over the store"), std::string::npos) << reported.out;
}

}  // namespace
}  // namespace isobrick::test
