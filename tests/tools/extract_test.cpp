#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

using Extract = ProgramTest;

TEST_F(Extract, ReportsWhatItDid) {
  const std::string store = make_store("a");
  const nlohmann::json json =
      run_json({"extract", store, "--isovalue", "127.5", "-o", path("a.ply")});
  EXPECT_EQ(json["command"], "extract");
  EXPECT_GT(json["peak_resident_bytes"].get<std::uint64_t>(), 0u);
  ASSERT_EQ(json["surfaces"].size(), 1u);
  const nlohmann::json& surface = json["surfaces"][0];
  EXPECT_GT(surface["triangles"].get<int>(), 100);
  EXPECT_GT(surface["vertices"].get<int>(), 50);
  EXPECT_EQ(surface["bricks"]["total"], 27);
  EXPECT_GT(surface["bricks"]["active"].get<int>(), 0);
  EXPECT_GT(surface["bricks"]["read"].get<int>(), 0);
  EXPECT_GT(surface["bytes_read"].get<int>(), 0);
  for (const char* stage : {"total", "plan", "decode", "surface", "sink"})
    EXPECT_TRUE(surface["seconds"][stage].is_number()) << stage;
  const std::string mesh = read_file(path("a.ply"));
  EXPECT_EQ(surface["output_bytes"], mesh.size());
  EXPECT_NE(mesh.find("element face " + surface["triangles"].dump()), std::string::npos);
  EXPECT_NE(mesh.find("element vertex " + surface["vertices"].dump()), std::string::npos);
}

TEST_F(Extract, WritesStl) {
  const std::string store = make_store("a");
  const nlohmann::json json =
      run_json({"extract", store, "--isovalue", "127.5", "-o", path("a.stl")});
  EXPECT_EQ(read_file(path("a.stl")).size(),
            84 + 50 * json["surfaces"][0]["triangles"].get<std::size_t>());
}

TEST_F(Extract, WritesEveryFormatOfTheSameMesh) {
  const std::string store = make_store("a");
  const auto extract = [&](const std::string& name, const Arguments& more = {}) {
    Arguments arguments{"extract", store, "--isovalue", "127.5", "-o", path(name)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_json(arguments)["surfaces"][0];
  };
  const nlohmann::json ply = extract("a.ply");
  for (const char* name : {"a.obj", "a.glb", "a.vtp", "a.pvtp"}) {
    const nlohmann::json surface = extract(name);
    EXPECT_EQ(surface["triangles"], ply["triangles"]) << name;
    EXPECT_EQ(surface["vertices"], ply["vertices"]) << name;
  }
  const nlohmann::json parted = extract("a.PVTP");
  EXPECT_EQ(parted["output_bytes"].get<std::size_t>(),
            read_file(path("a.PVTP")).size() + read_file(path("a.PVTP.parts/part_0.vtp")).size());
  const std::string obj = read_file(path("a.obj"));
  EXPECT_EQ(std::count(obj.begin(), obj.end(), '\n') - 1,
            2 * ply["vertices"].get<int>() + ply["triangles"].get<int>());
  // The name need not have the format.
  extract("mesh", {"--format", "vtp"});
  EXPECT_TRUE(read_file(path("mesh")) == read_file(path("a.vtp")));
  extract("mesh.out", {"--format", "glb", "--quantize"});
  EXPECT_TRUE(read_file(path("mesh.out")).starts_with("glTF"));
  EXPECT_LT(read_file(path("mesh.out")).size(), read_file(path("a.glb")).size());
  if (!kCanCompress) return;
  extract("c.glb", {"--compress"});
  EXPECT_LT(read_file(path("c.glb")).size(), read_file(path("a.glb")).size() * 6 / 10);
  extract("both.glb", {"--compress", "--quantize"});
  EXPECT_LT(read_file(path("both.glb")).size(), read_file(path("c.glb")).size() * 9 / 10);
}

TEST_F(Extract, EveryFormatIsAsLongAsPredicted) {
  const std::string store = make_store("a");
  for (const char* format : {"ply", "stl", "obj", "glb", "vtp", "pvtp"})
    for (const char* normals : {"none", "gradient"}) {
      const Arguments extract{"extract",  store,  "--isovalue", "127.5", "-o",     path("a"),
                              "--format", format, "--normals",  normals, "--force"};
      Arguments estimate = extract;
      estimate.push_back("--estimate");
      const nlohmann::json made = run_json(extract)["surfaces"][0];
      const double bytes = made["output_bytes"];
      EXPECT_NEAR(run_json(estimate)["surfaces"][0]["file_bytes"].get<double>(), bytes,
                  0.25 * bytes)
          << format << ' ' << normals;
    }
}

TEST_F(Extract, NormalsAreTheDefaultWhereTheFormatHoldsThem) {
  const std::string store = make_store("a");
  const auto mesh = [&](const std::string& name, const Arguments& more) {
    Arguments arguments{"extract", store, "--isovalue", "127.5"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    arguments.insert(arguments.end(), {"-o", path(name), "--force"});
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return read_file(path(name));
  };
  for (const std::string name : {"a.ply", "a.obj", "a.glb", "a.vtp"}) {
    const std::string plain = mesh(name, {}), gradient = mesh(name, {"--normals", "gradient"});
    EXPECT_TRUE(plain == gradient) << name;
    EXPECT_TRUE(mesh(name, {"--normals"}) == gradient) << name;
    EXPECT_LT(mesh(name, {"--normals", "none"}).size(), gradient.size()) << name;
    EXPECT_EQ(mesh(name, {"--normals=none"}), mesh(name, {"--normals", "none"})) << name;
  }
  EXPECT_TRUE(mesh("a.stl", {}) == mesh("a.stl", {"--normals", "none"}));
  // Bare, it may stand anywhere.
  EXPECT_EQ(
      run({"extract", "--normals", store, "--isovalue", "127.5", "-o", path("b.ply")}).exit_code,
      0);
  expect_refused(
      run({"extract", store, "--isovalue", "127.5", "--normals=flat", "-o", path("c.ply")}), 2,
      {"--normals", "'flat'", "gradient or none"});
}

// The triangles of an STL or a picture share no vertices, so that no file has a number of them.
TEST_F(Extract, VerticesAreCountedWhereTheFileHasThem) {
  const std::string store = make_store("a");
  const auto surface = [&](const Arguments& more) {
    Arguments arguments{"extract", store, "--isovalue", "127.5", "--force"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    EXPECT_EQ(run(arguments).out.find("vertices") != std::string::npos,
              !run_json(arguments)["surfaces"][0]["vertices"].is_null());
    return run_json(arguments)["surfaces"][0];
  };
  const nlohmann::json ply = surface({"-o", path("a.ply")}), stl = surface({"-o", path("a.stl")});
  EXPECT_TRUE(ply["vertices"].is_number());
  EXPECT_TRUE(stl["vertices"].is_null());
  EXPECT_TRUE(surface({"-o", path("a.stl"), "--estimate"})["vertices"].is_null());
  EXPECT_TRUE(surface({"-o", path("a.ply"), "--estimate"})["vertices"].is_number());
  EXPECT_EQ(stl["triangles"], ply["triangles"]);
}

TEST_F(Extract, APreviewCountsAsTheMeshDoes) {
  const std::string store = make_store("a");
  const Arguments preview{"extract",   store,         "--isovalue", "127.5",
                          "--preview", path("a.png"), "--force"};
  Arguments both = preview;
  both.insert(both.end(), {"-o", path("a.ply")});
  const nlohmann::json picture = run_json(preview)["surfaces"][0],
                       mesh = run_json(both)["surfaces"][0];
  EXPECT_EQ(picture["triangles"], mesh["triangles"]);
  EXPECT_EQ(picture["bricks"], mesh["bricks"]);
  EXPECT_TRUE(picture["vertices"].is_null());
}

TEST_F(Extract, NormalsEnlargeTheVertices) {
  const std::string store = make_store("a");
  const nlohmann::json json = run_json(
      {"extract", store, "--isovalue", "127.5", "--normals", "gradient", "-o", path("a.ply")});
  const std::string mesh = read_file(path("a.ply"));
  EXPECT_NE(mesh.find("property float nx"), std::string::npos);
  EXPECT_GT(mesh.size(), 24 * json["surfaces"][0]["vertices"].get<std::size_t>() +
                             13 * json["surfaces"][0]["triangles"].get<std::size_t>());
}

// 128 is a value of the samples, 127.5 is not.
TEST_F(Extract, DegenerateTrianglesAreLeftOutOnRequest) {
  const std::string store = make_store("a");
  const auto surface = [&](const char* isovalue, const char* mesh, const Arguments& more) {
    Arguments arguments{"extract", store, "--isovalue", isovalue, "-o", path(mesh)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_json(arguments)["surfaces"][0];
  };
  const nlohmann::json all = surface("128", "all.ply", {});
  const nlohmann::json kept = surface("128", "kept.ply", {"--drop-degenerate"});
  EXPECT_FALSE(all.contains("degenerate_triangles"));
  EXPECT_GT(kept["degenerate_triangles"].get<int>(), 0);
  EXPECT_EQ(kept["triangles"].get<int>() + kept["degenerate_triangles"].get<int>(),
            all["triangles"].get<int>());
  EXPECT_LT(kept["vertices"].get<int>(), all["vertices"].get<int>());
  EXPECT_NE(read_file(path("kept.ply")).find("element face " + kept["triangles"].dump()),
            std::string::npos);
  const nlohmann::json soup = surface("128", "kept.stl", {"--drop-degenerate"});
  EXPECT_EQ(soup["triangles"], kept["triangles"]);
  EXPECT_EQ(soup["degenerate_triangles"], kept["degenerate_triangles"]);
  surface("127.5", "a.ply", {});
  EXPECT_EQ(surface("127.5", "b.ply", {"--drop-degenerate"})["degenerate_triangles"], 0);
  EXPECT_TRUE(read_file(path("a.ply")) == read_file(path("b.ply")));
  const Outcome reported =
      run({"extract", store, "--isovalue", "128", "-o", path("reported.ply"), "--drop-degenerate"});
  EXPECT_NE(reported.out.find("degenerate triangles left out"), std::string::npos);
}

TEST_F(Extract, SeveralIsovaluesGetNamesOfTheirOwn) {
  const std::string store = make_store("a");
  const nlohmann::json json = run_json({"extract", store, "--isovalue", "100", "--isovalue",
                                        "127.5", "-o", path("m.ply"), "--preview", path("m.png")});
  EXPECT_EQ(json["surfaces"].size(), 2u);
  EXPECT_EQ(files(), (Arguments{"a.zarr", "m_100.ply", "m_100.png", "m_127.5.ply", "m_127.5.png"}));
}

TEST_F(Extract, DrawsAPicture) {
  const std::string store = make_store("a");
  run_json({"extract", store, "--isovalue", "127.5", "--preview", path("a.png")});
  EXPECT_TRUE(read_file(path("a.png")).starts_with("\x89PNG\r\n"));
  EXPECT_EQ(files(), (Arguments{"a.png", "a.zarr"}));
}

TEST_F(Extract, IsTheSameFromRunToRun) {
  const std::string store = make_store("a");
  for (const char* threads : {"1", "2", "5"})
    EXPECT_EQ(run({"extract", store, "--isovalue", "127.5", "--threads", threads, "-o",
                   path(std::string("t") + threads + ".ply")})
                  .exit_code,
              0);
  EXPECT_TRUE(read_file(path("t1.ply")) == read_file(path("t2.ply")));
  EXPECT_TRUE(read_file(path("t1.ply")) == read_file(path("t5.ply")));
}

TEST_F(Extract, EstimateWritesNothingAndIsNear) {
  const std::string store = make_store("a");
  const std::vector<std::string> names = files();
  const nlohmann::json estimate =
      run_json({"extract", store, "--isovalue", "127.5", "--estimate", "-o", path("a.ply")});
  EXPECT_EQ(files(), names);
  const nlohmann::json made =
      run_json({"extract", store, "--isovalue", "127.5", "-o", path("a.ply")});
  const nlohmann::json &predicted = estimate["surfaces"][0], &real = made["surfaces"][0];
  EXPECT_EQ(predicted["bricks"]["active"], real["bricks"]["active"]);
  for (const char* key : {"triangles", "vertices"}) {
    EXPECT_NEAR(predicted[key].get<double>(), real[key].get<double>(),
                0.25 * real[key].get<double>())
        << key;
  }
  EXPECT_NEAR(predicted["file_bytes"].get<double>(), real["output_bytes"].get<double>(),
              0.25 * real["output_bytes"].get<double>());
  EXPECT_GE(predicted["uncertainty"].get<double>(), 0);
  EXPECT_GT(predicted["memory_bytes"].get<std::uint64_t>(), 0u);
  EXPECT_GT(predicted["active_blocks"].get<std::uint64_t>(), 0u);
}

// A disk of 64 KiB that only the process sees; the mesh takes some 400.
TEST_F(Extract, AMeshThatDoesNotFitTheDiskIsNotBegun) {
  const std::string store = make_store("a");
  const std::string disk = path("disk");
  std::filesystem::create_directory(disk);
  const auto on_small_disk = [&](const std::string& then) {
    return run_process({"unshare", "--user", "--map-root-user", "--mount", "sh", "-c",
                        "mount -t tmpfs -o size=64k none \"$1\" || exit 77; " + then, "sh", disk,
                        ISOBRICK_PROGRAM, store});
  };
  const std::string extract = "\"$2\" extract \"$3\" --isovalue 127.5 -o \"$1\"/a.ply";
  const Outcome refused = on_small_disk(extract + "; code=$?; ls -A \"$1\" >&2; exit $code");
  if (refused.exit_code == 77 || refused.err.find("unshare") != std::string::npos)
    GTEST_SKIP() << "no disk of its own for a process here: " << refused.err;
  expect_refused(refused, 1, {"a.ply", "but its disk has 64.0 KiB free", "--no-space-check"});
  // Who wants to try may; the disk is then full indeed, and nothing stays on it.
  const Outcome tried =
      on_small_disk(extract + " --no-space-check; code=$?; ls -A \"$1\" >&2; exit $code");
  expect_refused(tried, 1, {"a.ply", "No space left"});
  // What fits is made.
  EXPECT_EQ(on_small_disk(extract + " --roi :3,:3,").exit_code, 0);
}

TEST_F(Extract, AnEmptySurfaceIsAMesh) {
  const std::string store = make_store("a");
  const Outcome outcome = run({"extract", store, "--isovalue", "1000", "-o", path("a.ply")});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_NE(outcome.err.find("empty"), std::string::npos);
  EXPECT_NE(read_file(path("a.ply")).find("element face 0"), std::string::npos);
}

TEST_F(Extract, LevelsAndRegionsShrinkTheMesh) {
  const std::string store = make_store("a");
  const auto triangles = [&](const Arguments& more) {
    Arguments arguments{"extract", store, "--isovalue", "127.5", "-o", path("a.ply"), "--force"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_json(arguments)["surfaces"][0]["triangles"].get<int>();
  };
  const int all = triangles({});
  EXPECT_LT(triangles({"--level", "1"}), all / 2);
  const int half = triangles({"--roi", ":20,,"});
  EXPECT_LT(half, all);
  EXPECT_GT(half, 0);
  // Cells are cut in two at a plane of samples: nothing is lost or made twice.
  EXPECT_EQ(half + triangles({"--roi", "19:,,"}), all);
}

// The program of the signal's default: the shell must see that it was SIGINT.
TEST_F(Extract, AnInterruptLeavesNothingBehind) {
  const Outcome outcome = run({"synth", "mixing", path("big.raw"), "--dims", "2000,2000,2000",
                               "--type", "f32", "--threads", "1"},
                              {.interrupt_after = 0.4});
  EXPECT_EQ(outcome.signal, SIGINT);
  EXPECT_TRUE(files().empty());
}

TEST_F(Extract, AnInterruptEndsTheWaitForStandardInput) {
  const std::string pipe = path("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  const int writer = open(pipe.c_str(), O_RDWR | O_CLOEXEC);  // so that the pipe never ends
  ASSERT_GE(writer, 0);
  const std::string some = noise(5000);
  ASSERT_EQ(write(writer, some.data(), some.size()), 5000);
  const Outcome outcome = run(
      {"convert", "-", path("a.zarr"), "--dims", "100,100,100", "--type", "u8", "--brick", "16"},
      {.input = pipe, .interrupt_after = 0.4});
  // If it has not ended by itself, the runner's time limit fails.
  EXPECT_EQ(outcome.signal, SIGINT);
  EXPECT_FALSE(std::filesystem::exists(path("a.zarr")));
  close(writer);
}

}  // namespace
}  // namespace isobrick::test
