#include "tests/tools/program.h"

// The program reads stores in zips that others have made, and writes such zips.
namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class ZippedStore : public ProgramTest, public testing::WithParamInterface<std::string> {
 protected:
  /// A zip of a store, made as the documents say, or by Python.
  std::string zip_of(const std::string& store) {
    const std::string zip = store + ".zip";
    const std::string python =
        "import os, sys, zipfile\n"
        "store, out = sys.argv[1:]\n"
        "with zipfile.ZipFile(out, 'w') as zip:\n"
        "  for folder, _, names in os.walk(store):\n"
        "    for name in names:\n"
        "      file = os.path.join(folder, name)\n"
        "      zip.write(file, os.path.relpath(file, os.path.dirname(store)))\n";
    if (GetParam() == "python3")
      EXPECT_EQ(run_process({"python3", "-c", python, store, zip}).exit_code, 0);
    else
      shell("cd \"$0\" && zip -q -0 -r \"$1\" .", store, zip);
    return zip;
  }
  static void shell(const std::string& script, const std::string& folder, const std::string& zip) {
    const Outcome outcome = run_process({"sh", "-c", script, folder, zip});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  }
  std::string mesh(const std::string& input, const Arguments& more = {}) {
    Arguments arguments{"extract", input, "--isovalue", "128", "-o", path("m.ply"), "--force"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_EQ(outcome.err, "");
    return read_file(path("m.ply"));
  }
  void SetUp() override {
    if (!available(GetParam())) GTEST_SKIP() << "no " << GetParam();
  }
};

TEST_P(ZippedStore, IsReadByEveryCommandThatReadsAStore) {
  const std::string store = make_store("a", {"--build-index", "octree"}), zip = zip_of(store);
  const std::string expected = mesh(store);
  EXPECT_TRUE(mesh(zip) == expected);
  EXPECT_TRUE(mesh(zip, {"--search", "octree"}) == expected);
  EXPECT_EQ(run({"verify", zip}).exit_code, 0);
  nlohmann::json info = run_json({"info", zip, "--stats"}),
                 other = run_json({"info", store, "--stats"});
  EXPECT_GT(info["bytes"], other["bytes"]);
  for (const char* key : {"extent", "levels", "histogram", "indexes", "value_range"})
    EXPECT_EQ(info[key], other[key]) << key;
  ASSERT_EQ(run({"export", zip, path("x.raw")}).exit_code, 0);
  ASSERT_EQ(run({"export", store, path("y.raw")}).exit_code, 0);
  EXPECT_TRUE(read_file(path("x.raw")) == read_file(path("y.raw")));
  ASSERT_EQ(run({"convert", zip, path("b.zarr")}).exit_code, 0);
  EXPECT_TRUE(mesh(path("b.zarr")) == expected);
}

TEST_P(ZippedStore, IsNamedInMessagesAndNotChanged) {
  const std::string zip = zip_of(make_store("a")), before = read_file(zip);
  expect_refused(run({"index", zip}), 2, {"a.zarr.zip' is a zip, which cannot be changed"});
  expect_refused(
      run({"extract", zip, "--isovalue", "128", "--search", "octree", "-o", path("m.ply")}), 2,
      {"unpack ", "a.zarr.zip", "isobrick index FOLDER --kind octree"});
  expect_refused(run({"export", zip, zip, "--format", "raw", "--force"}), 2, {"a.zarr.zip"});
  EXPECT_TRUE(read_file(zip) == before);
  write_file(zip, before.substr(0, before.size() / 2));
  expect_refused(run({"info", zip}), 1, {"a.zarr.zip' is a damaged zip"});
  EXPECT_EQ(run({"verify", zip}).exit_code, 1);
}

INSTANTIATE_TEST_SUITE_P(Makers, ZippedStore, testing::Values("zip", "python3"),
                         [](const auto& maker) { return maker.param; });

TEST_F(ProgramTest, ACompressedZipIsRefusedWithTheCommandThatMakesAnother) {
  if (!available("zip")) GTEST_SKIP() << "no zip";
  const std::string store = make_store("a");
  ASSERT_EQ(run_process({"sh", "-c", "cd \"$0\" && zip -q -9 -r ../a.zarr.zip .", store}).exit_code,
            0);
  expect_refused(run({"info", path("a.zarr.zip")}), 1, {"is compressed", "zip -0 -r"});
}

/// A store of 40 × 41 × 42 samples of noise, as a folder and as a zip by two ways.
class ZipOutput : public ProgramTest {
 protected:
  void SetUp() override { write_file(path("a.raw"), noise(40 * 41 * 42)); }

  Outcome convert(const std::string& out, const Arguments& more = {}) {
    Arguments arguments{"convert", path("a.raw"), out,       "--dims", "40,41,42",
                        "--type",  "u8",          "--brick", "16",     "--build-index",
                        "octree",  "--threads",   "2"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  std::string mesh(const std::string& input) {
    EXPECT_EQ(run({"extract", input, "--isovalue", "128", "--search", "octree", "-o", path("m.ply"),
                   "--force"})
                  .exit_code,
              0);
    return read_file(path("m.ply"));
  }
};

TEST_F(ZipOutput, HoldsTheStoreWhateverWritesIt) {
  ASSERT_EQ(convert(path("a.zarr")).exit_code, 0);
  ASSERT_EQ(convert(path("b.zarr.zip")).exit_code, 0);
  const Outcome exported = run({"export", path("a.zarr"), path("c.zip")});
  ASSERT_EQ(exported.exit_code, 0) << exported.err;
  const Outcome streamed = run({"export", path("a.zarr"), "-o", "-", "--format", "zip"});
  ASSERT_EQ(streamed.exit_code, 0) << streamed.err;
  const std::string zip = read_file(path("c.zip"));
  EXPECT_TRUE(read_file(path("b.zarr.zip")) == zip);
  EXPECT_TRUE(streamed.out == zip);
  EXPECT_LT(zip.find("zarr.json"), zip.find("c/0/0/0"));
  EXPECT_EQ(files(), (std::vector<std::string>{"a.raw", "a.zarr", "b.zarr.zip", "c.zip"}));
  EXPECT_EQ(run({"verify", path("b.zarr.zip")}).exit_code, 0);
  EXPECT_TRUE(mesh(path("b.zarr.zip")) == mesh(path("a.zarr")));
  // A zip of a zip is the same again.
  ASSERT_EQ(run({"export", path("c.zip"), path("d.zip")}).exit_code, 0);
  EXPECT_TRUE(read_file(path("d.zip")) == zip);
}

TEST_F(ZipOutput, IsWhatOthersRead) {
  if (!available("python3")) GTEST_SKIP() << "no python3";
  ASSERT_EQ(convert(path("a.zarr")).exit_code, 0);
  ASSERT_EQ(convert(path("a.zarr.zip")).exit_code, 0);
  const std::string python =
      "import os, sys, zipfile\n"
      "store, file = sys.argv[1:]\n"
      "found = {os.path.relpath(os.path.join(d, n), store)"
      " for d, _, names in os.walk(store) for n in names}\n"
      "with zipfile.ZipFile(file) as zip:\n"
      "  assert zip.testzip() is None\n"
      "  assert set(zip.namelist()) == found, found ^ set(zip.namelist())\n"
      "  for n in found:\n"
      "    assert zip.read(n) == open(os.path.join(store, n), 'rb').read(), n\n"
      "    assert zip.getinfo(n).compress_type == zipfile.ZIP_STORED\n";
  const Outcome outcome =
      run_process({"python3", "-c", python, path("a.zarr"), path("a.zarr.zip")});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
}

TEST_F(ZipOutput, ReplacesOnlyWithForceAndNeverItsInput) {
  ASSERT_EQ(convert(path("a.zarr.zip")).exit_code, 0);
  const std::string zip = read_file(path("a.zarr.zip"));
  expect_refused(convert(path("a.zarr.zip")), 2, {"a.zarr.zip' exists", "--force"});
  EXPECT_EQ(convert(path("a.zarr.zip"), {"--force"}).exit_code, 0);
  EXPECT_TRUE(read_file(path("a.zarr.zip")) == zip);
  expect_refused(run({"export", path("a.zarr.zip"), path("a.zarr.zip"), "--force"}), 2,
                 {"a.zarr.zip"});
  expect_refused(run({"convert", path("a.zarr.zip"), path("a.zarr.zip"), "--force"}), 2,
                 {"a.zarr.zip"});
  ASSERT_EQ(run({"export", path("a.zarr.zip"), path("x.zip")}).exit_code, 0);
  expect_refused(run({"export", path("a.zarr.zip"), path("x.zip")}), 2, {"x.zip' exists"});
  EXPECT_TRUE(read_file(path("a.zarr.zip")) == zip);
  fs::create_directory(path("d.zip"));
  expect_refused(convert(path("d.zip"), {"--force"}), 2, {"d.zip' is a directory"});
}

TEST_F(ZipOutput, IsTheWholeStore) {
  ASSERT_EQ(convert(path("a.zarr")).exit_code, 0);
  for (const Arguments& part : {Arguments{"--level", "1"}, Arguments{"--roi", "0:3,0:3,0:3"},
                                Arguments{"--isovalue", "9"}}) {
    Arguments arguments{"export", path("a.zarr"), path("x.zip")};
    arguments.insert(arguments.end(), part.begin(), part.end());
    expect_refused(run(arguments), 2, {"a zip holds the whole store"});
  }
  expect_refused(run({"export", path("a.zarr"), path("x.zip"), "--format", "nrrd"}), 2, {"x.zip"});
  EXPECT_EQ(files(), (std::vector<std::string>{"a.raw", "a.zarr"}));
}

}  // namespace
}  // namespace isobrick::test
