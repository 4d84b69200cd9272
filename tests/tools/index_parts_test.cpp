#include <csignal>
#include <map>

#include <fmt/format.h>

#include "tests/tools/program.h"

// Parts of an index, made by commands of their own and joined: the store of one command.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class IndexPartsCommand : public ProgramTest {
 protected:
  using Files = std::map<std::string, std::string>;

  /// An image of another program, with levels and without ranges: x.zarr. Its copies keep the times
  /// of its files.
  void make_foreign_store(const std::string& dims) {
    run_json({"synth", "gyroid", path("x.zarr"), "--dims", dims, "--type", "u8", "--brick", "16",
              "--levels", "2"});
    nlohmann::json root = nlohmann::json::parse(read_file(path("x.zarr/zarr.json")));
    root["attributes"].erase("isobrick");
    write_file(path("x.zarr/zarr.json"), root.dump());
    fs::remove_all(path("x.zarr/isobrick"));
  }
  std::string copy_of_store(const std::string& name) {
    for (const std::string& old : {path(name), path(name + ".index.parts")}) fs::remove_all(old);
    EXPECT_EQ(run_process({"cp", "-rp", path("x.zarr"), path(name)}).exit_code, 0);
    return path(name);
  }
  static Arguments with(Arguments words, const Arguments& more) {
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  Files files_of(const std::string& name) const {
    Files all;
    for (const auto& entry : fs::recursive_directory_iterator(path(name)))
      if (entry.is_regular_file())
        all[fs::relative(entry.path(), path(name)).string()] = read_file(entry.path());
    return all;
  }
  /// Runs it until one of its renames and removals; whether it was killed.
  static bool runs_until(int at, const Arguments& arguments) {
    const Outcome outcome =
        run_process(with({"env", std::string("LD_PRELOAD=") + ISOBRICK_KILL_AT_LIBRARY,
                          fmt::format("ISOBRICK_KILL_AT={}", at), ISOBRICK_PROGRAM},
                         arguments));
    EXPECT_TRUE(outcome.signal == SIGKILL || outcome.exit_code == 0) << outcome.err;
    return outcome.signal == SIGKILL;
  }
};

TEST_F(IndexPartsCommand, BecomeTheIndexOfOneCommand) {
  make_foreign_store("600,50,40");
  const Arguments form{"--kind", "kdtree", "--leaf", "4", "--threads", "2"};
  const auto one = run_json(with({"index", copy_of_store("one.zarr")}, form));
  const std::string store = copy_of_store("parts.zarr");
  int files = 0;
  for (const std::string part : {"2/3", "3/3", "1/3"}) {
    const auto made = run_json(with({"index", store, "--part", part}, form));
    EXPECT_EQ(made["part"]["number"], part[0] - '0');
    EXPECT_EQ(made["part"]["count"], 3);
    EXPECT_EQ(made["ranges_added"], true);
    EXPECT_EQ(made["files"]["kept"], 0);
    EXPECT_EQ(made["level_bytes"].size(), 2u);
    files += made["files"]["total"].get<int>();
    const auto again = run_json(with({"index", store, "--part", part}, form));
    EXPECT_EQ(again["files"]["kept"], made["files"]["total"]);
  }
  EXPECT_EQ(files, one["files"]["total"]);
  auto joined = run_json(with({"index", store, "--join", "3"}, form));
  for (const char* member : {"kind", "leaf", "bytes", "level_bytes", "ranges_added"})
    EXPECT_EQ(joined[member], one[member]) << member;
  EXPECT_FALSE(joined.contains("part"));
  EXPECT_TRUE(files_of("parts.zarr") == files_of("one.zarr"));
  EXPECT_EQ(this->files(), (std::vector<std::string>{"one.zarr", "parts.zarr", "x.zarr"}));
}

TEST_F(IndexPartsCommand, WithoutWorkThereAreNoFiles) {
  const std::string store = make_store("a");
  const Outcome made = run({"index", store, "--part", "1/2"});
  EXPECT_EQ(made.exit_code, 0);
  EXPECT_NE(made.out.find("nothing to do before --join"), std::string::npos) << made.out;
  EXPECT_EQ(files(), std::vector<std::string>{"a.zarr"});
  run_json({"index", store, "--join", "2"});
  EXPECT_EQ(run({"verify", store}).exit_code, 0);
}

TEST_F(IndexPartsCommand, WhatCannotBeIsRefused) {
  make_foreign_store("70,50,40");
  const std::string store = path("x.zarr");
  const auto before = files_of("x.zarr");
  for (const std::string part : {"0/2", "3/2", "1", "a/2", "1/0", "1/1000001", "-1/2", "1/2/3"})
    expect_refused(run({"index", store, "--part", part}), 2, {"--part"});
  for (const std::string parts : {"0", "-1", "x", "1000001"})
    expect_refused(run({"index", store, "--join", parts}), 2, {"--join"});
  expect_refused(run({"index", store, "--part", "1/2", "--join", "2"}), 2, {"not both at once"});
  expect_refused(run({"index", store, "--part", "1/2", "--memory", "1M"}), 2, {"memory budget"});
  expect_refused(run({"index", path("none.zarr"), "--part", "1/2"}), 1, {"none.zarr"});
  expect_refused(run({"index", "https://localhost:1/a.zarr", "--part", "1/2"}), 2, {"URL"});
  expect_refused(run({"index", store, "--join", "2"}), 2,
                 {"has no whole parts 1, 2 of the store as it is now", "--part 1/2"});
  EXPECT_TRUE(files_of("x.zarr") == before);
  run_json({"index", store, "--part", "2/2"});
  expect_refused(run({"index", store, "--join", "2"}), 2, {"has no whole part 1 of the store"});
  run_json({"index", store, "--part", "1/2"});
  run_json({"index", store + "/", "--join", "2"});
  expect_refused(run({"index", store, "--part", "1/2"}), 2,
                 {"has the octree index already; --force"});
  EXPECT_EQ(files(), std::vector<std::string>{"x.zarr"});
}

TEST_F(IndexPartsCommand, AStoreThatChangedBetweenPartsIsRefused) {
  make_foreign_store("70,50,40");
  const std::string store = path("x.zarr");
  for (const std::string leaf : {"16", "4"}) {
    run_json({"index", store, "--leaf", leaf, "--part", "1/2"});
    for (const auto& entry : fs::recursive_directory_iterator(store + "/0/c"))
      if (entry.is_regular_file()) {
        write_file(entry.path(), read_file(entry.path()));
        break;
      }
    run_json({"index", store, "--leaf", leaf, "--part", "2/2"});
    expect_refused(run({"index", store, "--leaf", leaf, "--join", "2"}), 2,
                   {"has no whole part 1 of the store as it is now"});
  }
  EXPECT_FALSE(fs::exists(store + "/isobrick/ranges.json"));
}

/// A part and a join that are killed at any of their renames and removals.
TEST_F(IndexPartsCommand, ThatAreKilledAreRepeated) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer's library wants to be the first one";
#endif
  make_foreign_store("600,40,20");
  for (const std::string leaf : {"16", "8"}) {
    const Arguments form{"--leaf", leaf, "--threads", "1"};
    run_json(with({"index", copy_of_store("one.zarr")}, form));
    const Files expected = files_of("one.zarr");
    const auto part = [&](const std::string& number) {
      return with({"index", path("parts.zarr"), "--part", number + "/2"}, form);
    };
    const Arguments joining = with({"index", path("parts.zarr"), "--join", "2"}, form);
    int at = 0;
    for (bool killed = true; killed; ++at) {
      copy_of_store("parts.zarr");
      killed = runs_until(at, part("1"));
      EXPECT_EQ(run(part("2")).exit_code, 0) << at;
      if (killed) {
        // What a killed task left is repeated, unless it was whole.
        const Outcome outcome = run(joining);
        if (outcome.exit_code != 0) {
          expect_refused(outcome, 2, {"has no whole part 1 of"});
          EXPECT_EQ(run(part("1")).exit_code, 0) << at;
          EXPECT_EQ(run(joining).exit_code, 0) << at;
        }
      } else {
        EXPECT_EQ(run(joining).exit_code, 0) << at;
      }
      EXPECT_TRUE(files_of("parts.zarr") == expected) << leaf << ' ' << at;
      EXPECT_FALSE(fs::exists(path("parts.zarr.index.parts"))) << leaf << ' ' << at;
    }
    EXPECT_GT(at, leaf == "16" ? 1 : 3);
    at = 0;
    for (bool killed = true; killed; ++at) {
      copy_of_store("parts.zarr");
      for (const char* number : {"1", "2"}) EXPECT_EQ(run(part(number)).exit_code, 0);
      killed = runs_until(at, joining);
      EXPECT_EQ(run({"info", path("parts.zarr")}).exit_code, 0) << at;
      // Whatever was left to do, the tasks may run once more.
      for (const char* number : {"2", "1"})
        if (fs::exists(path("parts.zarr.index.parts"))) {
          EXPECT_EQ(run(part(number)).exit_code, 0) << leaf << ' ' << at;
        }
      const Outcome again = run(joining);
      EXPECT_EQ(again.exit_code, 0) << leaf << ' ' << at;
      EXPECT_FALSE(fs::exists(path("parts.zarr.index.parts"))) << leaf << ' ' << at;
      EXPECT_TRUE(files_of("parts.zarr") == expected) << leaf << ' ' << at << again.err;
    }
    EXPECT_GT(at, 20);
  }
}

}  // namespace
}  // namespace isobrick::test
