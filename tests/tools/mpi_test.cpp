#include <algorithm>
#include <csignal>
#include <map>

#include <fmt/format.h>

#include "tests/tools/program.h"

// Commands that the ranks of mpirun share.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class Mpi : public ProgramTest {
 protected:
  void SetUp() override {
    if (!available("mpirun")) GTEST_SKIP() << "mpirun is not installed";
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "MPI leaks memory of its own";
#endif
    run_json({"synth", "gyroid", path("g.zarr"), "--dims", "150,130,170", "--type", "u8", "--brick",
              "32", "--levels", "2"});
    if (mpirun(1, {"--version"}).err.find("not built") != std::string::npos)
      GTEST_SKIP() << "built without MPI";
  }

  /// Tests may run as root, on fewer cores than ranks.
  static Arguments launch(int ranks) {
    return {"env",
            "OMPI_ALLOW_RUN_AS_ROOT=1",
            "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1",
            "mpirun",
            "--oversubscribe",
            "--bind-to",
            "none",
            "-n",
            std::to_string(ranks),
            ISOBRICK_PROGRAM};
  }
  static Outcome mpirun(int ranks, const Arguments& arguments) {
    Arguments words = launch(ranks);
    words.insert(words.end(), arguments.begin(), arguments.end());
    return run_process(words);
  }
  /// The one object on standard output.
  static nlohmann::json mpirun_json(int ranks, Arguments arguments) {
    arguments.push_back("--json");
    const Outcome outcome = mpirun(ranks, arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_EQ(outcome.err, "");
    EXPECT_EQ(std::count(outcome.out.begin(), outcome.out.end(), '\n'), 1) << outcome.out;
    return nlohmann::json::parse(outcome.out, nullptr, false);
  }
  Arguments extract(const std::string& name, const Arguments& more = {}) const {
    Arguments words{"extract", path("g.zarr"), "--isovalue", "120", "-o", path(name)};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  /// The lines that the program wrote, without those of mpirun.
  static std::vector<std::string> own_lines(const std::string& text) {
    std::vector<std::string> lines;
    for (std::size_t at = 0; at < text.size();) {
      const std::size_t end = std::min(text.find('\n', at), text.size());
      if (text.compare(at, 9, "isobrick ") == 0) lines.push_back(text.substr(at, end - at));
      at = end + 1;
    }
    return lines;
  }
};

TEST_F(Mpi, RanksMakeTheMeshOfOneProcess) {
  for (const Arguments& more :
       {Arguments{}, {"--normals", "--roi", "10:140,0:130,31:170"}, {"--level", "1"}}) {
    run_json(extract("one.ply", more));
    const auto made = mpirun_json(3, extract("ranks.ply", more));
    EXPECT_EQ(made["ranks"]["total"], 3);
    EXPECT_GT(made["ranks"]["received_bytes"], 0);
    EXPECT_GE(made["surfaces"][0]["pieces"]["total"], more.empty() ? 3 : 1);
    EXPECT_TRUE(read_file(path("ranks.ply")) == read_file(path("one.ply")));
    EXPECT_EQ(files(), (std::vector<std::string>{"g.zarr", "one.ply", "ranks.ply"}));
    fs::remove(path("ranks.ply"));
    fs::remove(path("one.ply"));
  }
}

TEST_F(Mpi, EveryFormatAndFilterIsThatOfOneProcess) {
  for (const Arguments& form : {Arguments{"m.vtp"},
                                {"m.glb", "--quantize", "--simplify", "50%"},
                                {"m.ply", "--largest", "1", "--measure"}}) {
    const Arguments more(form.begin() + 1, form.end());
    run_json(extract("one_" + form[0], more));
    mpirun_json(2, extract("ranks_" + form[0], more));
    EXPECT_TRUE(read_file(path("ranks_" + form[0])) == read_file(path("one_" + form[0])))
        << form[0];
  }
}

TEST_F(Mpi, RanksWriteThePartsOfAPvtp) {
  const auto content = [&](const std::string& folder) {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(path(folder)))
      if (entry.is_regular_file())
        files[fs::relative(entry.path(), path(folder)).string()] = read_file(entry.path());
    return files;
  };
  for (const char* folder : {"one", "ranks"}) fs::create_directory(path(folder));
  run_json(extract("one/m.pvtp"));
  const auto made = mpirun_json(3, extract("ranks/m.pvtp"));
  const auto whole = content("one");
  EXPECT_EQ(whole.size(), 2u);
  EXPECT_TRUE(content("ranks") == whole);
  // What is there already is refused, once.
  const Outcome again = mpirun(2, extract("ranks/m.pvtp"));
  EXPECT_EQ(own_lines(again.err).size(), 1u) << again.err;
  EXPECT_TRUE(content("ranks") == whole);
}

TEST_F(Mpi, SeveralIsovaluesAreSeveralMeshes) {
  const Arguments words{"extract", path("g.zarr"), "--isovalue", "90,120", "-o"};
  const auto with = [&](const std::string& name) {
    Arguments all = words;
    all.push_back(path(name));
    return all;
  };
  run_json(with("one.ply"));
  mpirun_json(3, with("ranks.ply"));
  for (const char* isovalue : {"90", "120"})
    EXPECT_TRUE(read_file(path(fmt::format("ranks_{}.ply", isovalue))) ==
                read_file(path(fmt::format("one_{}.ply", isovalue))));
}

TEST_F(Mpi, LabelsAreTheFolderOfOneProcess) {
  run_json(
      {"synth", "cells", path("c.zarr"), "--dims", "150,130,90", "--type", "u16", "--brick", "32"});
  for (const Arguments& more :
       {Arguments{}, {"--smooth", "2", "--simplify", "30%", "--format", "stl"}}) {
    const auto words = [&](const std::string& folder) {
      Arguments all{"extract", path("c.zarr"), "--labels", "all", "-o", path(folder)};
      all.insert(all.end(), more.begin(), more.end());
      return all;
    };
    const auto one = run_json(words("one"));
    const auto made = mpirun_json(3, words("ranks"));
    EXPECT_EQ(made["ranks"]["total"], 3);
    EXPECT_GE(made["pieces"]["total"], 3);
    for (const std::string member : {"labels", "triangles", "vertices", "output_bytes"})
      EXPECT_EQ(made[member], one[member]) << member;
    std::size_t compared = 0;
    for (const auto& entry : fs::directory_iterator(path("one"))) {
      ++compared;
      EXPECT_TRUE(read_file(entry.path()) == read_file(path("ranks") / entry.path().filename()))
          << entry.path();
    }
    EXPECT_GT(compared, 20u);
    EXPECT_EQ(files(), (std::vector<std::string>{"c.zarr", "g.zarr", "one", "ranks"}));
    fs::remove_all(path("one"));
    fs::remove_all(path("ranks"));
  }
  // One line, of the first rank that fails.
  const Outcome refused =
      mpirun(2, {"extract", path("c.zarr"), "--labels", "60000", "-o", path("never")});
  EXPECT_NE(refused.exit_code, 0);
  EXPECT_NE(refused.err.find("has no label 60000"), std::string::npos) << refused.err;
  EXPECT_EQ(own_lines(refused.err).size(), 1u) << refused.err;
  EXPECT_FALSE(fs::exists(path("never")));
}

TEST_F(Mpi, ConvertMakesTheStoreOfOneProcess) {
  // Two units, of 512 samples along x.
  write_file(path("v.raw"), noise(std::size_t{600} * 20 * 20));
  const Arguments form{"--dims", "600,20,20", "--type", "u8"};
  const auto convert = [&](const std::string& name) {
    Arguments words{"convert", path("v.raw"), path(name)};
    words.insert(words.end(), form.begin(), form.end());
    return words;
  };
  run_json(convert("one.zarr"));
  const auto made = mpirun_json(2, convert("ranks.zarr"));
  EXPECT_EQ(made["ranks"]["total"], 2);
  std::size_t compared = 0;
  for (const auto& entry : fs::recursive_directory_iterator(path("one.zarr")))
    if (entry.is_regular_file()) {
      ++compared;
      EXPECT_TRUE(read_file(entry.path()) ==
                  read_file(path("ranks.zarr") / fs::relative(entry.path(), path("one.zarr"))))
          << entry.path();
    }
  EXPECT_GT(compared, 5u);
  EXPECT_EQ(files(), (std::vector<std::string>{"g.zarr", "one.zarr", "ranks.zarr", "v.raw"}));
}

class MpiIndex : public Mpi {
 protected:
  void SetUp() override {
    Mpi::SetUp();
    if (IsSkipped()) return;
    // Two parts, and two chunks along x. The image is one of another program, without ranges.
    run_json({"synth", "gyroid", path("x.zarr"), "--dims", "530,200,160", "--type", "u8"});
    nlohmann::json root = nlohmann::json::parse(read_file(path("x.zarr/zarr.json")));
    root["attributes"].erase("isobrick");
    write_file(path("x.zarr/zarr.json"), root.dump());
    fs::remove_all(path("x.zarr/isobrick"));
    fs::remove_all(path("g.zarr"));
  }

  std::string copy_of_store(const std::string& name) {
    for (const std::string& old : {path(name), path(name + ".index.parts")}) fs::remove_all(old);
    EXPECT_EQ(run_process({"cp", "-rp", path("x.zarr"), path(name)}).exit_code, 0);
    return path(name);
  }
  void expect_same_stores(const std::string& a, const std::string& b) {
    EXPECT_EQ(run_process({"diff", "-r", path(a), path(b)}).out, "");
  }
};

TEST_F(MpiIndex, IsThatOfOneProcess) {
  for (const std::string leaf : {"16", "4"}) {
    const auto one = run_json({"index", copy_of_store("one.zarr"), "--leaf", leaf});
    for (const int ranks : {1, 3}) {
      const auto made = mpirun_json(ranks, {"index", copy_of_store("ranks.zarr"), "--leaf", leaf});
      EXPECT_EQ(made.contains("ranks"), ranks > 1);
      EXPECT_EQ(made["level_bytes"], one["level_bytes"]);
      expect_same_stores("ranks.zarr", "one.zarr");
      EXPECT_EQ(files(), (std::vector<std::string>{"one.zarr", "ranks.zarr", "x.zarr"}));
    }
  }
  // A store that has ranges, and an index to replace.
  run_json({"index", path("one.zarr"), "--leaf", "8", "--force"});
  mpirun_json(3, {"index", path("ranks.zarr"), "--leaf", "8", "--force"});
  expect_same_stores("ranks.zarr", "one.zarr");
  const Outcome again = mpirun(3, {"index", path("ranks.zarr"), "--leaf", "8"});
  EXPECT_EQ(again.exit_code, 2);
  EXPECT_NE(again.err.find("has the octree index already; --force"), std::string::npos)
      << again.err;
  const Outcome alone =
      mpirun(2, {"index", path("ranks.zarr"), "--mpi", "off", "--part", "1/1", "--force"});
  EXPECT_EQ(alone.exit_code, 0) << alone.err;
}

/// One rank makes lists of labels, and the others wait for it.
TEST_F(Mpi, ListsOfLabelsAreThoseOfOneProcess) {
  for (const char* name : {"one.zarr", "ranks.zarr"})
    run_json({"synth", "cells", path(name), "--dims", "80,70,60", "--type", "u16"});
  run_json({"index", path("one.zarr"), "--kind", "labels"});
  const auto made = mpirun_json(3, {"index", path("ranks.zarr"), "--kind", "labels"});
  EXPECT_EQ(made["kind"], "labels");
  EXPECT_EQ(run_process({"diff", "-r", path("one.zarr"), path("ranks.zarr")}).out, "");
}

/// A rank is killed at one of its renames and removals: the job ends, the store has no index and no
/// ranges or all of them, and the same command goes on.
TEST_F(MpiIndex, AKilledRankEndsTheJob) {
  run_json({"index", copy_of_store("one.zarr"), "--leaf", "4"});
  int killed = 0;
  for (const int first : {0, 1})
    for (const int at : {0, 2, 8}) {
      const Arguments index{"index", copy_of_store("ranks.zarr"), "--leaf", "4", "--threads", "1"};
      const Arguments kill{"env", std::string("LD_PRELOAD=") + ISOBRICK_KILL_AT_LIBRARY,
                           fmt::format("ISOBRICK_KILL_AT={}", at)};
      // mpirun of one rank that is killed and one that is not, in either order.
      Arguments words = launch(1);
      words.pop_back();
      for (const bool is_first : {true, false}) {
        if (is_first == (first == 0)) words.insert(words.end(), kill.begin(), kill.end());
        words.push_back(ISOBRICK_PROGRAM);
        words.insert(words.end(), index.begin(), index.end());
        if (is_first) words.insert(words.end(), {":", "-n", "1"});
      }
      const Outcome outcome = run_process(words);
      if (outcome.exit_code != 0) {
        ++killed;
        EXPECT_EQ(outcome.exit_code, 128 + SIGKILL) << outcome.err;
        EXPECT_EQ(run({"info", path("ranks.zarr")}).exit_code, 0);
        if (fs::exists(path("ranks.zarr/isobrick/ranges.json"))) {
          EXPECT_EQ(run({"verify", path("ranks.zarr")}).exit_code, 0);
        }
        const Outcome again = mpirun(2, index);
        if (again.exit_code != 0) {  // nothing was left to do
          EXPECT_NE(again.err.find("has the octree index already"), std::string::npos) << again.err;
        }
      }
      expect_same_stores("ranks.zarr", "one.zarr");
      EXPECT_FALSE(fs::exists(path("ranks.zarr.index.parts"))) << at;
    }
  EXPECT_GT(killed, 2);
}

TEST_F(Mpi, AFailureIsReportedOnce) {
  write_file(path("there.ply"), "mine");
  const struct {
    Arguments words;
    int exit_code;
    std::string line;
  } cases[] = {
      {extract("there.ply"), 2, "there.ply' exists already"},
      {{"extract", path("none.zarr"), "--isovalue", "1", "-o", path("m.ply")},
       1,
       "nothing has that name"},
      {extract("m.ply", {"--preview", path("m.png")}), 2, "--preview"},
      {{"extract", path("g.zarr"), "--isovalue", "120", "-o", "-"}, 2, "name a file"},
      {{"convert", "-", path("s.zarr"), "--dims", "2,2,2", "--type", "u8"}, 2, "not a stream"}};
  for (const auto& [words, exit_code, line] : cases) {
    const Outcome outcome = mpirun(3, words);
    EXPECT_EQ(outcome.exit_code, exit_code) << outcome.err;
    const std::vector<std::string> lines = own_lines(outcome.err);
    ASSERT_GE(lines.size(), 1u) << outcome.err;
    EXPECT_NE(lines.front().find(line), std::string::npos) << outcome.err;
    EXPECT_EQ(std::count_if(lines.begin(), lines.end(),
                            [&](const std::string& l) { return l.find(line) != l.npos; }),
              1)
        << outcome.err;
  }
  EXPECT_EQ(read_file(path("there.ply")), "mine");
  EXPECT_EQ(files(), (std::vector<std::string>{"g.zarr", "there.ply"}));
}

TEST_F(Mpi, ADamagedBrickEndsTheJob) {
  for (const auto& entry : fs::recursive_directory_iterator(path("g.zarr/0/c")))
    if (entry.is_regular_file()) {
      std::string bytes = read_file(entry.path());
      for (std::size_t i = bytes.size() / 4; i < bytes.size() / 4 + 64; ++i) bytes[i] ^= 0x55;
      write_file(entry.path(), bytes);
    }
  const Outcome outcome = mpirun(3, extract("m.ply"));
  EXPECT_EQ(outcome.exit_code, 1);
  const std::vector<std::string> lines = own_lines(outcome.err);
  ASSERT_GE(lines.size(), 1u) << outcome.err;
  EXPECT_NE(lines.front().find(": rank "), std::string::npos) << lines.front();
  EXPECT_NE(lines.front().find("brick ("), std::string::npos) << lines.front();
  EXPECT_FALSE(fs::exists(path("m.ply")));
}

/// A rank is killed at one of its renames and removals: the job ends, and the same command goes on.
TEST_F(Mpi, AKilledRankEndsTheJobAndThePiecesAreKept) {
  run_json(extract("one.ply"));
  int killed = 0;
  std::uint64_t kept = 0;
  for (const int at : {1, 3, 5}) {
    Arguments words = launch(1);
    const Arguments arguments = extract("m.ply", {"--resume"});
    words.insert(words.end(), arguments.begin(), arguments.end());
    const Arguments other{":",
                          "-n",
                          "1",
                          "env",
                          std::string("LD_PRELOAD=") + ISOBRICK_KILL_AT_LIBRARY,
                          fmt::format("ISOBRICK_KILL_AT={}", at),
                          ISOBRICK_PROGRAM};
    words.insert(words.end(), other.begin(), other.end());
    words.insert(words.end(), arguments.begin(), arguments.end());
    const Outcome outcome = run_process(words);
    if (outcome.exit_code == 0) {
      fs::remove(path("m.ply"));
      continue;
    }
    ++killed;
    EXPECT_EQ(outcome.exit_code, 128 + SIGKILL) << outcome.err;
    if (fs::exists(path("m.ply"))) {  // MPI removes files of its own at the end
      EXPECT_TRUE(read_file(path("m.ply")) == read_file(path("one.ply")));
      fs::remove(path("m.ply"));
    }
    const auto made = mpirun_json(2, extract("m.ply", {"--resume"}));
    kept += made["surfaces"][0]["pieces"]["kept"].get<std::uint64_t>();
    EXPECT_TRUE(read_file(path("m.ply")) == read_file(path("one.ply")));
    EXPECT_EQ(files(), (std::vector<std::string>{"g.zarr", "m.ply", "one.ply"})) << at;
    fs::remove(path("m.ply"));
  }
  EXPECT_GT(killed, 1);
  EXPECT_GT(kept, 0u);
}

TEST_F(Mpi, WithoutItEachRankWorksAlone) {
  const Outcome outcome =
      mpirun(2, {"extract", path("g.zarr"), "--isovalue", "120", "--estimate", "--json"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(std::count(outcome.out.begin(), outcome.out.end(), '\n'), 2);
  const auto parts = mpirun(1, extract("m.ply", {"--mpi", "off"}));
  EXPECT_EQ(parts.exit_code, 0) << parts.err;
  expect_refused(run(extract("n.ply", {"--mpi", "on"})), 2, {"--mpi", "auto or off"});
}

}  // namespace
}  // namespace isobrick::test
