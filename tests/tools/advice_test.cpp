#include <fmt/format.h>

#include "tests/tools/program.h"

// Errors end in what to type next.
namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

using Advice = ProgramTest;

TEST_F(Advice, OfAStoreThatIsNotThere) {
  const std::string store = path("no.zarr");
  for (const Arguments& arguments :
       {Arguments{"info", store}, Arguments{"verify", store}, Arguments{"index", store},
        Arguments{"export", store, path("a.raw")},
        Arguments{"extract", store, "--isovalue", "1", "-o", path("a.ply")}})
    expect_refused(run(arguments), 1,
                   {"'" + store + "' is no store: nothing has that name",
                    "isobrick convert VOLUME " + store + "\n"});
  fs::create_directory(store + ".partial");
  expect_refused(run({"info", store}), 1,
                 {"was interrupted", "isobrick convert VOLUME " + store + " --resume\n"});
  EXPECT_EQ(files(), Arguments{"no.zarr.partial"});
}

TEST_F(Advice, SaysWhatTheFileIs) {
  const auto refused = [&](const std::string& name, std::initializer_list<std::string> parts) {
    expect_refused(run({"verify", path(name)}), 1, parts);
  };
  write_file(path("a.raw"), "abc");
  refused("a.raw", {"it is a volume of the format raw",
                    fmt::format("isobrick convert {} {} --dims X,Y,Z --type TYPE\n", path("a.raw"),
                                path("a.zarr"))});
  write_file(path("a_1x1x3_uint8.raw"), "abc");
  refused("a_1x1x3_uint8.raw", {fmt::format(" {}\n", path("a_1x1x3_uint8.zarr"))});
  write_file(path("my scan.nrrd"), "NRRD0004\n");
  refused("my scan.nrrd", {"it is a volume of the format NRRD",
                           fmt::format("isobrick convert '{}' '{}'\n", path("my scan.nrrd"),
                                       path("my scan.zarr"))});
  write_file(path("a.h5"), "\x89HDF\r\n\x1a\n");
  refused("a.h5", {"it is a volume of the format HDF5"});
  write_file(path("a.ply"), "ply\n");
  refused("a.ply", {"it is a mesh",
                    fmt::format("isobrick render {} -o {}\n", path("a.ply"), path("a.png"))});
  // Every format that is drawn, and no other: the advice leads somewhere.
  for (const std::string extension : {"ply", "stl", "obj", "glb", "gltf", "vtp", "pvtp"}) {
    const std::string mesh = "mesh." + extension;
    write_file(path(mesh), "{");
    refused(mesh, {"it is a mesh", "isobrick render " + path(mesh) + " -o " + path("mesh.png")});
    const std::string err = run({"render", path(mesh), "-o", path("mesh.png")}).err;
    EXPECT_EQ(err.find("no mesh that can be drawn"), std::string::npos) << err;
  }
  write_file(path("a.png"), "\x89PNG\r\n\x1a\n");
  refused("a.png", {"it is a picture", "name the store or the volume"});
  fs::create_directory(path("slices"));
  refused("slices", {"a folder without Zarr's metadata",
                     fmt::format("isobrick convert {} {}\n", path("slices"), path("slices.zarr"))});
  const std::string store = make_store("slices/a");
  refused("slices", {"a folder that holds Zarr", "name that, such as " + store});
}

TEST_F(Advice, OfTheViewerIsThatOfInfo) {
  if (run({"help", "view"}).out.find("not in this program") != std::string::npos)
    GTEST_SKIP() << "built without pictures";
  write_file(path("scan.raw"), "abc");
  write_file(path("smoke.vdb"), std::string(" BDV\0\0\0\0", 8));
  for (const std::string name : {"scan.raw", "smoke.vdb", "no.zarr"}) {
    const std::string message = run({"info", path(name)}).err;
    const std::string expected = "isobrick view" + message.substr(message.find(':'));
    EXPECT_EQ(run({"view", path(name)}).err, expected);
    EXPECT_EQ(run({"view", path(name), "--screenshot", path("a.png")}).err, expected);
  }
  expect_refused(run({"view", "--screenshot", path("a.png")}), 2, {"INPUT is required"});
}

TEST_F(Advice, OfRangesThatAreMissing) {
  const std::string store = make_store("a");
  // Without its attributes it is an image of another program.
  nlohmann::json group = nlohmann::json::parse(read_file(store + "/zarr.json"));
  group["attributes"].erase("isobrick");
  write_file(store + "/zarr.json", group.dump());
  fs::remove_all(store + "/isobrick");
  const Arguments extract{"extract", store, "--isovalue", "127.5", "-o", path("a.ply")};
  const Outcome by_cache = run(extract);
  EXPECT_EQ(by_cache.exit_code, 0);
  EXPECT_NE(by_cache.err.find("'isobrick index " + store + "' adds what it lacks in place"),
            std::string::npos)
      << by_cache.err;
  EXPECT_NE(run({"info", store}).out.find("run: isobrick index " + store + "\n"),
            std::string::npos);
  Arguments by_index = extract;
  by_index.insert(by_index.end(), {"--search", "kdtree"});
  by_index.push_back("--force");
  expect_refused(run(by_index), 2, {"run: isobrick index ", " --kind kdtree\n"});
  // The line does what it promises; octree is the default.
  EXPECT_EQ(run_json({"index", store})["kind"], "octree");
  const std::string expected = read_file(path("a.ply"));
  fs::remove(path("a.ply"));
  EXPECT_EQ(run(extract).err, "");
  EXPECT_TRUE(read_file(path("a.ply")) == expected);
}

TEST_F(Advice, OfAnIsovalueThatNoSampleReaches) {
  write_file(path("a_2x2x2_int16.raw"), noise(16));
  const std::string store = path("a.zarr");
  ASSERT_EQ(run({"convert", path("a_2x2x2_int16.raw"), store}).exit_code, 0);
  const nlohmann::json range = run_json({"info", store})["value_range"];
  const std::string why =
      "isovalue 40000: the surface is empty; the samples of level 0 lie within " +
      std::to_string(range[0].get<int>()) + " and " + std::to_string(range[1].get<int>()) + "\n";
  const Outcome outcome = run({"extract", store, "--isovalue", "40000", "-o", path("a.ply")});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.err, why);
  const Outcome estimate = run({"extract", store, "--isovalue", "40000", "--estimate"});
  EXPECT_EQ(estimate.exit_code, 0);
  EXPECT_EQ(estimate.err, why);
  const Outcome level_set = run({"export", store, path("a.vdb"), "--isovalue", "40000"});
  if (level_set.exit_code == 0) {  // else there is no OpenVDB
    EXPECT_EQ(level_set.err, why);
  }
  // Nothing lies below the least sample, and nothing above the largest.
  const auto extracted = [&](int isovalue) {
    return run({"extract", store, "--isovalue", std::to_string(isovalue), "-o", path("b.ply"),
                "--force"})
        .err;
  };
  EXPECT_NE(extracted(range[0].get<int>()), "");
  EXPECT_EQ(extracted(range[1].get<int>()), "");
  const Outcome picture =
      run({"view", store, "--isovalue", "40000", "--screenshot", path("a.png"), "--size", "64x64"});
  if (picture.exit_code == 0) {  // else nothing can draw here
    EXPECT_EQ(picture.err, why);
  }
}

}  // namespace
}  // namespace isobrick::test
