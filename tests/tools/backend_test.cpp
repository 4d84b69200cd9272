#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <vector>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

/// Whether an outcome reports that CUDA cannot work on this machine.
bool without_cuda(const Outcome& outcome) {
  return outcome.exit_code == 1 && (outcome.err.find("no CUDA device") != std::string::npos ||
                                    outcome.err.find("built without CUDA") != std::string::npos);
}

/// Of a store that waves() has made: an isovalue in the middle of its samples.
std::string middle_of(const std::filesystem::path& store) {
  const std::string type = store.stem().string();
  return type.starts_with("f") ? "0.01"
         : type == "u16"       ? "32767.5"
         : type == "u32"       ? "2147483647.5"
         : type == "u8"        ? "127.5"
                               : "0.5";
}

class Backend : public ProgramTest {
 protected:
  Outcome on_cuda(const std::string& store, const Arguments& more = {}) const {
    Arguments arguments{"extract",     store,     "--isovalue", "127.5", "-o",
                        path("a.ply"), "--force", "--backend",  "cuda"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }

  /// A store of samples of a wavy field, large enough for several launches.
  std::string waves(const std::string& type, const Arguments& more = {}) const {
    const std::string store = path(type + ".zarr");
    Arguments arguments{"synth",      "gyroid", store, "--dims",
                        "150,131,97", "--type", type,  "--force"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    EXPECT_EQ(run(arguments).exit_code, 0);
    return store;
  }
};

/// The stage that was busy longest.
std::string longest(const nlohmann::json& stages) {
  std::string name;
  double seconds = -1;
  for (const auto& [key, stage] : stages.items()) {
    EXPECT_TRUE(stage["bytes"].is_number_unsigned()) << key;
    if (stage["seconds"].get<double>() > seconds) {
      seconds = stage["seconds"];
      name = key;
    }
  }
  return name;
}

TEST_F(Backend, TheCpuReportsItsStages) {
  const std::string store = make_store("a");
  const nlohmann::json surface = run_json({"extract", store, "--isovalue", "127.5", "-o",
                                           path("a.ply"), "--backend", "cpu"})["surfaces"][0];
  EXPECT_EQ(surface["backend"], "cpu");
  EXPECT_TRUE(surface["device"].is_null());
  EXPECT_TRUE(surface["gpu_refusal"].is_null());
  EXPECT_FALSE(surface.contains("device_bytes"));
  const nlohmann::json& stages = surface["stages"];
  std::vector<std::string> names;
  for (const auto& [name, stage] : stages.items()) names.push_back(name);
  EXPECT_EQ(names, (Arguments{"decode", "read", "sink", "surface"}));
  EXPECT_GT(stages["read"]["bytes"].get<std::uint64_t>(), 0u);
  EXPECT_LE(stages["read"]["bytes"].get<std::uint64_t>(),
            surface["bytes_read"].get<std::uint64_t>());
  EXPECT_EQ(stages["decode"]["bytes"].get<std::uint64_t>(),
            surface["brick_reads"].get<std::uint64_t>() * 16 * 16 * 16);
  EXPECT_EQ(stages["sink"]["bytes"].get<std::uint64_t>(),
            24 * surface["vertices"].get<std::uint64_t>() +
                12 * surface["triangles"].get<std::uint64_t>());
  EXPECT_EQ(surface["bound"], longest(stages));
}

TEST_F(Backend, OptionsThatMakeNoSense) {
  const std::string store = make_store("a");
  const auto refused = [&](const Arguments& more, const std::string& part) {
    SCOPED_TRACE(part);
    Arguments arguments{"extract", store, "--isovalue", "127.5", "-o", path("a.ply")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    expect_refused(run(arguments), 2, {more[0], part});
  };
  refused({"--backend", "metal"}, "auto, cpu or cuda");
  refused({"--gpu-memory", "lots"}, "lots");
  refused({"--gpu-memory", "0"}, "0");
  refused({"--device", "-1"}, "-1");
  refused({"--device", "first"}, "first");
  EXPECT_EQ(files(), Arguments{"a.zarr"});
}

TEST_F(Backend, WithoutADeviceCudaIsRefusedAndAutoTakesTheCpu) {
  const std::string store = make_store("a");
  const Outcome refused = on_cuda(store);
  if (!without_cuda(refused)) GTEST_SKIP() << "there is a CUDA device";
  expect_refused(refused, 1, {"--backend cuda: ", "--backend cpu"});
  EXPECT_EQ(files(), Arguments{"a.zarr"});
  EXPECT_EQ(run_json({"extract", store, "--isovalue", "127.5", "-o", path("a.ply"), "--backend",
                      "auto", "--device", "1"})["surfaces"][0]["backend"],
            "cpu");
}

/// What needs a device.
class Cuda : public Backend {
 protected:
  void SetUp() override {
    if (without_cuda(on_cuda(make_store("probe")))) GTEST_SKIP() << "no CUDA device";
  }

  /// Makes the surface on both backends, expects equal files and returns CUDA's report.
  nlohmann::json compare(const std::string& store, const std::string& extension,
                         const Arguments& more, const Arguments& on_device = {}) const {
    Arguments arguments{"extract", store, "--isovalue", middle_of(store), "--force"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const auto extract = [&](const std::string& backend, const Arguments& also) {
      Arguments all = arguments;
      all.insert(all.end(), {"--backend", backend, "-o", path(backend + extension)});
      all.insert(all.end(), also.begin(), also.end());
      return run_json(all)["surfaces"][0];
    };
    const nlohmann::json cpu = extract("cpu", {}), cuda = extract("cuda", on_device);
    EXPECT_EQ(cuda["backend"], "cuda");
    EXPECT_EQ(cpu["triangles"], cuda["triangles"]);
    EXPECT_GT(cpu["triangles"].get<int>(), 100);
    EXPECT_TRUE(read_file(path("cpu" + extension)) == read_file(path("cuda" + extension)));
    return cuda;
  }
};

TEST_F(Cuda, FilesAreThoseOfTheCpu) {
  for (const std::string type : {"u8", "i8", "u16", "i16", "u32", "i32", "f32", "f64"})
    for (const std::string brick : {"20", "32", "48", "64"}) {
      SCOPED_TRACE(type + ", bricks of " + brick);
      const std::string store = waves(type, {"--brick", brick});
      compare(store, ".ply", {});
      compare(store, ".ply", {"--normals", "gradient"});
    }
  for (const std::string type : {"u8", "i16", "i32", "f32", "f64"}) {
    SCOPED_TRACE(type + ", packed");
    const std::string store = waves(type, {"--brick", "32", "--codec", "packed"});
    compare(store, ".ply", {"--normals", "gradient"});
    compare(store, ".ply", {"--level", "1", "--roi", "5:50,:,10:"});
  }
  const std::string store = waves("u8", {"--brick", "32"});
  compare(store, ".stl", {});
  compare(store, ".ply", {"--level", "1"});
  compare(store, ".ply", {"--roi", "11:99,40:,:77"});
  compare(store, ".stl", {"--roi", "11:99,40:,:77", "--normals", "gradient"});
}

TEST_F(Cuda, DegenerateTrianglesAreLeftOut) {
  const std::string store = waves("u8", {"--brick", "32"});
  for (const std::string extension : {".ply", ".stl"}) {
    const auto extract = [&](const std::string& backend) {
      return run_json({"extract", store, "--isovalue", "127", "--drop-degenerate", "--force",
                       "--backend", backend, "-o", path(backend + extension)})["surfaces"][0];
    };
    const nlohmann::json cpu = extract("cpu"), cuda = extract("cuda");
    EXPECT_EQ(cuda["backend"], "cuda");
    EXPECT_GT(cpu["degenerate_triangles"].get<int>(), 0);
    EXPECT_EQ(cuda["degenerate_triangles"], cpu["degenerate_triangles"]);
    EXPECT_TRUE(read_file(path("cpu" + extension)) == read_file(path("cuda" + extension)));
  }
}

TEST_F(Cuda, TheTrilinearInterpolantIsFollowed) {
  const std::string store = waves("f32", {"--brick", "32", "--noise", "0.5"});
  for (const char* extension : {".ply", ".stl"})
    compare(store, extension, {"--topology", "trilinear", "--normals", "gradient"});
  compare(store, ".ply", {"--topology", "trilinear"}, {"--resume"});
}

TEST_F(Cuda, TheBorderIsCapped) {
  const std::string store = waves("f32", {"--brick", "32", "--noise", "0.5"});
  for (const char* extension : {".ply", ".stl"}) {
    compare(store, extension, {"--cap"});
    compare(store, extension, {"--cap", "--inside", "below", "--topology", "trilinear"});
  }
  compare(waves("u8", {"--brick", "32"}), ".ply",
          {"--cap", "--drop-degenerate", "--topology", "trilinear", "--roi", "11:99,40:,:77"});
}

TEST_F(Cuda, SurfacesByWayOfPiecesAreThoseOfTheCpu) {
  const std::string store = waves("u16", {"--brick", "32"});
  compare(store, ".ply", {"--cap", "--drop-degenerate"}, {"--resume"});
  compare(store, ".ply", {"--normals", "gradient"}, {"--resume"});
  compare(store, ".stl", {"--drop-degenerate"}, {"--resume"});
}

TEST_F(Cuda, SeveralDevicesMakeTheMeshOfOne) {
  const std::string store = waves("u16", {"--brick", "32"});
  if (run({"extract", store, "--isovalue", "32767.5", "-o", path("a.ply"), "--backend", "cuda",
           "--device", "1", "--force"})
          .exit_code != 0)
    GTEST_SKIP() << "a second device is missing";
  for (const std::string extension : {".ply", ".glb"}) {
    const nlohmann::json made = compare(store, extension, {}, {"--device", "0,1"});
    EXPECT_GT(made["pieces"]["total"].get<int>(), 1);
  }
}

/// Also where a budget has no room for all surfaces beside each other.
TEST_F(Cuda, SeveralSurfacesInOnePassAreThoseOfTheCpu) {
  const std::string store = waves("u16", {"--brick", "32"});
  const Arguments isovalues{"20000", "32767.5", "45000"};
  for (const std::string extension : {".ply", ".stl"}) {
    Arguments cpu{"extract", store, "--force", "-o", path("cpu" + extension), "--backend", "cpu"};
    for (const std::string& isovalue : isovalues) cpu.insert(cpu.end(), {"--isovalue", isovalue});
    run_json(cpu);
    for (const char* budget : {"1G", "24M"}) {
      SCOPED_TRACE(extension + ", " + budget);
      Arguments cuda = cpu;
      cuda[4] = path("cuda" + extension);
      cuda[6] = "cuda";
      cuda.insert(cuda.end(), {"--gpu-memory", budget});
      const nlohmann::json made = run_json(cuda);
      std::uint64_t outputs = 0;
      for (const nlohmann::json& pass : made["passes"]) outputs += pass["outputs"].size();
      EXPECT_EQ(outputs, 3u);
      if (budget == std::string("1G")) {
        ASSERT_EQ(made["passes"].size(), 1u);
        EXPECT_EQ(made["passes"][0]["brick_reads"], made["passes"][0]["bricks_read"]);
      }
      for (const nlohmann::json& surface : made["surfaces"]) {
        EXPECT_EQ(surface["backend"], "cuda");
        EXPECT_LE(surface["device_bytes"].get<std::uint64_t>(), std::uint64_t{1} << 30);
      }
      for (const std::string& isovalue : isovalues)
        EXPECT_TRUE(read_file(path("cpu_" + isovalue + extension)) ==
                    read_file(path("cuda_" + isovalue + extension)));
    }
  }
}

/// Several isovalues on both backends; the report of the GPU.
class ResidentCuda : public Cuda {
 protected:
  /// Expects equal files, and the first `resident` surfaces to be made from what stayed on the GPU.
  nlohmann::json compare_all(const std::string& store, const Arguments& isovalues,
                             const std::string& extension, const Arguments& more,
                             const char* gpu_memory, std::size_t resident) const {
    const auto extract = [&](const std::string& backend, const Arguments& also) {
      Arguments all{"extract",   store,  "--force", "-o", path(backend + extension),
                    "--backend", backend};
      for (const std::string& isovalue : isovalues) all.insert(all.end(), {"--isovalue", isovalue});
      all.insert(all.end(), more.begin(), more.end());
      all.insert(all.end(), also.begin(), also.end());
      return run_json(all);
    };
    extract("cpu", {});
    const nlohmann::json made = extract("cuda", {"--gpu-memory", gpu_memory});
    EXPECT_EQ(made["surfaces"].size(), isovalues.size());
    for (std::size_t i = 0; i < isovalues.size(); ++i) {
      const nlohmann::json& surface = made["surfaces"][i];
      EXPECT_EQ(surface["backend"], "cuda");
      EXPECT_EQ(surface["resident"], i < resident) << isovalues[i];
      const std::string expected = read_file(path("cpu_" + isovalues[i] + extension));
      EXPECT_GT(expected.size(), 1000u);
      EXPECT_TRUE(expected == read_file(path("cuda_" + isovalues[i] + extension))) << isovalues[i];
    }
    return made;
  }
};

TEST_F(ResidentCuda, FilesAreThoseOfTheCpu) {
  const std::map<std::string, Arguments> isovalues_of{{"u8", {"127.5", "160", "90"}},
                                                      {"i8", {"0.5", "30", "-30"}},
                                                      {"u16", {"32767.5", "40000", "20000"}},
                                                      {"i16", {"0.5", "8000", "-8000"}},
                                                      {"i32", {"0.5", "800000000", "-800000000"}},
                                                      {"f32", {"0.01", "0.25", "-0.25"}},
                                                      {"f64", {"0.01", "0.25", "-0.25"}}};
  for (const auto& [type, isovalues] : isovalues_of) {
    const bool packed = type == "u16" || type == "f32";
    const std::string store =
        waves(type, {"--brick", type == "u8" ? "20" : "32", "--codec", packed ? "packed" : "zstd"});
    SCOPED_TRACE(type);
    const nlohmann::json made = compare_all(store, isovalues, ".ply", {}, "256M", 3);
    ASSERT_EQ(made["passes"].size(), 1u);
    EXPECT_EQ(made["passes"][0]["brick_reads"], made["passes"][0]["bricks_read"]);
    for (const nlohmann::json& surface : made["surfaces"]) {
      EXPECT_LE(surface["device_bytes"].get<std::uint64_t>(), std::uint64_t{256} << 20);
      EXPECT_GT(surface["stages"]["upload"]["bytes"].get<std::uint64_t>(), 0u);
      EXPECT_EQ(surface["stages"]["download"]["bytes"], surface["stages"]["sink"]["bytes"]);
    }
    compare_all(store, isovalues, ".ply", {"--normals", "gradient"}, "256M", 3);
    compare_all(store, isovalues, ".ply", {"--roi", "11:99,40:,:77"}, "256M", 3);
    compare_all(store, isovalues, ".ply", {"--drop-degenerate"}, "256M", 3);
    compare_all(store, isovalues, ".ply", {"--cap", "--drop-degenerate"}, "256M", 3);
  }
}

TEST_F(ResidentCuda, EveryFormatOfSharedVerticesIsThatOfTheCpu) {
  const std::string store = waves("u16", {"--brick", "32"});
  for (const std::string extension : {".obj", ".glb", ".vtp"})
    for (const Arguments& more : {Arguments{}, Arguments{"--normals", "gradient"}}) {
      SCOPED_TRACE(extension);
      compare_all(store, {"20000", "45000"}, extension, more, "256M", 2);
    }
  compare_all(store, {"20000", "45000"}, ".ply", {"--level", "1"}, "256M", 2);
  compare_all(store, {"20000", "45000"}, ".stl", {}, "256M", 0);
}

/// Most bricks of a sphere in a large field are absent, and the inner ones are not looked at.
TEST_F(ResidentCuda, OnlyBricksThatASurfaceTouchesAreRead) {
  const std::string store = path("sphere.zarr");
  ASSERT_EQ(
      run({"synth", "sphere", store, "--dims", "300,260,280", "--type", "u8", "--brick", "16"})
          .exit_code,
      0);
  const nlohmann::json made = compare_all(store, {"100", "140"}, ".ply", {}, "256M", 2);
  const nlohmann::json& bricks = made["surfaces"][0]["bricks"];
  EXPECT_LT(bricks["read"].get<int>(), bricks["total"].get<int>());
}

/// The first mesh fits beside the samples, the second does not.
TEST_F(ResidentCuda, AMeshThatDoesNotFitBesideTheSamplesIsStreamedWithThoseAfterIt) {
  const std::string store = waves("u16", {"--brick", "32", "--noise", "0.3"});
  const Arguments isovalues{"64000", "32000", "64500"};
  const nlohmann::json made = compare_all(store, isovalues, ".ply", {}, "56M", 1);
  ASSERT_EQ(made["passes"].size(), 2u);
  EXPECT_EQ(made["passes"][0]["outputs"].size(), 1u);
  EXPECT_EQ(made["passes"][1]["outputs"].size(), 2u);
  compare_all(store, isovalues, ".ply", {}, "1G", 3);
  compare_all(store, isovalues, ".ply", {}, "40M", 0);
}

/// A mesh and its picture are two surfaces of one isovalue.
TEST_F(Cuda, AMeshAndItsPictureReadTheStoreOnce) {
  const std::string store = waves("u8", {"--brick", "32"});
  const auto extract = [&](const std::string& backend) {
    return Arguments{"extract",
                     store,
                     "--force",
                     "--isovalue",
                     "127.5",
                     "-o",
                     path(backend + ".ply"),
                     "--preview",
                     path(backend + ".png"),
                     "--backend",
                     backend};
  };
  const Outcome drawn = run(extract("cpu"));
  if (drawn.exit_code != 0) GTEST_SKIP() << drawn.err;  // nothing can draw here
  const nlohmann::json made = run_json(extract("cuda"));
  ASSERT_EQ(made["passes"].size(), 1u);
  EXPECT_EQ(made["passes"][0]["brick_reads"], made["passes"][0]["bricks_read"]);
  for (const char* extension : {".ply", ".png"})
    EXPECT_TRUE(read_file(path(std::string("cpu") + extension)) ==
                read_file(path(std::string("cuda") + extension)))
        << extension;
}

TEST_F(Cuda, VolumesWithSamplesThatAreNoNumbers) {
  std::vector<float> samples;
  for (int i = 0; i < 70 * 65 * 90; ++i)
    samples.push_back(i % 97 == 0 ? std::numeric_limits<float>::quiet_NaN()
                                  : static_cast<float>(std::sin(i * 0.1) + std::sin(i / 70 * 0.2)));
  write_file(path("nan_70x65x90_float32.raw"),
             std::string(reinterpret_cast<const char*>(samples.data()), samples.size() * 4));
  const std::string store = path("f32.zarr");
  ASSERT_EQ(run({"convert", path("nan_70x65x90_float32.raw"), store, "--brick", "32"}).exit_code,
            0);
  compare(store, ".ply", {"--normals", "gradient"});
  compare(store, ".stl", {"--roi", "11:,0:40,:77"});
}

TEST_F(Cuda, ABudgetDecidesWhereBricksLie) {
  const std::string store = waves("u16");  // bricks of 512 KiB
  const auto pool_with = [&](const char* budget) {
    return compare(store, ".ply", {"--normals", "gradient"},
                   {"--gpu-memory", budget})["pool_bricks"]
        .get<int>();
  };
  EXPECT_GT(pool_with("256M"), 0);
  EXPECT_EQ(pool_with("16M"), 0);
}

TEST_F(Cuda, ReportsItsStages) {
  const nlohmann::json surface = compare(waves("u16"), ".ply", {}, {"--gpu-memory", "64M"});
  EXPECT_FALSE(surface["device"].get<std::string>().empty());
  EXPECT_LE(surface["device_bytes"].get<std::uint64_t>(), std::uint64_t{64} << 20);
  EXPECT_GT(surface["pinned_bytes"].get<std::uint64_t>(), 0u);
  EXPECT_GT(surface["launches"].get<int>(), 0);
  const nlohmann::json& stages = surface["stages"];
  for (const char* name : {"read", "decode", "gather", "upload", "kernel", "download", "sink"})
    EXPECT_GT(stages[name]["bytes"].get<std::uint64_t>(), 0u) << name;
  EXPECT_EQ(surface["bound"], longest(stages));
}

TEST_F(Cuda, TheLeastMemoryOfTheDeviceWorksAndLessIsRefusedByName) {
  const std::string store = waves("u8", {"--brick", "32"});
  const Outcome refused = on_cuda(store, {"--gpu-memory", "100K"});
  expect_refused(refused, 2, {"--gpu-memory of 102400 bytes", "at least "});
  const std::string least =
      std::to_string(std::stoull(refused.err.substr(refused.err.find("at least ") + 9)));
  EXPECT_EQ(compare(store, ".ply", {}, {"--gpu-memory", least})["device_bytes"].dump(), least);
  compare(store, ".ply", {"--normals", "gradient"}, {"--gpu-memory", "32M", "--memory", "280M"});
  expect_refused(on_cuda(store, {"--memory", "100M"}), 2, {"--memory of 104857600 bytes"});
}

TEST_F(Cuda, ADeviceThatDoesNotExistIsRefused) {
  expect_refused(on_cuda(make_store("a"), {"--device", "200"}), 2, {"--device 200", "CUDA device"});
}

}  // namespace
}  // namespace isobrick::test
