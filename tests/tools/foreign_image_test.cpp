#include "tests/tools/program.h"

// OME-Zarr of other programs, as users of the program meet it.
namespace isobrick::test {
namespace {

using nlohmann::json;

class ForeignImage : public ProgramTest {
 protected:
  /// OME-Zarr 0.6: two channels of 12³ samples of i64, a ball each, turned about z.
  std::string write_image() const {
    const std::string image = path("image.zarr");
    for (const char* chunk : {"0", "1"})
      std::filesystem::create_directories(image + "/0/c/" + chunk + "/0/0");
    json axes = json::array({{{"name", "c"}, {"type", "channel"}}});
    for (const char* name : {"z", "y", "x"})
      axes.push_back({{"name", name}, {"type", "space"}, {"unit", "micrometer"}});
    const json own{{"type", "sequence"},
                   {"input", {{"path", "0"}}},
                   {"output", {{"name", "intrinsic"}}},
                   {"transformations",
                    {{{"type", "scale"}, {"scale", {1, 3, 2, 1}}},
                     {{"type", "translation"}, {"translation", {0, 30, 20, 10}}}}}};
    const json turn{{"type", "rotation"},
                    {"input", {{"name", "intrinsic"}}},
                    {"output", {{"name", "world"}}},
                    {"rotation", {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 0, 1}, {0, 0, -1, 0}}}};
    const json scale{
        {"coordinateSystems",
         {{{"name", "world"}, {"axes", axes}}, {{"name", "intrinsic"}, {"axes", axes}}}},
        {"coordinateTransformations", {turn}},
        {"datasets", {{{"path", "0"}, {"coordinateTransformations", {own}}}}}};
    json group{{"zarr_format", 3}, {"node_type", "group"}};
    group["attributes"]["ome"] = {
        {"version", "0.6"},
        {"multiscales", {scale}},
        {"omero", {{"channels", {{{"label", "nuclei"}}, {{"label", "walls"}}}}}}};
    write_file(image + "/zarr.json", group.dump());
    json array{{"zarr_format", 3},
               {"node_type", "array"},
               {"shape", {2, 12, 12, 12}},
               {"fill_value", 0},
               {"data_type", "int64"}};
    array["chunk_grid"] = {{"name", "regular"},
                           {"configuration", {{"chunk_shape", {1, 12, 12, 12}}}}};
    array["chunk_key_encoding"] = {{"name", "default"}};
    array["codecs"] = {{{"name", "bytes"}, {"configuration", {{"endian", "little"}}}}};
    write_file(image + "/0/zarr.json", array.dump());
    for (int c = 0; c < 2; ++c) write_file(image + "/0/c/" + std::to_string(c) + "/0/0/0", ball(c));
    return image;
  }

  static std::string ball(int channel) {
    std::string samples;
    for (int i = 0; i < 12 * 12 * 12; ++i) {
      const int x = i % 12 - 6, y = i / 12 % 12 - 6, z = i / 144 - 6;
      const std::int64_t value = 20 + 5 * channel - (x * x + y * y + z * z);
      samples.append(reinterpret_cast<const char*>(&value), sizeof value);
    }
    return samples;
  }
};

TEST_F(ForeignImage, ViewShowsTheChannelAndTheRegionThatAreChosen) {
  if (run({"help", "view"}).out.find("not in this program") != std::string::npos)
    GTEST_SKIP() << "built without pictures";
  const std::string image = write_image();
  expect_refused(run({"view", image, "--screenshot", path("a.png")}), 2, {"--channel"});
  // A window lists the channels and begins with the first; here there is none.
  expect_refused(run_process({"env", "-u", "DISPLAY", "-u", "WAYLAND_DISPLAY", ISOBRICK_PROGRAM,
                              "view", image}),
                 1, {"cannot open a window"});
  ASSERT_EQ(run({"index", image, "--channel", "1"}).exit_code, 0);
  const auto triangles = [&](const std::string& name, const Arguments& more) {
    Arguments arguments{"view",   image,     "--channel",    "1",       "--isovalue", "5",
                        "--size", "160x120", "--screenshot", path(name)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_json(arguments)["most_triangles"].get<int>();
  };
  EXPECT_GT(triangles("whole.png", {"--pixel-error", "0.1"}), 100);
  triangles("half.png", {"--pixel-error", "0.1", "--roi", "0:6,:,:"});
  EXPECT_NE(read_file(path("half.png")), read_file(path("whole.png")));
  expect_refused(
      run({"view", image, "--channel", "1", "--roi", "0:13,:,:", "--screenshot", path("b.png")}), 2,
      {"13"});
}

TEST_F(ForeignImage, InfoListsChannelsInsteadOfRefusing) {
  const std::string image = write_image();
  const Outcome outcome = run({"info", image});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const char* part : {"2, each 12 x 12 x 12", "--channel 0 … 1", "nuclei", "walls"})
    EXPECT_NE(outcome.out.find(part), std::string::npos) << part << " in " << outcome.out;
  const json listed = run_json({"info", image});
  ASSERT_EQ(listed["axes"].size(), 1u);
  EXPECT_EQ(listed["axes"][0]["count"], 2);
  EXPECT_EQ(listed["axes"][0]["names"], json({"nuclei", "walls"}));
  EXPECT_EQ(listed["spacing"], json({1.0, 2.0, 3.0}));
  EXPECT_EQ(run_json({"info", image, "--channel", "1"})["type"], "int64");
  expect_refused(run({"info", image, "--channel", "2"}), 2, {"--channel 2 is not there"});
  expect_refused(run({"export", image, path("x.raw")}), 2, {"--channel 0 … 1"});
}

TEST_F(ForeignImage, InfoRefusesChannelsAndTimesThatAreNotThere) {
  const std::string image = path("tc.zarr");
  std::filesystem::create_directories(image + "/0");
  json axes =
      json::array({{{"name", "t"}, {"type", "time"}}, {{"name", "c"}, {"type", "channel"}}});
  for (const char* name : {"z", "y", "x"}) axes.push_back({{"name", name}, {"type", "space"}});
  const json scale{{"type", "scale"}, {"scale", {1, 1, 1, 1, 1}}};
  const json level{{"path", "0"}, {"coordinateTransformations", {scale}}};
  const json attributes{
      {"multiscales", {{{"version", "0.4"}, {"axes", axes}, {"datasets", {level}}}}}};
  write_file(image + "/.zgroup", R"({"zarr_format": 2})");
  write_file(image + "/.zattrs", attributes.dump());
  const json array{{"zarr_format", 2},          {"shape", {4, 3, 5, 6, 7}},
                   {"chunks", {1, 1, 5, 6, 7}}, {"dtype", "|u1"},
                   {"compressor", nullptr},     {"filters", nullptr},
                   {"fill_value", 0},           {"order", "C"}};
  write_file(image + "/0/.zarray", array.dump());
  for (const Arguments& chosen :
       {Arguments{}, Arguments{"--channel", "2"}, Arguments{"--time", "3"}}) {
    Arguments info{"info", image};
    info.insert(info.end(), chosen.begin(), chosen.end());
    EXPECT_EQ(run_json(info)["axes"].size(), 2u);
  }
  expect_refused(run({"info", image, "--channel", "5"}), 2, {"--channel 5 is not there"});
  expect_refused(run({"info", image, "--time", "4"}), 2, {"--time 4 is not there"});
  expect_refused(run({"info", image, "--time", "-1"}), 2, {"-1"});
}

TEST_F(ForeignImage, ATurnedImageBecomesAMeshThatIsTurned) {
  const std::string image = write_image();
  ASSERT_EQ(run({"index", image, "--kind", "octree", "--channel", "1"}).exit_code, 0);
  const json mesh = run_json({"extract", image, "--channel", "1", "--isovalue", "0.5", "-o",
                              path("a.ply")})["surfaces"][0];
  EXPECT_GT(mesh["triangles"].get<int>(), 100);
  ASSERT_EQ(run({"verify", image, "--channel", "1"}).exit_code, 0);
  // The same after a conversion, which stores the direction in a key of its own.
  const Outcome converted = run({"convert", image, path("b.zarr"), "--channel", "1"});
  ASSERT_EQ(converted.exit_code, 0) << converted.err;
  const json info = run_json({"info", path("b.zarr")});
  EXPECT_EQ(info["direction"], json({0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0}));
  EXPECT_EQ(info["origin"], json({-20.0, 10.0, 30.0}));
  run_json({"extract", path("b.zarr"), "--isovalue", "0.5", "-o", path("b.ply")});
  EXPECT_TRUE(read_file(path("a.ply")) == read_file(path("b.ply")));
}

/// A chunk whose CRC-32C is 0, which stands for an absent brick.
TEST_F(ForeignImage, AChunkWithTheChecksumOfNoneIsRead) {
  const std::string image = path("zero.zarr");
  std::filesystem::create_directories(image + "/c/0/0");
  write_file(image + "/zarr.json",
             R"({"zarr_format":3,"node_type":"array","shape":[2,2,2],"data_type":"uint8",
                 "chunk_grid":{"name":"regular","configuration":{"chunk_shape":[2,2,2]}},
                 "chunk_key_encoding":{"name":"default"},"fill_value":0,
                 "codecs":[{"name":"bytes"}]})");
  write_file(image + "/c/0/0/0", "\x09\xc8\x1e\x4d\x09\xe2\xd8\xb9");
  ASSERT_EQ(run({"index", image, "--kind", "octree"}).exit_code, 0);
  EXPECT_EQ(run_json({"info", image})["value_range"], (json{9, 226}));
}

}  // namespace
}  // namespace isobrick::test
