#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

class Codecs : public ProgramTest {
 protected:
  void succeed(const Arguments& arguments) {
    const Outcome outcome = run(arguments);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  }
  /// The same volume in a store of each codec.
  void make_stores(const std::string& type) {
    for (const std::string codec : {"zstd", "packed", "none"})
      succeed({"synth", "gyroid", path(codec + ".zarr"), "--dims", "100,70,90", "--type", type,
               "--brick", "32", "--codec", codec, "--force"});
  }
};

TEST_F(Codecs, GiveTheSameMeshesAndSamples) {
  for (const std::string type : {"u8", "i16", "f32", "f64"}) {
    make_stores(type);
    for (const std::string codec : {"zstd", "packed", "none"}) {
      const std::string store = path(codec + ".zarr");
      EXPECT_EQ(run_json({"info", store})["codec"], codec == "zstd" ? "zstd:3" : codec);
      succeed({"verify", store});
      succeed({"extract", store, "--isovalue", "50%", "--normals", "-o", path(codec + ".ply"),
               "--force"});
      succeed({"export", store, path(codec + ".raw"), "--force"});
    }
    for (const std::string codec : {"packed", "none"})
      for (const std::string file : {".ply", ".raw"})
        EXPECT_TRUE(read_file(path(codec + file)) == read_file(path("zstd" + file)))
            << type << codec << file;
  }
}

TEST_F(Codecs, ADamagedPackedBrickIsNamed) {
  make_stores("u8");
  const std::string shard = path("packed.zarr") + "/0/c/0/0/0";
  std::string bytes = read_file(shard);
  bytes[1000] = static_cast<char>(bytes[1000] ^ 4);
  write_file(shard, bytes);
  const Outcome extracted =
      run({"extract", path("packed.zarr"), "--isovalue", "50%", "-o", path("a.ply")});
  EXPECT_EQ(extracted.exit_code, 1);
  EXPECT_NE(extracted.err.find("brick (0, 0, 0)"), std::string::npos) << extracted.err;
  EXPECT_FALSE(std::filesystem::exists(path("a.ply")));
  EXPECT_EQ(run({"verify", path("packed.zarr")}).exit_code, 1);
}

TEST_F(Codecs, ZarrVersion2HasNoPackedBricks) {
  const Outcome outcome = run({"synth", "gyroid", path("a.zarr"), "--dims", "20,20,20", "--type",
                               "u8", "--codec", "packed", "--ome", "0.4"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_NE(outcome.err.find("OME-Zarr 0.5"), std::string::npos) << outcome.err;
}

}  // namespace
}  // namespace isobrick::test
