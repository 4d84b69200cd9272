#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>

#include "tests/tools/http_server.h"
#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

/// What --remote-cache keeps of stores behind URLs.
class RemoteCache : public ProgramTest {
 protected:
  void SetUp() override {
    if (!available("python3")) GTEST_SKIP() << "python3 is not there";
    fs::create_directory(path("served"));
    make_store("gyroid");
    server_ = std::make_unique<HttpServer>(path("served"));
    ASSERT_GT(server_->port(), 0);
  }

  /// Of several shards, so that there are several objects.
  void make_store(const std::string& kind, const std::string& name = "served/smooth.zarr") {
    ASSERT_EQ(run({"synth", kind, path(name), "--dims", "130,96,90", "--type", "u8", "--brick",
                   "16", "--shard", "64", "-f"})
                  .exit_code,
              0);
  }
  std::string url(const std::string& name = "smooth.zarr") const {
    return server_->url("plain", name);
  }
  Arguments cached(Arguments words, const std::string& limit = "64M") const {
    words.insert(words.end(), {"--cache", path("cache"), "--remote-cache", limit});
    return words;
  }
  Outcome extract(const std::string& input, const std::string& limit = "64M") {
    return run(cached(
        {"extract", input, "--isovalue", "127.5", "-o", path("m.ply"), "-f", "--json"}, limit));
  }
  std::string mesh_of(const std::string& input, const std::string& limit = "64M") {
    const Outcome outcome = extract(input, limit);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_EQ(outcome.err, "");
    return read_file(path("m.ply"));
  }
  std::uint64_t bytes_of_cache() const {
    std::uint64_t bytes = 0;
    if (fs::exists(path("cache")))
      for (const auto& entry : fs::recursive_directory_iterator(path("cache")))
        if (entry.is_regular_file()) bytes += entry.file_size();
    return bytes;
  }

  std::unique_ptr<HttpServer> server_;
};

TEST_F(RemoteCache, TheSecondTimeHardlyAnythingIsRequested) {
  const std::string expected = mesh_of(path("served/smooth.zarr"));
  server_->take_traffic();
  EXPECT_TRUE(mesh_of(url()) == expected);
  const auto first = server_->take_traffic();
  EXPECT_TRUE(mesh_of(url()) == expected);
  const auto second = server_->take_traffic();
  EXPECT_GT(first.requests, 20);
  EXPECT_LE(second.requests, 4);  // files of the root
  EXPECT_LT(second.bytes, first.bytes / 20);

  const Outcome info = run({"info", url()});
  ASSERT_EQ(info.exit_code, 0) << info.err;
  EXPECT_EQ(run(cached({"info", url()})).out, info.out);
  server_->take_traffic();
  EXPECT_EQ(run(cached({"info", url()})).out, info.out);
  EXPECT_LE(server_->take_traffic().requests, 4);
}

TEST_F(RemoteCache, ZipsAskOnce) {
  ASSERT_EQ(run({"export", path("served/smooth.zarr"), path("served/s.zarr.zip")}).exit_code, 0);
  const std::string expected = mesh_of(url("s.zarr.zip"));
  server_->take_traffic();
  EXPECT_TRUE(mesh_of(url("s.zarr.zip")) == expected);
  const auto traffic = server_->take_traffic();
  EXPECT_EQ(traffic.requests, 1);
  EXPECT_LT(traffic.bytes, 10);  // of the request for the traffic itself
}

TEST_F(RemoteCache, ConversionsReadFromIt) {
  const auto convert = [&](const std::string& input, const std::string& output) {
    const Outcome outcome = run(cached({"convert", input, path(output), "-f"}));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_EQ(outcome.err, "");
  };
  convert(path("served/smooth.zarr"), "expected.zarr");
  server_->take_traffic();
  convert(url(), "c.zarr");
  const auto first = server_->take_traffic();
  convert(url(), "c.zarr");
  const auto second = server_->take_traffic();
  EXPECT_GT(first.requests, 10);
  EXPECT_LE(second.requests, 4);
  EXPECT_LT(second.bytes, first.bytes / 10);
  for (const char* name : {"c.zarr", "expected.zarr"})
    EXPECT_EQ(run({"verify", path(name)}).exit_code, 0) << name;
  EXPECT_TRUE(mesh_of(path("c.zarr")) == mesh_of(path("expected.zarr")));
}

TEST_F(RemoteCache, OffUnlessRequested) {
  const Outcome outcome = run({"extract", url(), "--isovalue", "127.5", "-o", path("m.ply"),
                               "--cache", path("cache"), "-q"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  mesh_of(url(), "none");
  EXPECT_FALSE(fs::exists(path("cache")));
  // The environment requests it, too.
  const Outcome set =
      run_process({"env", "ISOBRICK_REMOTE_CACHE=64M", "ISOBRICK_CACHE=" + path("cache"),
                   ISOBRICK_PROGRAM, "info", url()});
  EXPECT_EQ(set.exit_code, 0) << set.err;
  EXPECT_GT(bytes_of_cache(), 0u);
  expect_refused(run(cached({"info", url()}, "lots")), 2, {"--remote-cache"});
}

TEST_F(RemoteCache, AStoreThatChangedIsReadAnew) {
  const std::string first = mesh_of(url());
  // The same metadata, other samples.
  make_store("marschner-lobb");
  const std::string expected = mesh_of(path("served/smooth.zarr"));
  ASSERT_TRUE(expected != first);
  EXPECT_TRUE(mesh_of(url()) == expected);
  EXPECT_TRUE(mesh_of(url()) == expected);
}

TEST_F(RemoteCache, ShardsThatChangedAreNoticedWhereBytesAreMissing) {
  const std::string expected = mesh_of(path("served/smooth.zarr"));
  Arguments words{"extract", url(), "--isovalue", "127.5", "-o", path("part.ply"), "-q"};
  words.insert(words.end(), {"--roi", "0:66,0:66,0:66"});
  ASSERT_EQ(run(cached(words)).exit_code, 0);
  // The root stays as it is, so that nobody asks for the shards again.
  for (const auto& entry : fs::recursive_directory_iterator(path("served/smooth.zarr/0/c")))
    if (entry.is_regular_file())
      fs::last_write_time(entry.path(), entry.last_write_time() - std::chrono::hours(1));
  const Outcome outcome = extract(url());
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.out.find("open the store anew"), std::string::npos) << outcome.out;
  EXPECT_TRUE(mesh_of(url()) == expected);
}

TEST_F(RemoteCache, DamagedAndMissingFilesAreFetchedAgain) {
  const std::string expected = mesh_of(url());
  for (const int change : {0, 1, 2}) {
    int count = 0;
    for (const auto& entry : fs::recursive_directory_iterator(path("cache"))) {
      if (!entry.is_regular_file() || entry.path().filename() == "state.json" || ++count % 2 == 0)
        continue;
      if (change == 0) fs::resize_file(entry.path(), entry.file_size() / 2);
      if (change == 1) fs::resize_file(entry.path(), 0);
      if (change == 2) std::ofstream(entry.path(), std::ios::in | std::ios::out) << "damage";
    }
    ASSERT_GT(count, 20);
    EXPECT_TRUE(mesh_of(url()) == expected) << change;
    server_->take_traffic();
    EXPECT_TRUE(mesh_of(url()) == expected) << change;
    EXPECT_LE(server_->take_traffic().requests, 4) << change;
  }
}

TEST_F(RemoteCache, TheLimitHolds) {
  const std::string expected = mesh_of(url());
  const std::uint64_t all = bytes_of_cache();
  ASSERT_GT(all, 200000u);
  for (int i = 0; i < 3; ++i) {
    EXPECT_TRUE(mesh_of(url(), "120K") == expected);
    EXPECT_LE(bytes_of_cache(), 120u << 10);
  }
}

TEST_F(RemoteCache, SeveralProcessesShareIt) {
  const std::string expected = mesh_of(path("served/smooth.zarr"));
  std::string script = "for i in 1 2 3 4; do ";
  script += ISOBRICK_PROGRAM;
  script += " extract " + url() + " --isovalue 127.5 --cache " + path("cache") +
            " --remote-cache 200K -q -f -o " + path("m") + "$i.ply & done; wait";
  EXPECT_EQ(run_process({"sh", "-c", script}).exit_code, 0);
  for (const char* name : {"m1.ply", "m2.ply", "m3.ply", "m4.ply"})
    EXPECT_TRUE(read_file(path(name)) == expected) << name;
  EXPECT_LE(bytes_of_cache(), 200u << 10);
}

TEST_F(RemoteCache, GoesOnWithoutAFolder) {
  const std::string expected = mesh_of(path("served/smooth.zarr"));
  std::ofstream(path("cache")) << "no folder";
  const Outcome outcome = extract(url());
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_NE(outcome.err.find("nothing more is kept of remote stores"), std::string::npos)
      << outcome.err;
  EXPECT_TRUE(read_file(path("m.ply")) == expected);
}

TEST_F(RemoteCache, GoesOnWhenTheDiskIsFull) {
  const Outcome expected = run({"info", url()});
  const std::string script = std::string("trap '' XFSZ; ulimit -f 0; ") + ISOBRICK_PROGRAM +
                             " info " + url() + " --cache " + path("cache") + " --remote-cache 64M";
  const Outcome outcome = run_process({"sh", "-c", script});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.out, expected.out);
  EXPECT_NE(outcome.err.find("cannot write to"), std::string::npos) << outcome.err;
  EXPECT_EQ(outcome.err.find("cannot write to"), outcome.err.rfind("cannot write to"));
}

}  // namespace
}  // namespace isobrick::test
