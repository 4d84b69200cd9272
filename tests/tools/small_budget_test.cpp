#include <regex>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

/// What small volumes need, and that the advice after a refusal is enough.
class SmallBudget : public ProgramTest {
 protected:
  SmallBudget() {
    write_file(path("tiny.raw"), noise(34 * 1 * 3));
    write_file(path("small.raw"), noise(128 * 128 * 96));
  }

  Arguments convert(const std::string& name, const std::string& dims) const {
    return {"convert", path(name + ".raw"), path(name + ".zarr"), "--dims", dims, "--type", "u8",
            "--force"};
  }

  /// The least budget that a refusal names; running with it then succeeds within it.
  long least(Arguments arguments, bool within = true) const {
    arguments.insert(arguments.end(), {"--threads", "3", "--json", "--memory"});
    arguments.push_back("1M");
    const Outcome refused = run(arguments);
    EXPECT_EQ(refused.exit_code, 2) << refused.err;
    // The budget is the user's own, and not a part of it.
    EXPECT_NE(refused.err.find("a memory budget of 1.0 MiB is too small"), std::string::npos)
        << refused.err;
    std::smatch found;
    if (!std::regex_search(refused.err, found, std::regex("--memory ([0-9]+)M"))) {
      ADD_FAILURE() << refused.err;
      return 0;
    }
    arguments.back() = found.str(1) + "M";
    const Outcome done = run(arguments);
    EXPECT_EQ(done.exit_code, 0) << done.err;
    const auto report = nlohmann::json::parse(done.out, nullptr, false);
    const long mib = std::stol(found.str(1));
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    if (within && report.is_object() && report.contains("peak_resident_bytes")) {
      EXPECT_LE(report["peak_resident_bytes"].get<long>(), mib << 20) << arguments[0];
    }
#endif
    return mib;
  }
};

TEST_F(SmallBudget, IsEnoughForSmallVolumes) {
  for (const auto& [name, dims] : {std::pair("tiny", "34,1,3"), std::pair("small", "128,128,96")}) {
    EXPECT_LE(least(convert(name, dims)), 32);
    const std::string store = path(name) + ".zarr";
    EXPECT_LE(least({"extract", store, "--isovalue", "100", "-o", path("m.ply"), "--force"}), 48);
    EXPECT_LE(least({"index", store, "--kind", "octree", "--force"}), 32);
    EXPECT_LE(least({"index", store, "--kind", "kdtree", "--leaf", "1", "--force"}), 64);
    EXPECT_LE(least({"export", store, path("e.nrrd"), "--force"}), 32);
    EXPECT_LE(least({"export", store, path("e.raw"), "--force"}), 32);
  }
}

/// Whatever is written: a number that a refusal names is enough.
TEST_F(SmallBudget, TheAdviceIsEnoughForEveryMesh) {
  for (const auto& [name, dims] : {std::pair("tiny", "34,1,3"), std::pair("small", "128,128,96")}) {
    ASSERT_EQ(run(convert(name, dims)).exit_code, 0);
    for (const Arguments& form :
         {Arguments{"m.stl"}, Arguments{"m.obj"}, Arguments{"m.glb"},
          Arguments{"q.glb", "--quantize"}, Arguments{"m.vtp"}, Arguments{"m.pvtp"},
          Arguments{"c.glb", "--compress"}, Arguments{"d.ply", "--drop-degenerate"},
          Arguments{"n.ply", "--normals", "none"}}) {
      Arguments extract{"extract", path(name) + ".zarr", "--isovalue", "100", "--force"};
      extract.insert(extract.end(), form.begin() + 1, form.end());
      extract.insert(extract.end(), {"-o", path(form[0])});
      SCOPED_TRACE(form[0]);
      const bool compress = form[0] == "c.glb";
      if (compress && !kCanCompress) continue;
      EXPECT_LE(least(extract), compress ? 80 : 52);
    }
  }
}

TEST_F(SmallBudget, TheAdviceIsEnoughForFilters) {
  for (const auto& [name, dims] : {std::pair("tiny", "34,1,3"), std::pair("small", "128,128,96")}) {
    ASSERT_EQ(run(convert(name, dims)).exit_code, 0);
    for (const std::string output : {"f.ply", "f.stl"})
      EXPECT_LE(least({"extract", path(name) + ".zarr", "--isovalue", "100", "--force", "-o",
                       path(output), "--largest", "9", "--smooth", "2", "--measure"}),
                64)
          << output;
  }
}

TEST_F(SmallBudget, TheAdviceIsEnoughForLevelsOfDetail) {
  for (const auto& [name, dims] : {std::pair("tiny", "34,1,3"), std::pair("small", "128,128,96")}) {
    ASSERT_EQ(run(convert(name, dims)).exit_code, 0);
    for (const std::string output : {"m.3dtiles", "m.neuroglancer"}) {
      const Arguments extract{"extract",    path(name) + ".zarr",
                              "--isovalue", "100",
                              "--force",    "--levels",
                              "2",          "--roi",
                              ":,:,0:3",    "-o",
                              path(output)};
      const Outcome made = run(extract);
      if (made.err.find("libdraco-dev") != std::string::npos) GTEST_SKIP() << made.err;
      EXPECT_LE(least(extract), 190) << output;
    }
  }
}

TEST_F(SmallBudget, TheAdviceIsEnoughForAConversionWithAnIndex) {
  for (const auto& [name, dims] : {std::pair("tiny", "34,1,3"), std::pair("small", "128,128,96")})
    for (const Arguments& index :
         {Arguments{"octree"}, Arguments{"kdtree", "--leaf", "1"}, Arguments{"interval"}}) {
      Arguments arguments = convert(name, dims);
      arguments.push_back("--build-index");
      arguments.insert(arguments.end(), index.begin(), index.end());
      SCOPED_TRACE(index[0]);
      EXPECT_LE(least(arguments), 64);
    }
}

TEST_F(SmallBudget, TheAdviceIsEnoughForOpenVdb) {
  ASSERT_EQ(run(convert("small", "128,128,96")).exit_code, 0);
  const std::string store = path("small.zarr");
  const Outcome samples = run({"export", store, path("e.vdb")});
  if (samples.err.find("without OpenVDB") != std::string::npos) GTEST_SKIP() << samples.err;
  EXPECT_LE(least({"export", store, path("e.vdb"), "--force"}), 80);
  EXPECT_LE(least({"export", store, path("e.vdb"), "--force", "--roi", "3:70,5:90,7:64"}), 72);
  EXPECT_LE(least({"export", store, path("s.vdb"), "--isovalue", "100", "--force"}), 256);
  // Within it, but for the grid, which is found out when it grows.
  const Outcome refused = run({"export", store, path("e.vdb"), "--force", "--memory", "56M"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.err.find("budget of 56.0 MiB is too small: --memory "), std::string::npos)
      << refused.err;
}

TEST_F(SmallBudget, TheAdviceIsEnoughForAPreview) {
  ASSERT_EQ(run(convert("small", "128,128,96")).exit_code, 0);
  const Arguments preview{"extract",     path("small.zarr"), "--isovalue", "100",  "--preview",
                          path("a.png"), "--force",          "--size",     "64x64"};
  const Outcome picture = run(preview);
  if (picture.exit_code != 0) GTEST_SKIP() << picture.err;  // nothing can draw here
  constexpr int kDriver = 126;                              // MiB that OpenGL's driver counts for
  EXPECT_LE(least(preview, false), kDriver + 64);
  Arguments with_mesh = preview;
  with_mesh.insert(with_mesh.end(), {"-o", path("a.pvtp")});
  EXPECT_LE(least(with_mesh, false), kDriver + 64);
}

/// An image of another program, whose chunks hold three channels: what decoding them takes is in
/// the advice.
TEST_F(SmallBudget, TheAdviceIsEnoughForAnImageOfOthers) {
  const std::string image = path("image.zarr");
  std::filesystem::create_directories(image + "/c/0/0/0");
  write_file(image + "/zarr.json",
             R"({"zarr_format":3,"node_type":"array","shape":[3,32,32,32],"data_type":"uint8",
                 "chunk_grid":{"name":"regular","configuration":{"chunk_shape":[3,32,32,32]}},
                 "chunk_key_encoding":{"name":"default"},"fill_value":0,
                 "codecs":[{"name":"bytes"}]})");
  write_file(image + "/c/0/0/0/0", noise(3 * 32 * 32 * 32));
  EXPECT_LE(least({"index", image, "--kind", "octree", "--channel", "1"}), 32);
}

}  // namespace
}  // namespace isobrick::test
