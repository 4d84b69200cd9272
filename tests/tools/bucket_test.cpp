#include <algorithm>
#include <csignal>
#include <filesystem>
#include <memory>
#include <set>
#include <sstream>
#include <vector>

#include "tests/tools/http_server.h"
#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

/// Stores that are written to buckets. The bucket's objects are files in the folder "objects".
class Bucket : public ProgramTest {
 protected:
  void SetUp() override {
    if (!available("python3")) GTEST_SKIP() << "python3 is not there";
    fs::create_directories(path("objects"));
    fs::create_directories(path("tmp"));
    write_file(path("small.raw"), noise(90 * 80 * 70));
    server_ = std::make_unique<HttpServer>(path("objects"));
    ASSERT_GT(server_->port(), 0);
  }

  Outcome with_bucket(const Arguments& words, const std::string& secret = "s/e+cret",
                      const Surroundings& surroundings = {}) {
    Arguments all{"env",
                  "AWS_ENDPOINT_URL_S3=" + server_->url("", ""),
                  "AWS_ACCESS_KEY_ID=AKTEST",
                  "AWS_SECRET_ACCESS_KEY=" + secret,
                  "AWS_REGION=test-1",
                  "TMPDIR=" + path("tmp"),
                  ISOBRICK_PROGRAM};
    all.insert(all.end(), words.begin(), words.end());
    return run_process(all, surroundings);
  }
  /// Several shards and levels; each of a few kilobytes.
  Arguments small(const std::string& out) const {
    return {"convert", path("small.raw"), out,  "--dims",  "90,80,70", "--type",
            "u8",      "--brick",         "16", "--shard", "32",       "-q"};
  }
  /// One object of more than 16 MiB, which goes in parts where the memory is small.
  Arguments large(const std::string& out) {
    if (!fs::exists(path("large.raw"))) write_file(path("large.raw"), noise(300 * 256 * 256));
    return {"convert", path("large.raw"), out,    "--dims",   "300,256,256", "--type",
            "u8",      "--codec",         "none", "--memory", "64M",         "--shard",
            "512",     "--json"};
  }
  /// Whether two folders have the same files.
  static void expect_same_files(const fs::path& one, const fs::path& other) {
    const auto names = [](const fs::path& folder) {
      std::set<std::string> found;
      for (const auto& entry : fs::recursive_directory_iterator(folder))
        if (entry.is_regular_file()) found.insert(fs::relative(entry.path(), folder).string());
      return found;
    };
    EXPECT_EQ(names(one), names(other));
    for (const std::string& name : names(one)) {
      EXPECT_TRUE(read_file(one / name) == read_file(other / name)) << name;
    }
  }
  std::vector<std::string> lines(const std::string& name) {
    std::istringstream text(server_->get(name));
    std::vector<std::string> found;
    for (std::string line; std::getline(text, line);)
      if (!line.empty()) found.push_back(line);
    return found;
  }
  void expect_no_leftovers() {
    EXPECT_TRUE(fs::is_empty(path("tmp")));
    EXPECT_EQ(server_->get("uploads").substr(0, 2), "0 ");
  }

  std::unique_ptr<HttpServer> server_;
};

TEST_F(Bucket, HoldsTheFilesOfAFolder) {
  ASSERT_EQ(run(small(path("here.zarr"))).exit_code, 0);
  Outcome outcome = with_bucket(small("s3://bucket/a/there.zarr"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  expect_same_files(path("here.zarr"), path("objects/a/there.zarr"));
  const auto written = lines("written");
  EXPECT_GT(written.size(), 20u);
  EXPECT_EQ(written.back(), "a/there.zarr/zarr.json");
  expect_no_leftovers();
  outcome = with_bucket({"verify", "s3://bucket/a/there.zarr"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  // OME-Zarr 0.4 has other metadata.
  Arguments words = small("s3://bucket/v2.zarr");
  words.insert(words.end(), {"--ome", "0.4"});
  std::erase(words, "--shard");
  std::erase(words, "32");
  outcome = with_bucket(words);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(lines("written").back(), "v2.zarr/.zattrs");
  EXPECT_EQ(with_bucket({"verify", "s3://bucket/v2.zarr"}).exit_code, 0);
}

TEST_F(Bucket, LargeObjectsGoInParts) {
  ASSERT_EQ(run(large(path("here.zarr"))).exit_code, 0);
  for (const char* bucket : {"bucket", "bucket-busy", "bucket-reset", "bucket-late"}) {
    fs::remove_all(path("objects/large.zarr"));
    const Outcome outcome = with_bucket(large(std::string("s3://") + bucket + "/large.zarr"));
    ASSERT_EQ(outcome.exit_code, 0) << bucket << ": " << outcome.err;
    expect_same_files(path("here.zarr"), path("objects/large.zarr"));
    EXPECT_LE(nlohmann::json::parse(outcome.out).at("peak_resident_bytes"), 64 << 20) << bucket;
    expect_no_leftovers();
  }
  EXPECT_EQ(server_->get("uploads"), "0 4\n");
}

TEST_F(Bucket, BytesThatWaitForTheNetworkAreFew) {
  write_file(path("large.raw"), noise(640 * 320 * 320));
  Arguments words = large("s3://bucket-slow/large.zarr");
  *std::find(words.begin(), words.end(), "300,256,256") = "640,320,320";
  words.insert(words.end(), {"--levels", "1"});
  const Outcome outcome = with_bucket(words);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_LE(nlohmann::json::parse(outcome.out).at("peak_resident_bytes"), 64 << 20);
}

TEST_F(Bucket, AFailureLeavesNothingThatCanBeRead) {
  for (const char* bucket : {"bucket-denied", "bucket-false"}) {
    const std::string url = std::string("s3://") + bucket + "/large.zarr";
    Arguments words = large(url);
    words.back() = "-q";
    expect_refused(with_bucket(words), 1, {url, "cannot write"});
    EXPECT_FALSE(fs::exists(path("objects/large.zarr/zarr.json"))) << bucket;
    expect_no_leftovers();
    fs::remove_all(path("objects/large.zarr"));
  }
  expect_refused(with_bucket(small("s3://bucket/b.zarr"), "wrong"), 1,
                 {"s3://bucket/b.zarr", "403", "credentials"});
  EXPECT_TRUE(fs::is_empty(path("objects")));
}

TEST_F(Bucket, AnInterruptAbortsParts) {
  const Outcome outcome =
      with_bucket(large("s3://bucket-hang/large.zarr"), "s/e+cret", {.interrupt_after = 2});
  EXPECT_EQ(outcome.signal, SIGINT) << outcome.err;
  EXPECT_EQ(server_->get("uploads"), "0 0\n");
  EXPECT_FALSE(fs::exists(path("objects/large.zarr/zarr.json")));
  EXPECT_TRUE(fs::is_empty(path("tmp")));
}

TEST_F(Bucket, WhatIsThereIsReplacedByForceOnly) {
  const std::string url = "s3://bucket/s.zarr";
  Arguments first = small(url), second = small(url);
  first.insert(first.end(), {"--build-index", "octree"});
  second.insert(second.end(), {"-f", "--levels", "1"});
  ASSERT_EQ(with_bucket(first).exit_code, 0);
  const std::size_t before = lines("written").size();
  expect_refused(with_bucket(small(url)), 2, {url, "--force"});
  EXPECT_EQ(lines("written").size(), before);
  ASSERT_EQ(with_bucket(second).exit_code, 0);
  // The metadata of the root go first and come last.
  EXPECT_EQ(lines("written").at(before), "-s.zarr/zarr.json");
  EXPECT_EQ(lines("written").back(), "s.zarr/zarr.json");
  // No object of the old store is left.
  Arguments here = small(path("here.zarr"));
  here.insert(here.end(), {"--levels", "1"});
  ASSERT_EQ(run(here).exit_code, 0);
  expect_same_files(path("here.zarr"), path("objects/s.zarr"));
  // What an upload that ended early left counts as a store, too.
  fs::remove(path("objects/s.zarr/zarr.json"));
  expect_refused(with_bucket(small(url)), 2, {"--force"});
  ASSERT_EQ(with_bucket(second).exit_code, 0);
  // Things of others stay.
  write_file(path("objects/s.zarr/thesis.txt"), "all my work");
  expect_refused(with_bucket(second), 2, {"thesis.txt"});
  fs::remove(path("objects/s.zarr/thesis.txt"));
  write_file(path("objects/s.zarr/zarr.json"), R"({"zarr_format":3,"node_type":"group"})");
  expect_refused(with_bucket(second), 2, {"no store of Isobrick"});
  expect_no_leftovers();
}

TEST_F(Bucket, TakesExportedFiles) {
  ASSERT_EQ(run(small(path("here.zarr"))).exit_code, 0);
  for (const std::string name : {"a.nrrd", "a.raw", "a.vdb", "a.zarr.zip"}) {
    SCOPED_TRACE(name);
    const std::string url = "s3://bucket/exports/" + name;
    ASSERT_EQ(run({"export", path("here.zarr"), path(name), "-q"}).exit_code, 0);
    const Outcome outcome = with_bucket({"export", path("here.zarr"), url, "--json"});
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    const nlohmann::json made = nlohmann::json::parse(outcome.out);
    EXPECT_EQ(made.at("output"), url);
    EXPECT_EQ(made.at("bytes_out"), fs::file_size(path("objects/exports/" + name)));
    // OpenVDB gives each file an identifier of its own.
    if (name != "a.vdb") {
      EXPECT_TRUE(read_file(path("objects/exports/" + name)) == read_file(path(name)));
    }
    const std::size_t before = lines("written").size();
    expect_refused(with_bucket({"export", path("here.zarr"), url}), 2, {url, "--force"});
    EXPECT_EQ(lines("written").size(), before);
    EXPECT_EQ(with_bucket({"export", path("here.zarr"), url, "-f", "-q"}).exit_code, 0);
    expect_no_leftovers();
  }
  EXPECT_TRUE(read_file(path("objects/exports/a.nhdr")) == read_file(path("a.nhdr")));
  // What lies beside the file is not replaced either.
  fs::remove(path("objects/exports/a.raw"));
  expect_refused(with_bucket({"export", path("here.zarr"), "s3://bucket/exports/a.raw"}), 2,
                 {"a.nhdr", "--force"});
  EXPECT_FALSE(fs::exists(path("objects/exports/a.raw")));
  expect_refused(with_bucket({"export", path("here.zarr"), "s3://bucket/"}), 2,
                 {"names no object"});
  expect_refused(with_bucket({"export", path("here.zarr"), "s3://bucket"}), 2, {"names no object"});
  expect_refused(with_bucket({"export", path("here.zarr"), "https://host/a.nrrd"}), 2, {"URL"});
  expect_refused(with_bucket({"export", path("here.zarr"), "s3://bucket/b.nrrd"}, "wrong"), 1,
                 {"s3://bucket/b.nrrd", "403", "credentials"});
  expect_no_leftovers();
}

TEST_F(Bucket, LargeExportsGoInParts) {
  ASSERT_EQ(run(large(path("here.zarr"))).exit_code, 0);
  ASSERT_EQ(run({"export", path("here.zarr"), path("b.raw"), "-q"}).exit_code, 0);
  for (const char* bucket : {"bucket", "bucket-busy", "bucket-reset"}) {
    const Outcome outcome =
        with_bucket({"export", path("here.zarr"), std::string("s3://") + bucket + "/b.raw",
                     "--memory", "64M", "--force", "--json"});
    ASSERT_EQ(outcome.exit_code, 0) << bucket << ": " << outcome.err;
    EXPECT_TRUE(read_file(path("objects/b.raw")) == read_file(path("b.raw"))) << bucket;
    EXPECT_LE(nlohmann::json::parse(outcome.out).at("peak_resident_bytes"), 64 << 20) << bucket;
    expect_no_leftovers();
  }
  EXPECT_EQ(server_->get("uploads"), "0 3\n");
}

TEST_F(Bucket, UrlsThatMakeNoSense) {
  expect_refused(with_bucket(small("s3://bucket")), 2, {"whole bucket"});
  expect_refused(with_bucket(small("s3://bucket/a.zarr.zip")), 2, {"zip"});
  Arguments part = small("s3://bucket/a.zarr");
  part.insert(part.end(), {"--part", "1/2"});
  expect_refused(with_bucket(part), 2, {"--part"});
  EXPECT_TRUE(fs::is_empty(path("objects")));
}

}  // namespace
}  // namespace isobrick::test
