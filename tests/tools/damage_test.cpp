#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class Damage : public ProgramTest {
 protected:
  Damage() : store_(make_store("a")) {
    for (const auto& entry : fs::recursive_directory_iterator(store_))
      if (entry.is_regular_file()) parts_.push_back(entry.path());
  }

  /// Calls f(file) with each binary file of the store in turn damaged by
  /// `damage`(bytes), and mends it afterwards.
  template <class D, class F>
  void with_each_damaged(D&& damage, F&& f) {
    for (const fs::path& part : parts_) {
      if (part.filename() == "zarr.json") continue;
      SCOPED_TRACE(part);
      const std::string whole = read_file(part);
      std::string bytes = whole;
      damage(bytes);
      write_file(part, bytes);
      f(part);
      write_file(part, whole);
    }
  }

  /// `verify` reports it: exit code 1, the file by name.
  void expect_verify_names(const fs::path& part) {
    const Outcome outcome = run({"verify", store_});
    EXPECT_EQ(outcome.exit_code, 1);
    EXPECT_NE(outcome.out.find(fs::relative(part, store_).string()), std::string::npos)
        << outcome.out << outcome.err;
    EXPECT_NE(outcome.err.find("damaged"), std::string::npos) << outcome.err;
  }

  std::string store_;
  std::vector<fs::path> parts_;
};

TEST_F(Damage, AWholeStoreIsWhole) {
  const nlohmann::json json = run_json({"verify", store_});
  EXPECT_EQ(json["whole"], true);
  EXPECT_EQ(json["damages"], nlohmann::json::array());
}

TEST_F(Damage, VerifyNamesTruncatedFiles) {
  with_each_damaged([](std::string& bytes) { bytes.resize(bytes.size() / 2); },
                    [&](const fs::path& part) { expect_verify_names(part); });
}

TEST_F(Damage, VerifyNamesFlippedBytes) {
  for (const double place : {0.0, 0.3, 0.7, 1.0})
    with_each_damaged(
        [&](std::string& bytes) {
          const auto at = static_cast<std::size_t>(place * static_cast<double>(bytes.size() - 1));
          bytes[at] = static_cast<char>(bytes[at] ^ 0x10);
        },
        [&](const fs::path& part) { expect_verify_names(part); });
}

TEST_F(Damage, VerifyListsDamagesInItsJson) {
  with_each_damaged([](std::string& bytes) { bytes[bytes.size() / 2] ^= 1; },
                    [&](const fs::path&) {
                      const Outcome outcome = run({"verify", store_, "--json"});
                      EXPECT_EQ(outcome.exit_code, 1);
                      const auto json = nlohmann::json::parse(outcome.out, nullptr, false);
                      ASSERT_TRUE(json.is_object()) << outcome.out;
                      EXPECT_EQ(json["whole"], false);
                      EXPECT_GE(json["damage_count"].get<int>(), 1);
                      EXPECT_FALSE(json["damages"].empty());
                    });
}

TEST_F(Damage, ExtractAndExportStopAtDamagedBricks) {
  // Level 0's samples: everything below 0/c.
  const auto is_shard = [&](const fs::path& part) {
    return fs::relative(part, store_).string().starts_with("0/c/");
  };
  const std::vector<std::string> names = files();
  with_each_damaged([](std::string& bytes) { bytes[bytes.size() / 3] ^= 4; },
                    [&](const fs::path& part) {
                      if (!is_shard(part)) return;
                      expect_refused(
                          run({"extract", store_, "--isovalue", "127.5", "-o", path("a.ply")}), 1,
                          {"c/"});
                      expect_refused(run({"export", store_, path("a.raw")}), 1, {"c/"});
                    });
  EXPECT_EQ(files(), names);
}

TEST_F(Damage, AMissingShardOfBricksIsNoted) {
  // A missing file means "all fill value" in Zarr, but the ranges know better.
  for (const fs::path& part : parts_) {
    if (part.filename() == "zarr.json") continue;
    const std::string whole = read_file(part);
    fs::remove(part);
    EXPECT_EQ(run({"verify", store_}).exit_code, 1) << part;
    write_file(part, whole);
  }
}

// Whatever happens to the metadata: a line, or the same result; never a crash.
TEST_F(Damage, MetadataNeverCrashes) {
  const std::string wanted = path("whole.raw"), got = path("got.raw");
  ASSERT_EQ(run({"export", store_, wanted}).exit_code, 0);
  const std::string samples = read_file(wanted);
  for (const fs::path& part : parts_) {
    if (part.filename() != "zarr.json") continue;
    const std::string whole = read_file(part);
    for (std::size_t at = 0; at < whole.size(); at += 37) {
      std::string bytes = whole;
      bytes[at] = static_cast<char>(bytes[at] ^ 0x11);
      write_file(part, at % 2 == 0 ? bytes : whole.substr(0, at));
      SCOPED_TRACE(part.string() + " at " + std::to_string(at));
      const Outcome outcome = run({"export", store_, got, "--force"});
      EXPECT_EQ(outcome.signal, 0);
      if (outcome.exit_code == 0) {
        EXPECT_EQ(read_file(got), samples);
      } else {
        expect_refused(outcome, 1, {});
      }
    }
    write_file(part, whole);
  }
}

}  // namespace
}  // namespace isobrick::test
