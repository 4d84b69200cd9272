#include <filesystem>
#include <memory>

#include <fmt/format.h>

#include "tests/tools/http_server.h"
#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

class Url : public ProgramTest {
 protected:
  void SetUp() override {
    if (!available("python3")) GTEST_SKIP() << "python3 is not there";
    // Of several shards, so that there are several objects.
    store_ = path("smooth.zarr");
    ASSERT_EQ(run({"synth", "gyroid", store_, "--dims", "130,96,90", "--type", "u8", "--brick",
                   "16", "--shard", "64"})
                  .exit_code,
              0);
    server_ = std::make_unique<HttpServer>(path(""));
    ASSERT_GT(server_->port(), 0);
    expected_ = mesh_of(store_);
  }

  std::string url(const std::string& mode, const std::string& name = "smooth.zarr") const {
    return fmt::format("http://127.0.0.1:{}/{}/{}", server_->port(), mode, name);
  }
  Outcome extract(const std::string& input, const std::vector<std::string>& more = {}) {
    Arguments arguments{"extract", input, "--isovalue", "127.5", "-o", path("m.ply"), "-f", "-q"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  std::string mesh_of(const std::string& input, const std::vector<std::string>& more = {}) {
    const Outcome outcome = extract(input, more);
    EXPECT_EQ(outcome.exit_code, 0) << input << ": " << outcome.err;
    return outcome.exit_code == 0 ? read_file(path("m.ply")) : "";
  }

  std::string store_, expected_;
  std::unique_ptr<HttpServer> server_;
};

TEST_F(Url, MeshesAreThoseOfTheFolder) {
  for (const char* mode : {"plain", "slow:20", "link:20:5", "forbidden"})
    EXPECT_TRUE(mesh_of(url(mode)) == expected_) << mode;
  EXPECT_TRUE(mesh_of(url("plain") + "/") == expected_);
  EXPECT_TRUE(mesh_of(url("secret") + "?token=abc") == expected_);
  for (const char* threads : {"1", "3"})
    EXPECT_TRUE(mesh_of(url("plain"), {"--threads", threads, "--memory", "64M"}) == expected_);
}

TEST_F(Url, FailuresForAWhileDoNotMatter) {
  for (const char* mode : {"fail:503:1", "fail:429:1", "fail:500:2", "reset:1", "short:1"})
    EXPECT_TRUE(mesh_of(url(mode)) == expected_) << mode;
}

TEST_F(Url, FailuresThatStayEndWithALine) {
  expect_refused(extract(url("wrong:99")), 1, {"smooth.zarr/", "in place of"});
  expect_refused(extract(url("noranges")), 1, {"ranges of bytes"});
  expect_refused(extract(url("changing")), 1, {"changed", "open the store anew"});
  expect_refused(extract(url("secret")), 1, {"403 Forbidden", "credentials"});
  expect_refused(extract(url("plain", "nothing.zarr")), 1, {"nothing.zarr' is no store"});
  expect_refused(extract("http://127.0.0.1:1/a.zarr"), 1, {"127.0.0.1:1/a.zarr", "3 tries"});
  expect_refused(extract("https://"), 2, {"names no host"});
  EXPECT_EQ(files(), (std::vector<std::string>{"m.ply", "smooth.zarr"}));
}

TEST_F(Url, StoresAreRecodedAsFromTheFolder) {
  namespace fs = std::filesystem;
  const fs::path here = path("here.zarr"), fetched = path("fetched.zarr");
  ASSERT_EQ(run({"recode", store_, here, "--codec", "packed"}).exit_code, 0);
  const Outcome outcome = run({"recode", url("slow:20"), fetched, "--codec", "packed"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  std::size_t files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(here)) {
    if (!entry.is_regular_file()) continue;
    const fs::path name = fs::relative(entry.path(), here);
    EXPECT_TRUE(read_file(here / name) == read_file(fetched / name)) << name;
    ++files;
  }
  EXPECT_GT(files, 10u);
}

TEST_F(Url, ZipsAreReadToo) {
  ASSERT_EQ(run({"export", store_, path("smooth.zarr.zip")}).exit_code, 0);
  EXPECT_TRUE(mesh_of(url("plain", "smooth.zarr.zip")) == expected_);
  expect_refused(extract(url("plain", "other.zip")), 1, {"other.zip' does not exist"});
}

TEST_F(Url, EveryReadingCommandTakesThem) {
  const nlohmann::json info = run_json({"info", url("plain")});
  EXPECT_EQ(info.at("extent"), run_json({"info", store_}).at("extent"));
  const nlohmann::json here = run_json({"info", store_, "--stats"}),
                       there = run_json({"info", url("plain"), "--stats"});
  for (const char* name : {"levels", "histogram", "value_range", "raw_bytes"})
    EXPECT_EQ(here.at(name), there.at(name)) << name;
  EXPECT_TRUE(there.at("bytes").is_null());
  EXPECT_EQ(run({"verify", url("plain")}).exit_code, 0);
  ASSERT_EQ(run({"convert", url("plain"), path("copy.zarr"), "--brick", "32"}).exit_code, 0);
  EXPECT_TRUE(mesh_of(path("copy.zarr")) == expected_);
  ASSERT_EQ(run({"export", url("plain"), path("a.raw")}).exit_code, 0);
  ASSERT_EQ(run({"export", store_, path("b.raw")}).exit_code, 0);
  EXPECT_TRUE(read_file(path("a.raw")) == read_file(path("b.raw")));
  // The spacing of the request is that of a store made for it.
  EXPECT_TRUE(mesh_of(url("plain"), {"--spacing", "2,3,4"}) ==
              mesh_of(store_, {"--spacing", "2,3,4"}));
}

TEST_F(Url, BucketsOfS3) {
  const auto with = [&](const std::string& secret, Arguments words) {
    Arguments all{"env",
                  "AWS_ENDPOINT_URL_S3=" + url("", ""),
                  "AWS_ACCESS_KEY_ID=AKTEST",
                  "AWS_SECRET_ACCESS_KEY=" + secret,
                  "AWS_REGION=test-1",
                  ISOBRICK_PROGRAM};
    all.insert(all.end(), words.begin(), words.end());
    return run_process(all);
  };
  ASSERT_EQ(run({"index", store_, "--kind", "octree"}).exit_code, 0);
  const Arguments extract{
      "extract", "s3://bucket/smooth.zarr", "--isovalue", "127.5", "-o", path("m.ply"), "-f", "-q"};
  const Outcome outcome = with("s/e+cret", extract);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_TRUE(read_file(path("m.ply")) == expected_);
  expect_refused(with("wrong", extract), 1, {"s3://bucket/smooth.zarr", "403", "credentials"});
  // Its objects are listed, a part of the list after another.
  const Outcome info = with("s/e+cret", {"info", "s3://bucket/smooth.zarr"});
  EXPECT_NE(info.out.find("octree"), std::string::npos) << info.out << info.err;
}

TEST_F(Url, NothingIsWrittenToOne) {
  expect_refused(run({"extract", store_, "--isovalue", "1", "-o", url("plain", "m.ply")}), 2,
                 {"m.ply': nothing can be written to a URL"});
  expect_refused(run({"convert", store_, url("plain", "c.zarr")}), 2, {"c.zarr': nothing can be"});
  expect_refused(run({"index", url("plain"), "--kind", "octree"}), 2, {"isobrick convert"});
}

}  // namespace
}  // namespace isobrick::test
