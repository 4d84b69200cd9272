#include <filesystem>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

/// `extract --labels`.
class LabelOption : public ProgramTest {
 protected:
  LabelOption() : store_(path("cells.zarr")) {
    const Outcome made = run({"synth", "cells", store_, "--dims", "60,50,40", "--type", "u8",
                              "--brick", "16", "--downsample", "mode"});
    EXPECT_EQ(made.exit_code, 0) << made.err;
  }

  nlohmann::json extract(const Arguments& more) const {
    Arguments words{"extract", store_};
    words.insert(words.end(), more.begin(), more.end());
    return run_json(words);
  }
  Outcome refused(const Arguments& more) const {
    Arguments words{"extract", store_, "-o", path("never")};
    words.insert(words.end(), more.begin(), more.end());
    Outcome outcome = run(words);
    EXPECT_FALSE(fs::exists(path("never")));
    EXPECT_EQ(files(), (std::vector<std::string>{"cells.zarr"}));
    return outcome;
  }
  nlohmann::json list(const std::string& folder) const {
    return nlohmann::json::parse(read_file(path(folder) + "/labels.json"));
  }

  std::string store_;
};

TEST_F(LabelOption, WritesAMeshOfEachLabelAndAList) {
  const nlohmann::json json = extract({"--labels", "all", "-o", path("out")});
  EXPECT_EQ(json["output"], path("out"));
  EXPECT_EQ(json["level"], 0);
  EXPECT_GT(json["bricks"]["read"].get<int>(), 0);
  EXPECT_GT(json["scratch_bytes"].get<int>(), 0);
  EXPECT_GT(json["peak_resident_bytes"].get<std::uint64_t>(), 0u);
  const nlohmann::json labels = list("out")["labels"];
  ASSERT_EQ(labels.size(), json["labels"].get<std::size_t>());
  EXPECT_GT(labels.size(), 50u);
  std::uint64_t triangles = 0, bytes = 0;
  std::int64_t last = 0;
  for (const nlohmann::json& entry : labels) {
    EXPECT_GT(entry["label"].get<std::int64_t>(), last);
    last = entry["label"].get<std::int64_t>();
    triangles += entry["triangles"].get<std::uint64_t>();
    EXPECT_EQ(entry["file"], std::to_string(last) + ".ply");
    const std::string mesh = read_file(path("out") + "/" + entry["file"].get<std::string>());
    bytes += mesh.size();
    EXPECT_NE(mesh.find("element face " + entry["triangles"].dump()), std::string::npos);
    EXPECT_NE(mesh.find("element vertex " + entry["vertices"].dump()), std::string::npos);
  }
  EXPECT_EQ(json["triangles"], triangles);
  EXPECT_EQ(json["output_bytes"], bytes + fs::file_size(path("out") + "/labels.json"));
  EXPECT_EQ(files(), (std::vector<std::string>{"cells.zarr", "out"}));
}

TEST_F(LabelOption, ChoosesLabels) {
  EXPECT_EQ(extract({"--labels", "7", "-o", path("one")})["labels"], 1);
  const nlohmann::json some = extract({"--labels", "7,10:12", "-o", path("some/")});
  EXPECT_EQ(some["labels"], 4);
  EXPECT_EQ(read_file(path("one/7.ply")), read_file(path("some/7.ply")));
  EXPECT_EQ(extract({"--labels", "0", "-o", path("background")})["labels"], 1);
}

TEST_F(LabelOption, WritesEveryFormat) {
  for (const char* format : {"stl", "obj", "glb", "vtp"}) {
    const nlohmann::json json = extract({"--labels", "7", "--format", format, "-o", path(format)});
    EXPECT_GT(fs::file_size(path(format) + "/7." + format), 1000u);
    EXPECT_EQ(list(format)["labels"][0]["triangles"], json["triangles"]);
  }
  EXPECT_TRUE(list("stl")["labels"][0]["vertices"].is_null());
  extract({"--labels", "7", "--format", "glb", "--quantize", "-o", path("small")});
  EXPECT_LT(fs::file_size(path("small/7.glb")), fs::file_size(path("glb/7.glb")));
  if (!kCanCompress) return;
  extract({"--labels", "7", "--format", "glb", "--compress", "-o", path("packed")});
  EXPECT_LT(fs::file_size(path("packed/7.glb")), fs::file_size(path("small/7.glb")));
}

TEST_F(LabelOption, FiltersEachMesh) {
  extract({"--labels", "5:9", "-o", path("plain"), "--measure"});
  extract(
      {"--labels", "5:9", "-o", path("few"), "--simplify", "10%", "--measure", "--smooth", "3"});
  for (std::size_t i = 0; i < 5; ++i) {
    const nlohmann::json plain = list("plain")["labels"][i], few = list("few")["labels"][i];
    EXPECT_EQ(plain["measure"]["closed"], true);
    EXPECT_EQ(few["measure"]["closed"], true);
    EXPECT_LT(few["triangles"].get<int>(), plain["triangles"].get<int>() / 8);
  }
}

TEST_F(LabelOption, TakesAnyInput) {
  write_file(path("a_8x8x8_uint8.raw"), std::string(512, '\x03'));
  run_json({"extract", path("a_8x8x8_uint8.raw"), "--labels", "all", "-o", path("raw"), "--cache",
            "none"});
  EXPECT_EQ(list("raw")["labels"][0]["label"], 3);
  const nlohmann::json region =
      extract({"--labels", "all", "--roi", "0:20,0:20,0:20", "-o", path("part")});
  EXPECT_LT(region["labels"].get<int>(), 30);
}

TEST_F(LabelOption, NamesAndColoursAreThoseOfTheImage) {
  const std::string segments =
      "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 8 8 8\nencoding: raw\n"
      "Segment0_ID:=Segment_1\nSegment0_Name:=left kidney\nSegment0_LabelValue:=3\n"
      "Segment0_Color:=0.5 0 1\n"
      "Segment1_ID:=Segment_2\nSegment1_Name:=spleen\nSegment1_LabelValue:=2\n"
      "Segment1_Color:=x\n"
      "Segment2_ID:=Segment_3\nSegment2_LabelValue:=none\n\n";
  write_file(path("seg.nrrd"), segments + std::string(256, '\x03') + std::string(256, '\x02'));
  const nlohmann::json expected = nlohmann::json::parse(
      R"([{"label":2,"name":"spleen"},{"label":3,"name":"left kidney","colour":[128,0,255,255]}])");
  EXPECT_EQ(run_json({"info", path("seg.nrrd")})["labels"], expected);
  run_json({"convert", path("seg.nrrd"), path("seg.zarr"), "--brick", "16"});
  run_json({"convert", path("seg.zarr"), path("again.zarr"), "--ome", "0.4"});
  for (const char* name : {"seg.zarr", "again.zarr", "seg.nrrd"}) {
    EXPECT_EQ(run_json({"info", path(name)})["labels"], expected) << name;
    run_json({"extract", path(name), "--labels", "all", "-o", path("meshes"), "--force"});
    const nlohmann::json labels = list("meshes")["labels"];
    ASSERT_EQ(labels.size(), 2u);
    EXPECT_EQ(labels[0]["name"], "spleen");
    EXPECT_EQ(labels[1]["name"], "left kidney");
    EXPECT_EQ(labels[1]["colour"], expected[1]["colour"]);
  }
  const auto kidney = [&](const std::string& format) {
    run_json({"extract", path("seg.zarr"), "--labels", "3", "--format", format, "-o",
              path("in_" + format)});
    return read_file(path("in_" + format) + "/3." + format);
  };
  const std::string ply = kidney("ply"), glb = kidney("glb");
  EXPECT_NE(ply.find("comment name left kidney\n"), ply.npos);
  EXPECT_NE(ply.find("property uchar red\n"), ply.npos);
  EXPECT_NE(kidney("obj").find("\no left kidney\nv "), std::string::npos);
  EXPECT_NE(glb.find(R"("nodes":[{"name":"left kidney","mesh":0)"), glb.npos);
  EXPECT_NE(glb.find(R"("baseColorFactor":[0.2159,0.0,1.0,1])"), glb.npos);
  EXPECT_TRUE(run_json({"info", make_store("a")})["labels"].is_null());
  EXPECT_EQ(run_json({"info", store_})["labels"], nlohmann::json::array());
}

TEST_F(LabelOption, CoarserLevelsOfLabelImagesHaveLabels) {
  const Outcome made = run(
      {"synth", "cells", path("b.zarr"), "--dims", "60,50,40", "--type", "u8", "--brick", "16"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_EQ(read_file(path("b.zarr/1/zarr.json")), read_file(store_ + "/1/zarr.json"));
  EXPECT_NE(read_file(path("b.zarr/zarr.json")).find("\"mode\""), std::string::npos);
  // What the cache makes for labels is not what it makes for isosurfaces.
  write_file(path("a_80x80x80_uint8.raw"), noise(80 * 80 * 80));
  for (const char* order : {"first", "second"}) {
    const Outcome surface =
        run({"extract", path("a_80x80x80_uint8.raw"), "--isovalue", "127.5", "--level", "1", "-o",
             path(std::string(order) + ".ply"), "--cache", path("cache")});
    EXPECT_EQ(surface.exit_code, 0) << surface.err;
    run_json({"extract", path("a_80x80x80_uint8.raw"), "--labels", "1", "--level", "0", "-o",
              path(order), "--cache", path("cache")});
  }
  EXPECT_EQ(read_file(path("first.ply")), read_file(path("second.ply")));
}

TEST_F(LabelOption, LabelImagesInAGroupAreListed) {
  fs::create_directories(path("scan.zarr/labels"));
  run_json({"convert", store_, path("scan.zarr/labels/cells"), "--brick", "16"});
  const Outcome made =
      run({"synth", "sphere", path("image.zarr"), "--dims", "60,50,40", "--type", "u8"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  fs::copy(path("image.zarr"), path("scan.zarr"), fs::copy_options::recursive);
  EXPECT_TRUE(run_json({"info", path("scan.zarr")})["label_images"].empty());
  write_file(path("scan.zarr/labels/zarr.json"),
             R"({"zarr_format":3,"node_type":"group","attributes":{"ome":{"version":"0.5",
                 "labels":["cells"]}}})");
  EXPECT_EQ(run_json({"info", path("scan.zarr")})["label_images"],
            nlohmann::json::parse(R"(["cells"])"));
  EXPECT_EQ(run_json({"extract", path("scan.zarr/labels/cells"), "--labels", "7", "-o",
                      path("meshes")})["labels"],
            1);
  fs::remove(path("scan.zarr/labels/zarr.json"));
  write_file(path("scan.zarr/labels/.zattrs"), R"({"labels": ["cells"]})");
  EXPECT_EQ(run_json({"info", path("scan.zarr")})["label_images"].size(), 1u);
  write_file(path("scan.zarr/labels/.zattrs"), R"({"labels": 3})");
  expect_refused(run({"info", path("scan.zarr")}), 1, {"labels/.zattrs"});
}

TEST_F(LabelOption, LabelImagesOfAGroupAreInputs) {
  const auto triangles = [&](const std::string& input) {
    run_json({"extract", input, "--labels", "all", "-o", path("meshes"), "--force"});
    return list("meshes")["labels"];
  };
  const nlohmann::json expected = triangles(store_);
  fs::create_directories(path("scan.zarr/labels"));
  for (const char* version : {"0.4", "0.5"}) {
    const std::string name = path("scan.zarr/labels/cells") + version;
    run_json({"convert", store_, name, "--ome", version, "--brick", "16"});
    EXPECT_EQ(triangles(name), expected) << version;
    const nlohmann::json info = run_json({"info", name});
    EXPECT_EQ(info["labels"], nlohmann::json::array()) << version;
    EXPECT_NE(run({"info", name}).out.find("label image  0 names, 0 colours"), std::string::npos);
    EXPECT_EQ(run({"verify", name}).exit_code, 0) << version;
  }
  // The same in a zip, next to an image.
  fs::copy(path("scan.zarr/labels/cells0.5"), path("scan.zarr"), fs::copy_options::recursive);
  write_file(path("scan.zarr/labels/.zattrs"), R"({"labels": ["cells0.4", "cells0.5"]})");
  const std::string zip = path("scan.zarr.zip");
  const std::string python =
      "import os, sys, zipfile\n"
      "store, out = sys.argv[1:]\n"
      "with zipfile.ZipFile(out, 'w') as zip:\n"
      "  for folder, _, names in os.walk(store):\n"
      "    for name in names:\n"
      "      zip.write(os.path.join(folder, name), os.path.relpath(os.path.join(folder, name), "
      "store))\n";
  ASSERT_EQ(run_process({"python3", "-c", python, path("scan.zarr"), zip}).exit_code, 0);
  EXPECT_EQ(run_json({"info", zip})["label_images"],
            nlohmann::json::parse(R"(["cells0.4", "cells0.5"])"));
  for (const char* name : {"/labels/cells0.4", "/labels/cells0.5/"}) {
    EXPECT_EQ(triangles(zip + name), expected) << name;
    EXPECT_EQ(run_json({"info", zip + name})["labels"], nlohmann::json::array()) << name;
    EXPECT_EQ(run({"verify", zip + name}).exit_code, 0) << name;
    run_json({"convert", zip + name, path("again.zarr"), "--force", "--brick", "16"});
    EXPECT_EQ(triangles(path("again.zarr")), expected) << name;
    expect_refused(run({"index", zip + name}), 2, {"is a zip"});
  }
  expect_refused(run({"info", zip + "/labels/none"}), 1, {"scan.zarr.zip/labels/none"});
  expect_refused(run({"info", path("none.zip/labels/a")}), 1, {"none.zip/labels/a"});
}

TEST_F(LabelOption, AMeanOfLabelsIsMadeWithANote) {
  const auto convert = [&](const std::string& out, const char* rule) {
    Outcome outcome = run({"convert", store_, path(out), "--downsample", rule, "--brick", "16"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome.err;
  };
  EXPECT_NE(convert("mean.zarr", "mean").find("label image"), std::string::npos);
  EXPECT_NE(read_file(path("mean.zarr/zarr.json")).find("\"type\": \"mean\""), std::string::npos);
  EXPECT_EQ(convert("mode.zarr", "mode").find("label image"), std::string::npos);
  EXPECT_EQ(convert("max.zarr", "max").find("label image"), std::string::npos);
}

TEST_F(LabelOption, ReadsTheBricksOfALabelByLists) {
  const auto made = run_json({"index", store_, "--kind", "labels"});
  EXPECT_EQ(made["kind"], "labels");
  EXPECT_EQ(made["leaf"], 32);
  EXPECT_GT(made["bytes"], 0);
  expect_refused(run({"index", store_, "--kind", "labels"}), 2,
                 {"labels index already", "--force"});
  const auto info = run_json({"info", store_});
  EXPECT_EQ(info["indexes"][0]["kind"], "labels");
  EXPECT_NE(run({"info", store_}).out.find("labels, leaf 32"), std::string::npos);
  EXPECT_NE(run({"verify", store_}).out.find("labels index"), std::string::npos);
  const auto lists = extract({"--labels", "7", "-o", path("lists")});
  const auto ranges = extract({"--labels", "7", "-o", path("ranges"), "--search", "linear"});
  EXPECT_GT(lists["index_bytes"], 0);
  EXPECT_EQ(ranges["index_bytes"], 0);
  EXPECT_LT(lists["bricks"]["read"].get<int>(), ranges["bricks"]["read"].get<int>());
  EXPECT_EQ(read_file(path("lists/7.ply")), read_file(path("ranges/7.ply")));
  EXPECT_EQ(extract({"--labels", "all", "-o", path("all")})["index_bytes"], 0);
  expect_refused(run({"extract", store_, "--labels", "7", "-o", path("a"), "--search", "octree"}),
                 2, {"--search"});
  expect_refused(
      run({"extract", store_, "--isovalue", "7", "-o", path("a.ply"), "--search", "labels"}), 2,
      {"unknown search 'labels'"});
  expect_refused(run({"index", store_, "--kind", "labels", "--part", "1/2"}), 2, {"has no parts"});
  expect_refused(run({"index", store_, "--kind", "labels", "--leaf", "4"}), 2, {"--leaf"});
  expect_refused(run({"index", store_, "--kind", "labels", "--force", "--memory", "1M"}), 2,
                 {"--memory"});
  expect_refused(run({"index", store_, "--kind", "names"}), 2, {"unknown kind 'names'", "labels"});
}

TEST_F(LabelOption, ListsAreAddedByAConversion) {
  const auto made = run_json(
      {"convert", store_, path("listed.zarr"), "--brick", "16", "--build-index", "labels"});
  EXPECT_GT(made["index_bytes"], 0);
  EXPECT_EQ(run_json({"info", path("listed.zarr")})["indexes"][0]["kind"], "labels");
  EXPECT_EQ(run({"verify", path("listed.zarr")}).exit_code, 0);
  run_json({"extract", path("listed.zarr"), "--labels", "7", "-o", path("lists")});
  extract({"--labels", "7", "-o", path("ranges")});
  EXPECT_EQ(read_file(path("lists/7.ply")), read_file(path("ranges/7.ply")));
  expect_refused(run({"synth", "cells", path("a.raw"), "--dims", "9,9,9", "--type", "u8",
                      "--build-index", "labels"}),
                 2, {"--build-index"});
}

TEST_F(LabelOption, ReplacesOnlyItsOwnFolder) {
  extract({"--labels", "7", "-o", path("out")});
  const Arguments again{"extract", store_, "--labels", "8", "-o", path("out")};
  expect_refused(run(again), 2, {"exists already", "--force"});
  EXPECT_EQ(extract({"--labels", "8", "-o", path("out"), "--force"})["labels"], 1);
  EXPECT_FALSE(fs::exists(path("out/7.ply")));
  EXPECT_TRUE(fs::exists(path("out/8.ply")));
  write_file(path("out/notes.txt"), "mine");
  Arguments forced = again;
  forced.push_back("--force");
  expect_refused(run(forced), 2, {"notes.txt", "move it away"});
  EXPECT_TRUE(fs::exists(path("out/notes.txt")));
  write_file(path("file"), "");
  expect_refused(run({"extract", store_, "--labels", "8", "-o", path("file"), "--force"}), 2,
                 {"is no folder"});
}

TEST_F(LabelOption, RefusesWhatMakesNoSense) {
  expect_refused(refused({"--labels", "300"}), 2, {"has no label 300"});
  expect_refused(refused({"--labels", "7", "--roi", "50:60,40:50,30:40"}), 2,
                 {"has no label 7 in the region"});
  expect_refused(refused({"--labels", "x"}), 2, {"'x' is no label"});
  expect_refused(refused({"--labels", "3,"}), 2, {"'' is no label"});
  expect_refused(refused({"--labels", "9:5"}), 2, {"ends before it begins"});
  expect_refused(refused({"--labels", "99999999999999999999"}), 2, {"is no label"});
  expect_refused(refused({"--labels", "all", "--isovalue", "3"}), 2, {"--isovalue", "--labels"});
  expect_refused(refused({"--labels", "all", "--cap"}), 2, {"--cap", "--labels"});
  expect_refused(refused({"--labels", "all", "--smooth", "7"}), 2, {"0 to 6"});
  expect_refused(refused({"--labels", "all", "--level", "9"}), 2, {"level 9"});
  expect_refused(refused({"--labels", "all", "--format", "pvtp"}), 2, {"PVTP"});
  expect_refused(refused({"--labels", "all", "--quantize"}), 2, {"--format glb"});
  expect_refused(refused({"--labels", "all", "--compress"}), 2, {"--format glb"});
  expect_refused(refused({"--labels", "all", "--memory", "20M"}), 2, {"--memory"});
  expect_refused(run({"extract", store_, "--labels", "all", "-o", path("a.ply")}), 2,
                 {"a folder with a mesh for each label"});
  expect_refused(run({"extract", store_, "--labels", "all", "-o", "-"}), 2, {"name a folder"});
}

TEST_F(LabelOption, RefusesSamplesThatAreNoLabels) {
  const Outcome made =
      run({"synth", "sphere", path("b.zarr"), "--dims", "30,30,30", "--type", "f32"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  expect_refused(run({"extract", path("b.zarr"), "--labels", "all", "-o", path("never")}), 1,
                 {"is no label image"});
  EXPECT_FALSE(fs::exists(path("never")));
}

}  // namespace
}  // namespace isobrick::test
