#include <algorithm>
#include <filesystem>

#include "tests/tools/program.h"

// Parts of labels, made by commands of their own and merged: the folder of one command.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class LabelPartsOption : public ProgramTest {
 protected:
  void SetUp() override {
    run_json({"synth", "cells", store(), "--dims", "100,91,77", "--type", "u8", "--brick", "16"});
  }
  std::string store() const { return path("c.zarr"); }

  static Arguments words(Arguments first, const Arguments& more) {
    first.insert(first.end(), more.begin(), more.end());
    return first;
  }
  Arguments extract(const Arguments& more) const { return words({"extract", store()}, more); }
  Arguments make_pieces(int count, const Arguments& more) const {
    Arguments pieces;
    for (int i = 1; i <= count; ++i) {
      pieces.push_back(path("p" + std::to_string(i) + ".piece"));
      run_json(extract(words({"--part", std::to_string(i) + "/" + std::to_string(count), "-o",
                              pieces.back(), "--force"},
                             more)));
    }
    return pieces;
  }
  nlohmann::json merge(const Arguments& pieces, const Arguments& more) const {
    return run_json(words(words({"merge"}, pieces), more));
  }
  /// Every file of the folders, whose names may be in them.
  static void expect_same(const fs::path& a, const fs::path& b) {
    SCOPED_TRACE(a);
    const auto count = [](const fs::path& folder) {
      return std::distance(fs::recursive_directory_iterator(folder), {});
    };
    EXPECT_EQ(count(a), count(b));
    EXPECT_GT(count(a), 1);
    for (const auto& entry : fs::recursive_directory_iterator(a)) {
      if (!entry.is_regular_file()) continue;
      EXPECT_TRUE(read_file(entry.path()) == read_file(b / fs::relative(entry.path(), a)))
          << entry.path();
    }
  }
  std::size_t temporaries() const {
    const auto all = files();
    return static_cast<std::size_t>(std::count_if(all.begin(), all.end(), [](const auto& name) {
      return name != "c.zarr" && name != "one" && name != "parts" &&
             name.find(".piece") == std::string::npos;
    }));
  }
};

TEST_F(LabelPartsOption, BecomeTheFolderOfOneCommand) {
  struct Form {
    Arguments of_pieces, of_folder;
  };
  for (const Form& form :
       {Form{{"--labels", "all"}, {}},
        {{"--labels", "all", "--smooth", "3", "--pass-band", "0.2"}, {"--format", "stl"}},
        {{"--labels", "3,7,10:20"}, {"--simplify", "20%", "--measure"}},
        {{"--labels", "all", "--roi", "5:80,:,20:"}, {"--format", "glb", "--quantize"}},
        {{"--labels", "all", "--level", "1"}, {"--format", "obj"}},
        {{"--labels", "1:9"}, {"--format", "3dtiles", "--levels", "2"}}}) {
    const auto one = run_json(
        extract(words(words({"-o", path("one"), "--force"}, form.of_pieces), form.of_folder)));
    for (const int parts : {1, 3, 7}) {
      const auto merged = merge(make_pieces(parts, form.of_pieces),
                                words({"-o", path("parts"), "--force"}, form.of_folder));
      EXPECT_EQ(merged["pieces"], parts);
      for (const std::string member : {"labels", "triangles", "vertices", "output_bytes"})
        EXPECT_EQ(merged[member], one[member]) << member;
      expect_same(path("one"), path("parts"));
      EXPECT_EQ(temporaries(), 0u);
      if (parts > 1)
        for (int i = 1; i <= parts; ++i) fs::remove(path("p" + std::to_string(i) + ".piece"));
    }
  }
}

TEST_F(LabelPartsOption, BecomeSegmentsOfNeuroglancer) {
  const Outcome made = run(extract({"--labels", "all", "-o", path("one.neuroglancer")}));
  if (made.exit_code != 0) GTEST_SKIP() << made.err;  // without Draco
  const Arguments pieces = make_pieces(3, {"--labels", "all"});
  merge(pieces, {"-o", path("parts.neuroglancer")});
  expect_same(path("one.neuroglancer"), path("parts.neuroglancer"));
  run_json(extract({"--labels", "all", "-o", path("one2.neuroglancer"), "--sharded"}));
  merge(pieces, {"-o", path("parts2.neuroglancer"), "--sharded"});
  expect_same(path("one2.neuroglancer"), path("parts2.neuroglancer"));
}

TEST_F(LabelPartsOption, KeepNamesAndColours) {
  write_file(path("seg.nrrd"),
             "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 8 8 8\nencoding: raw\n"
             "Segment0_ID:=a\nSegment0_Name:=left kidney\nSegment0_LabelValue:=3\n"
             "Segment0_Color:=0.5 0 1\n\n" +
                 std::string(256, '\x03') + std::string(256, '\x02'));
  run_json({"convert", path("seg.nrrd"), path("seg.zarr"), "--brick", "16"});
  run_json({"extract", path("seg.zarr"), "--labels", "all", "-o", path("one")});
  run_json(
      {"extract", path("seg.zarr"), "--labels", "all", "--part", "1/1", "-o", path("seg.piece")});
  merge({path("seg.piece")}, {"-o", path("parts")});
  expect_same(path("one"), path("parts"));
  EXPECT_NE(read_file(path("parts/labels.json")).find("left kidney"), std::string::npos);
}

TEST_F(LabelPartsOption, HaveNamesOfTheirOwn) {
  const fs::path before = fs::current_path();
  fs::current_path(path(""));
  for (const std::string part : {"1/2", "2/2"})
    run_json({"extract", "c.zarr", "--labels", "all", "--part", part});
  EXPECT_EQ(merge({"c_labels_2of2.piece", "c_labels_1of2.piece"}, {})["output"], "c_labels");
  fs::rename("c_labels", "parts");
  run_json({"extract", "c.zarr", "--labels", "all"});
  expect_same("c_labels", "parts");
  fs::current_path(before);
}

TEST_F(LabelPartsOption, ThatAreThereAreKept) {
  const Arguments part = extract({"--labels", "all", "--part", "2/3", "-o", path("a.piece")});
  const auto made = run_json(part);
  EXPECT_EQ(made["part"], (nlohmann::json{{"number", 2}, {"count", 3}}));
  EXPECT_EQ(made["kept"], false);
  EXPECT_GT(made["bytes_read"], 0);
  const auto again = run_json(part);
  EXPECT_EQ(again["kept"], true);
  for (const std::string member : {"triangles", "vertices", "output_bytes", "output"})
    EXPECT_EQ(again[member], made[member]);
  EXPECT_NE(run(part).out.find("part 2 of 3: is there already"), std::string::npos);
  std::string bytes = read_file(path("a.piece"));
  bytes[bytes.size() / 2] ^= 1;
  write_file(path("a.piece"), bytes);
  EXPECT_EQ(run_json(part)["kept"], false);
  EXPECT_TRUE(run_json(words(part, {"--smooth", "1"}))["kept"] == false);
}

TEST_F(LabelPartsOption, ThatDoNotFitAreRefused) {
  const Arguments pieces = make_pieces(3, {"--labels", "all"});
  const auto refused = [&](const Arguments& some, int exit_code,
                           std::initializer_list<std::string> why) {
    expect_refused(run(words(words({"merge"}, some), {"-o", path("never")})), exit_code, why);
    EXPECT_FALSE(fs::exists(path("never")));
  };
  refused({pieces[0], pieces[2]}, 2, {"part 2 of 3 is missing"});
  refused({pieces[0], pieces[1], pieces[2], pieces[1]}, 2, {"both part 2 of 3"});
  run_json(extract({"--labels", "all", "--smooth", "2", "--part", "2/3", "-o", path("b.piece")}));
  refused({pieces[0], path("b.piece"), pieces[2]}, 2, {"b.piece", "smooth (0 and 2)"});
  run_json(extract({"--isovalue", "3", "--part", "2/3", "-o", path("i.piece")}));
  refused({pieces[0], path("i.piece"), pieces[2]}, 2,
          {"a piece of an isosurface, and not of labels"});
  expect_refused(run({"merge", path("i.piece"), pieces[0], "-o", path("never.ply")}), 2,
                 {"a piece of labels, and not of an isosurface"});
  std::string bytes = read_file(pieces[1]);
  bytes[bytes.size() / 2] ^= 1;
  write_file(path("c.piece"), bytes);
  refused({pieces[0], path("c.piece"), pieces[2]}, 1, {"c.piece", "make it again"});
  const auto with = [&](const Arguments& more, std::initializer_list<std::string> why) {
    expect_refused(run(words(words({"merge"}, pieces), more)), 2, why);
  };
  with({"-o", "-"}, {"name a folder"});
  with({"-o", path("a.ply")}, {"a folder with a mesh for each label"});
  with({"-o", path("a"), "--smooth", "3"}, {"--smooth", "extract --part"});
  with({"-o", path("a"), "--format", "pvtp"}, {"PVTP"});
  with({"-o", path("a"), "--attribute", "x=" + store()}, {"--attribute"});
  with({"-o", path("a"), "--memory", "1M"}, {"--memory"});
  const auto part = [&](const Arguments& more, std::initializer_list<std::string> why) {
    expect_refused(run(extract(words({"--labels", "all", "--part", "1/2"}, more))), 2, why);
  };
  part({"-o", path("a.ply")}, {"name it .piece"});
  part({"-o", path("a.piece"), "--simplify", "10%"}, {"give it to 'isobrick merge'"});
  part({"-o", path("a.piece"), "--format", "stl"}, {"give it to 'isobrick merge'"});
  part({"-o", path("a.piece"), "--normals", "none"}, {"give it to 'isobrick merge'"});
  part({"-o", path("a.piece"), "--isovalue", "3"}, {"--isovalue"});
  part({"-o", path("a.piece"), "--smooth", "7"}, {"0 to 6"});
  EXPECT_FALSE(fs::exists(path("a.piece")));
}

TEST_F(LabelPartsOption, NormalsMayBeLeftOut) {
  const Arguments labels{"--labels", "1:3"};
  run_json(extract(words(labels, {"-o", path("one.3dtiles"), "--normals", "none"})));
  merge(make_pieces(2, labels), {"-o", path("parts.3dtiles"), "--normals", "none"});
  expect_same(path("one.3dtiles"), path("parts.3dtiles"));
  // Of surfaces, too.
  run_json(extract({"--isovalue", "9", "--normals", "--part", "1/1", "-o", path("s.piece")}));
  merge({path("s.piece")}, {"-o", path("s.ply"), "--normals", "none"});
  run_json(extract({"--isovalue", "9", "--normals", "none", "-o", path("one.ply")}));
  EXPECT_TRUE(read_file(path("s.ply")) == read_file(path("one.ply")));
}

TEST_F(LabelPartsOption, ResumeAnExtraction) {
  const Arguments options{"--labels", "all", "--smooth", "1"};
  run_json(extract(words(options, {"-o", path("one")})));
  const Arguments resumable = extract(words(options, {"-o", path("parts"), "--resume"}));
  const fs::path folder = path("parts.pieces");
  // What an interrupted run leaves: a piece that is whole, or one that is not.
  for (const bool damaged : {false, true}) {
    fs::create_directory(folder);
    run_json(extract(words(options, {"--part", "1/1", "-o", folder / "1of1.piece"})));
    if (damaged) write_file(folder / "1of1.piece", read_file(folder / "1of1.piece").substr(0, 999));
    const auto made = run_json(resumable);
    EXPECT_EQ(made["pieces"], (nlohmann::json{{"total", 1}, {"kept", damaged ? 0 : 1}}));
    expect_same(path("one"), path("parts"));
    EXPECT_FALSE(fs::exists(folder));
    expect_refused(run(resumable), 2, {"exists already"});
    fs::remove_all(path("parts"));
  }
  EXPECT_GT(run_json(resumable)["bytes_read"], 0);
  EXPECT_EQ(temporaries(), 0u);
}

}  // namespace
}  // namespace isobrick::test
