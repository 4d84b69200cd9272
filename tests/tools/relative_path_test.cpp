#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

/// Commands as users type them: in a folder, with names that are relative to it.
class RelativePath : public ProgramTest {
 protected:
  Outcome run_here(const Arguments& arguments) const { return run_in(".", arguments); }
  Outcome run_in(const std::string& folder, const Arguments& arguments) const {
    Arguments words{"env", "-C", path(folder), ISOBRICK_PROGRAM};
    words.insert(words.end(), arguments.begin(), arguments.end());
    return run_process(words);
  }
  void succeeds(const Arguments& arguments, const std::string& folder = ".") const {
    const Outcome outcome = run_in(folder, arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  }
};

TEST_F(RelativePath, IndexTakesAnyNameOfAStore) {
  make_store("scan");
  succeeds({"index", "scan.zarr", "--kind", "octree"});
  succeeds({"index", "scan.zarr/", "--kind", "kdtree"});
  succeeds({"index", "./scan.zarr//", "--kind", "quadtree"});
  succeeds({"index", ".", "--kind", "interval"}, "scan.zarr");
  succeeds({"index", "../scan.zarr", "--kind", "interval", "--force"}, "scan.zarr");
  succeeds({"verify", "scan.zarr"});
}

TEST_F(RelativePath, ConversionsTakeAnyName) {
  write_file(path("a.raw"), noise(20 * 20 * 20));
  const Arguments convert{"convert", "a.raw", "a.zarr",        "--dims", "20,20,20",
                          "--type",  "u8",    "--build-index", "octree"};
  const auto with = [&](Arguments words, const Arguments& more) {
    words.insert(words.end(), more.begin(), more.end());
    return words;
  };
  succeeds(convert);
  succeeds(with(convert, {"--force"}));
  succeeds(with(convert, {"--force", "--resume"}));
  fs::rename(path("a.zarr"), path("b.zarr"));
  succeeds(with(convert, {"--resume"}));
  const Arguments synth{"synth",  "gyroid", "./s.zarr/",     "--dims", "20,20,20",
                        "--type", "u8",     "--build-index", "kdtree"};
  succeeds(synth);
  succeeds(with(synth, {"--force"}));
  succeeds({"verify", "a.zarr"});
  succeeds({"verify", "s.zarr"});
  EXPECT_EQ(files(), (std::vector<std::string>{"a.raw", "a.zarr", "b.zarr", "s.zarr"}));
}

TEST_F(RelativePath, AnInterruptedIndexIsResumed) {
  make_store("scan");
  ASSERT_EQ(run_here({"index", "scan.zarr", "--kind", "octree"}).exit_code, 0);
  // As a kill right before the rename leaves it.
  const fs::path index = path("scan.zarr/isobrick/0/index/octree");
  fs::rename(index, index.string() + ".partial");
  succeeds({"index", "scan.zarr", "--kind", "octree", "--resume"});
  EXPECT_TRUE(fs::exists(index));
}

}  // namespace
}  // namespace isobrick::test
