#include <array>
#include <csignal>
#include <map>
#include <set>

#include <fmt/format.h>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

using Tree = std::map<std::string, std::string>;

Tree tree(const std::string& folder) {
  Tree files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file())
      files[fs::relative(entry.path(), folder).string()] = read_file(entry.path());
  return files;
}

void copy_anew(const fs::path& from, const fs::path& to) {
  fs::remove_all(to);
  fs::copy(from, to, fs::copy_options::recursive);
}

/// What a user does after a process was killed at any of its renames and removals.
class Killed : public ProgramTest {
 protected:
  Killed() {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    skipped_ = true;  // a sanitizer's library wants to be the first one
#endif
    write_file(path("new.raw"), noise(20 * 20 * 20, 1));
    write_file(path("old.raw"), noise(20 * 20 * 20, 2));
  }

  Arguments convert(const std::string& input, const Arguments& more) {
    Arguments all{"convert", path(input), path("out.zarr"), "--dims", "20,20,20",  "--type", "u8",
                  "--brick", "16",        "--levels",       "1",      "--threads", "1"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }

  /// Runs it until call `at`; whether it was killed.
  bool run_until(int at, const Arguments& arguments, bool exchange = true) {
    Arguments words{"env", std::string("LD_PRELOAD=") + ISOBRICK_KILL_AT_LIBRARY,
                    fmt::format("ISOBRICK_KILL_AT={}", at)};
    if (!exchange) words.push_back("ISOBRICK_NO_EXCHANGE=1");
    words.push_back(ISOBRICK_PROGRAM);
    words.insert(words.end(), arguments.begin(), arguments.end());
    const Outcome outcome = run_process(words);
    EXPECT_TRUE(outcome.signal == SIGKILL || outcome.exit_code == 0) << outcome.err;
    return outcome.signal == SIGKILL;
  }

  void succeeds(const Arguments& arguments, int at) {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << "killed at " << at << ": " << outcome.err;
  }

  void expect_only(const std::set<std::string>& names, int at) {
    const std::vector<std::string> there = files();
    EXPECT_EQ(std::set<std::string>(there.begin(), there.end()), names) << "killed at " << at;
  }

  /// The trees of a store of either input.
  Tree made_of(const std::string& input) {
    EXPECT_EQ(run(convert(input, {"--force"})).exit_code, 0);
    Tree made = tree(path("out.zarr"));
    fs::rename(path("out.zarr"), path("made of " + input));
    return made;
  }

  bool skipped_ = false;
};

TEST_F(Killed, AConversionIsResumed) {
  if (skipped_) GTEST_SKIP();
  const Tree expected = made_of("new.raw");
  int at = 0;
  for (bool killed = true; killed; ++at) {
    fs::remove_all(path("out.zarr"));
    killed = run_until(at, convert("new.raw", {}));
    const bool published = fs::exists(path("out.zarr"));
    const Outcome outcome = run(convert("new.raw", {"--resume"}));
    // Once nothing is left to do, it reports that.
    if (!published || outcome.exit_code == 0)
      EXPECT_EQ(outcome.exit_code, 0) << at << ": " << outcome.err;
    else
      expect_refused(outcome, 2, {"out.zarr' exists, so that there is nothing to resume"});
    EXPECT_TRUE(tree(path("out.zarr")) == expected) << at;
    expect_only({"made of new.raw", "new.raw", "old.raw", "out.zarr"}, at);
  }
  EXPECT_GT(at, 10);
}

TEST_F(Killed, AnotherInputIsNoticedUntilTheEnd) {
  if (skipped_) GTEST_SKIP();
  const std::string mine = read_file(path("new.raw")), other = read_file(path("old.raw"));
  for (int at = 0; run_until(at, convert("new.raw", {})); ++at) {
    write_file(path("new.raw"), other);
    const Outcome outcome = run(convert("new.raw", {"--resume"}));
    write_file(path("new.raw"), mine);
    if (outcome.exit_code == 1) {
      EXPECT_NE(outcome.err.find("is not the one"), std::string::npos) << outcome.err;
    }
    const bool whole = fs::exists(path("out.zarr"));
    if (whole) {
      EXPECT_EQ(run({"verify", path("out.zarr")}).exit_code, 0) << at;
    }
    fs::remove_all(path("out.zarr"));
    fs::remove_all(path("out.zarr.partial"));
  }
}

TEST_F(Killed, AReplacementGoesOn) {
  if (skipped_) GTEST_SKIP();
  const Tree expected = made_of("new.raw"), old = made_of("old.raw");
  const std::array<Arguments, 3> ways{Arguments{"--force"}, {"--resume", "--force"}, {"--resume"}};
  for (const bool exchange : {true, false}) {
    std::size_t at = 0;
    for (bool killed = true; killed; ++at) {
      // Every point in one way to go on, which differs between the two loops.
      const Arguments& again = ways[(at + exchange) % ways.size()];
      copy_anew(path("made of old.raw"), path("out.zarr"));
      killed = run_until(static_cast<int>(at), convert("new.raw", {"--force"}), exchange);
      if (exchange) {
        // One of the two stores is whole under its name at any time.
        EXPECT_EQ(run({"verify", path("out.zarr")}).exit_code, 0) << at;
      }
      const Outcome outcome = run(convert("new.raw", again));
      if (again == ways[2] && outcome.exit_code != 0) {
        expect_refused(outcome, 2, {"out.zarr' exists"});
        const bool goes_on = outcome.err.find("--resume --force goes on") != std::string::npos;
        EXPECT_EQ(goes_on, fs::exists(path("out.zarr.partial/.isobrick-layout.json"))) << at;
        succeeds(convert("new.raw", {"--resume", "--force"}), static_cast<int>(at));
      } else {
        EXPECT_EQ(outcome.exit_code, 0) << at << ": " << outcome.err;
      }
      EXPECT_TRUE(tree(path("out.zarr")) == expected) << at;
      expect_only({"made of new.raw", "made of old.raw", "new.raw", "old.raw", "out.zarr"},
                  static_cast<int>(at));
    }
    EXPECT_GT(at, 20U);
  }
}

TEST_F(Killed, AnIndexIsResumed) {
  if (skipped_) GTEST_SKIP();
  made_of("old.raw");
  const std::string store = path("made of old.raw");
  const Arguments index{"index", path("out.zarr"), "--kind", "octree", "--threads", "1"};
  const auto with = [&](const Arguments& more) {
    Arguments all = index;
    all.insert(all.end(), more.begin(), more.end());
    return all;
  };
  copy_anew(store, path("out.zarr"));
  succeeds(index, -1);
  const Tree expected = tree(path("out.zarr"));
  for (const bool exchange : {true, false})
    for (const bool replaces : {false, true}) {
      int at = 0;
      for (bool killed = true; killed; ++at) {
        copy_anew(store, path("out.zarr"));
        if (replaces) succeeds(with({"--leaf", "8"}), at);
        killed = run_until(at, with({"--force"}), exchange);
        EXPECT_EQ(run({"verify", path("out.zarr")}).exit_code, 0) << at;
        const Outcome outcome = run(with({"--resume"}));
        if (outcome.exit_code != 0) {
          EXPECT_TRUE(replaces);
          expect_refused(outcome, 2, {"has the octree index already; --force"});
          succeeds(with({"--resume", "--force"}), at);
        }
        EXPECT_TRUE(tree(path("out.zarr")) == expected) << replaces << ' ' << at;
      }
      EXPECT_GT(at, 2);
    }
}

class KilledMesh : public Killed {
 protected:
  KilledMesh() { make_store("a"); }

  Arguments extract(const std::string& output, const std::string& isovalue,
                    const Arguments& more = {}) {
    Arguments all{"extract", path("a.zarr"), "--isovalue", isovalue, "-o", path(output)};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }

  /// The bytes of all parts that the file names, which must be there.
  std::string parts_of(const std::string& name) {
    const std::string text = read_file(path(name));
    std::string bytes;
    for (std::size_t at = 0; (at = text.find("Source=\"", at)) != std::string::npos;) {
      at += 8;
      bytes += read_file(path(text.substr(at, text.find('"', at) - at)));
    }
    return bytes;
  }
};

TEST_F(KilledMesh, LeavesNothingForever) {
  if (skipped_) GTEST_SKIP();
  const std::set<std::string> before{"a.zarr", "new.raw", "old.raw"};
  for (const std::string name :
       {"m.ply", "m.stl", "m.vtp", "m.pvtp", "m.3dtiles", "m.neuroglancer"}) {
    // One may not be built.
    const bool possible = run(extract(name, "127")).exit_code == 0;
    for (const std::string& made : {name, name + ".parts"}) fs::remove_all(path(made));
    if (!possible && name == "m.neuroglancer") continue;
    std::set<std::string> after = before;
    after.insert(name);
    if (name == "m.pvtp") after.insert("m.pvtp.parts");
    bool killed = true;
    for (int at = 0; killed; ++at) {
      killed = run_until(at, extract(name, "127"));
      // Without --force: what a killed process left is no output.
      if (!fs::exists(path(name))) succeeds(extract(name, "127"), at);
      expect_only(after, at);
      for (const std::string& made : {name, name + ".parts"}) fs::remove_all(path(made));
    }
  }
  const Arguments exported{"export", path("a.zarr"), path("x.nrrd")};
  for (int at = 0; run_until(at, exported); ++at) {
    if (!fs::exists(path("x.nrrd"))) succeeds(exported, at);
    expect_only({"a.zarr", "new.raw", "old.raw", "x.nrrd"}, at);
    fs::remove(path("x.nrrd"));
  }
}

TEST_F(KilledMesh, RawSamplesAndTheirHeaderComeTogether) {
  if (skipped_) GTEST_SKIP();
  const Arguments exported{"export", path("a.zarr"), path("x.raw")};
  succeeds(exported, -1);
  const std::string samples = read_file(path("x.raw")), header = read_file(path("x.nhdr"));
  const std::set<std::string> after{"a.zarr", "new.raw", "old.raw", "x.nhdr", "x.raw"};
  int at = 0;
  for (bool killed = true; killed; ++at) {
    fs::remove(path("x.raw"));
    fs::remove(path("x.nhdr"));
    killed = run_until(at, exported);
    // Samples never lie there without their header.
    EXPECT_TRUE(!fs::exists(path("x.raw")) || fs::exists(path("x.nhdr"))) << at;
    if (!fs::exists(path("x.raw"))) succeeds(exported, at);
    expect_only(after, at);
    EXPECT_TRUE(read_file(path("x.raw")) == samples && read_file(path("x.nhdr")) == header) << at;
  }
  EXPECT_GT(at, 1);
  at = 0;
  for (bool killed = true; killed; ++at) {
    const Arguments part{"export", path("a.zarr"), path("x.raw"), "--roi", "0:9,0:9,:", "--force"};
    succeeds({"export", path("a.zarr"), path("x.raw"), "--force"}, at);
    killed = run_until(at, part);
    // A run that is refused removes what the other one left, too.
    if (killed && fs::exists(path("x.raw")) && fs::exists(path("x.nhdr"))) {
      expect_refused(run(exported), 2, {"exists already"});
      expect_only(after, at);
    }
    succeeds(part, at);
    expect_only(after, at);
    EXPECT_LT(fs::file_size(path("x.raw")), samples.size());
  }
}

TEST_F(KilledMesh, AHeaderOfOtherSamplesStays) {
  write_file(path("x.nhdr"), "mine");
  expect_refused(run({"export", path("a.zarr"), path("x.raw")}), 2, {"x.nhdr", "exists already"});
  EXPECT_EQ(read_file(path("x.nhdr")), "mine");
}

TEST_F(KilledMesh, AFileOfAUserWithSuchANameStays) {
  write_file(path("m.ply.partial-2024-11"), "mine");
  write_file(path("m.ply.partial-2024-11-12345678"), "mine");
  succeeds(extract("m.ply", "127"), -1);
  EXPECT_EQ(read_file(path("m.ply.partial-2024-11")), "mine");
  EXPECT_EQ(read_file(path("m.ply.partial-2024-11-12345678")), "mine");
}

TEST_F(KilledMesh, PartsAreAlwaysThoseOfTheirFile) {
  if (skipped_) GTEST_SKIP();
  succeeds(extract("m.pvtp", "120"), -1);
  const std::string old = parts_of("m.pvtp");
  succeeds(extract("n.pvtp", "140"), -1);
  const std::string expected = parts_of("n.pvtp");
  ASSERT_NE(old, "");
  ASSERT_NE(old, expected);
  int at = 0;
  bool seen_old = false, seen_new = false;
  for (bool killed = true; killed; ++at) {
    succeeds(extract("m.pvtp", "120", {"--force"}), at);
    killed = run_until(at, extract("m.pvtp", "140", {"--force"}));
    const std::string found = parts_of("m.pvtp");
    EXPECT_TRUE(found == old || found == expected) << at;
    (found == old ? seen_old : seen_new) = true;
    succeeds(extract("m.pvtp", "140", {"--force"}), at);
    EXPECT_TRUE(parts_of("m.pvtp") == expected) << at;
    EXPECT_EQ(files().size(), 7u) << at;  // a.zarr, two inputs, two meshes with their parts
  }
  EXPECT_TRUE(seen_old && seen_new);
}

/// Cells in a store, in place of the raw files.
class KilledLabels : public Killed {
 protected:
  void SetUp() override {
    if (skipped_) GTEST_SKIP();
    fs::remove(path("new.raw"));
    fs::remove(path("old.raw"));
    run_json({"synth", "cells", path("c.zarr"), "--dims", "40,40,40", "--type", "u8", "--brick",
              "16", "--levels", "1"});
  }
};

TEST_F(KilledLabels, ExtractionsGoOn) {
  const Arguments extract{"extract",   path("c.zarr"), "--labels",  "1:9", "-o",
                          path("out"), "--resume",     "--threads", "1",   "--json"};
  succeeds(extract, -1);
  const Tree expected = tree(path("out"));
  ASSERT_GT(expected.size(), 5u);
  fs::remove_all(path("out"));
  int at = 0, kept = 0;
  for (bool killed = true; killed; ++at) {
    killed = run_until(at, extract);
    if (fs::exists(path("out"))) {  // killed after all was there
      EXPECT_EQ(tree(path("out")), expected) << at;
      fs::remove_all(path("out"));
    }
    const Outcome again = run(extract);
    ASSERT_EQ(again.exit_code, 0) << "killed at " << at << ": " << again.err;
    kept += nlohmann::json::parse(again.out)["pieces"]["kept"].get<int>();
    EXPECT_EQ(tree(path("out")), expected) << at;
    expect_only({"c.zarr", "out"}, at);
    fs::remove_all(path("out"));
  }
  EXPECT_GT(at, 2);
  EXPECT_GT(kept, 0);
}

TEST_F(KilledLabels, PiecesAreMadeAnew) {
  const Arguments part{"extract", path("c.zarr"), "--labels",      "all",       "--part",
                       "1/2",     "-o",           path("a.piece"), "--threads", "1"};
  succeeds(part, -1);
  const std::string expected = read_file(path("a.piece"));
  int at = 0;
  for (bool killed = true; killed; ++at) {
    fs::remove(path("a.piece"));
    killed = run_until(at, part);
    EXPECT_TRUE(!fs::exists(path("a.piece")) || read_file(path("a.piece")) == expected) << at;
    succeeds(part, at);
    EXPECT_TRUE(read_file(path("a.piece")) == expected) << at;
    expect_only({"c.zarr", "a.piece"}, at);
  }
  EXPECT_GT(at, 1);
}

TEST_F(KilledLabels, ListsAreMadeWhole) {
  const Arguments index{"index", path("c.zarr"), "--kind", "labels", "--threads", "1"};
  const fs::path before = path("before.zarr");
  fs::copy(path("c.zarr"), before, fs::copy_options::recursive);
  succeeds(index, -1);
  const Tree expected = tree(path("c.zarr"));
  int at = 0;
  for (bool killed = true; killed; ++at) {
    copy_anew(before, path("c.zarr"));
    killed = run_until(at, index);
    EXPECT_EQ(run({"verify", path("c.zarr")}).exit_code, 0) << at;
    Arguments again = index;
    again.push_back("--resume");
    succeeds(again, at);
    EXPECT_EQ(tree(path("c.zarr")), expected) << at;
  }
  EXPECT_GT(at, 2);
}

}  // namespace
}  // namespace isobrick::test
