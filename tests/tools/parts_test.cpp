#include <filesystem>

#include "tests/tools/program.h"

// Parts of a mesh, made by commands of their own and merged: the file of one command.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class Parts : public ProgramTest {
 protected:
  void SetUp() override {
    run_json({"synth", "gyroid", store(), "--dims", "100,91,77", "--type", "u8", "--brick", "32",
              "--levels", "2"});
  }
  std::string store() const { return path("g.zarr"); }

  Arguments words(Arguments first, const Arguments& more) const {
    first.insert(first.end(), more.begin(), more.end());
    return first;
  }
  Arguments extract(const Arguments& more) const {
    return words({"extract", store(), "--isovalue", "120"}, more);
  }
  /// The pieces of `count` parts, with more arguments of `extract`.
  Arguments make_pieces(int count, const Arguments& more = {}, const std::string& name = "p") {
    Arguments pieces;
    for (int i = 1; i <= count; ++i) {
      pieces.push_back(path(name + std::to_string(i) + ".piece"));
      run_json(extract(words(
          {"--part", std::to_string(i) + "/" + std::to_string(count), "-o", pieces.back()}, more)));
    }
    return pieces;
  }
  nlohmann::json merge(const Arguments& pieces, const Arguments& more) const {
    return run_json(words(words({"merge"}, pieces), more));
  }
  static void expect_same(const fs::path& a, const fs::path& b) {
    SCOPED_TRACE(a);
    ASSERT_EQ(fs::is_directory(a), fs::is_directory(b));
    if (!fs::is_directory(a)) {
      const std::string bytes = read_file(a);
      EXPECT_FALSE(bytes.empty());
      EXPECT_TRUE(bytes == read_file(b));
      return;
    }
    std::size_t files = 0;
    for (const auto& entry : fs::recursive_directory_iterator(a)) {
      if (!entry.is_regular_file()) continue;
      ++files;
      EXPECT_TRUE(read_file(entry.path()) == read_file(b / fs::relative(entry.path(), a)))
          << entry.path();
    }
    EXPECT_GT(files, 0u);
  }
};

TEST_F(Parts, BecomeTheFileOfOneCommandInEveryFormat) {
  const Arguments pieces = make_pieces(3);
  fs::create_directories(path("one"));
  fs::create_directories(path("parts"));
  for (const Arguments& form : {Arguments{"m.ply"},
                                {"m.stl"},
                                {"m.obj"},
                                {"m.vtp"},
                                {"m.glb"},
                                {"q.glb", "--quantize"},
                                {"c.glb", "--compress"}}) {
    const Arguments more(form.begin() + 1, form.end());
    if (form[0] == "c.glb" && !kCanCompress) continue;
    run_json(extract(words({"-o", path("one/" + form[0])}, more)));
    const auto made = merge(pieces, words({"-o", path("parts/" + form[0])}, more));
    EXPECT_EQ(made["pieces"], 3);
    EXPECT_EQ(made["isovalue"], 120);
    EXPECT_EQ(made["output_bytes"], fs::file_size(path("one/" + form[0])));
    EXPECT_EQ(made["vertices"].is_null(), form[0] == "m.stl");
    expect_same(path("one/" + form[0]), path("parts/" + form[0]));
  }
  run_json(extract({"-o", path("one/m.pvtp")}));
  merge(pieces, {"-o", path("parts/m.pvtp")});
  expect_same(path("one/m.pvtp"), path("parts/m.pvtp"));
  expect_same(path("one/m.pvtp.parts"), path("parts/m.pvtp.parts"));
}

TEST_F(Parts, BecomeLevelsOfDetail) {
  // The folder's name is in its files.
  fs::create_directories(path("one"));
  fs::create_directories(path("parts"));
  run_json(extract({"-o", path("one/m.3dtiles")}));
  merge(make_pieces(2), {"-o", path("parts/m.3dtiles")});
  expect_same(path("one/m.3dtiles"), path("parts/m.3dtiles"));
  const Outcome made = run(extract({"-o", path("one/m.neuroglancer")}));
  if (made.exit_code != 0) GTEST_SKIP() << made.err;  // without Draco
  const auto merged = merge(make_pieces(2), {"-o", path("parts/m.neuroglancer")});
  EXPECT_GT(merged["levels"].size(), 1u);
  expect_same(path("one/m.neuroglancer"), path("parts/m.neuroglancer"));
}

TEST_F(Parts, TakeTheOptionsOfAnExtraction) {
  for (const Arguments& options : {Arguments{"--normals", "none"},
                                   {"--drop-degenerate"},
                                   {"--topology", "trilinear"},
                                   {"--cap"},
                                   {"--inside", "below"},
                                   {"--level", "1"},
                                   {"--roi", "7:60,:,20:"},
                                   {"--region", "7:60,:,20:"}}) {
    run_json(extract(words({"-o", path("one.ply"), "--force"}, options)));
    merge(make_pieces(4, options), {"-o", path("parts.ply"), "--force"});
    expect_same(path("one.ply"), path("parts.ply"));
  }
}

TEST_F(Parts, AreFilteredWhenTheyAreMerged) {
  const Arguments pieces = make_pieces(4);
  for (const Arguments& filter : {Arguments{"--simplify", "20%"},
                                  {"--smooth", "5", "--mesh-unit", "mm"},
                                  {"--largest", "1", "--measure"},
                                  {"--measure"}}) {
    if (filter.size() == 4) continue;  // the volume has no unit
    for (const std::string extension : {".ply", ".stl"}) {
      const auto one = run_json(
          extract(words({"-o", path("one" + extension), "--force"}, filter)))["surfaces"][0];
      const auto parts = merge(pieces, words({"-o", path("parts" + extension), "--force"}, filter));
      expect_same(path("one" + extension), path("parts" + extension));
      for (const std::string member : {"triangles", "measure", "extracted", "simplify_goal"})
        EXPECT_EQ(one.value(member, nlohmann::json()), parts.value(member, nlohmann::json()))
            << member;
    }
  }
}

TEST_F(Parts, GetAttributesWhenTheyAreMerged) {
  run_json({"synth", "sphere", path("s.zarr"), "--dims", "100,91,77", "--type", "f32"});
  const Arguments attribute{"--attribute", "distance=" + path("s.zarr"), "--smooth", "2"};
  run_json(extract(words({"-o", path("one.ply")}, attribute)));
  const auto made = merge(make_pieces(3), words({"-o", path("parts.ply")}, attribute));
  EXPECT_EQ(made["attributes"], (Arguments{"distance"}));
  expect_same(path("one.ply"), path("parts.ply"));
  run_json(extract(words({"-o", path("resumed.ply"), "--resume"}, attribute)));
  expect_same(path("one.ply"), path("resumed.ply"));
  const Arguments alone{"--attribute", "distance=" + path("s.zarr")};
  expect_refused(run(extract(words({"--part", "1/2"}, alone))), 2, {"isobrick merge"});
  expect_refused(run(words({"merge", path("p1.piece"), "-o", path("a.stl")}, alone)), 2,
                 {"--attribute", "STL"});
}

TEST_F(Parts, HaveNamesOfTheirOwn) {
  const fs::path before = fs::current_path();
  fs::current_path(path(""));
  for (const std::string part : {"1/2", "2/2"})
    run_json({"extract", "g.zarr", "--isovalue", "120,130", "--part", part});
  EXPECT_EQ(merge({"g_130_2of2.piece", "g_130_1of2.piece"}, {})["output"], "g_130.ply");
  merge({"g_120_2of2.piece", "g_120_1of2.piece"}, {"--format", "stl"});
  run_json({"extract", "g.zarr", "--isovalue", "120,130", "-o", "one.ply"});
  expect_same("one_130.ply", "g_130.ply");
  EXPECT_TRUE(fs::exists("g_120.stl"));
  fs::current_path(before);
}

TEST_F(Parts, ThatAreThereAreKept) {
  const Arguments part = extract({"--part", "2/3", "-o", path("a.piece")});
  const auto made = run_json(part);
  EXPECT_EQ(made["part"], (nlohmann::json{{"number", 2}, {"count", 3}}));
  EXPECT_EQ(made["surfaces"][0]["kept"], false);
  EXPECT_GT(made["surfaces"][0]["bytes_read"], 0);
  const auto again = run_json(part);
  EXPECT_EQ(again["surfaces"][0]["kept"], true);
  for (const std::string member : {"triangles", "vertices", "output_bytes", "output"})
    EXPECT_EQ(again["surfaces"][0][member], made["surfaces"][0][member]);
  const Outcome text = run(part);
  EXPECT_NE(text.out.find("part 2 of 3, isovalue 120: is there already"), std::string::npos)
      << text.out;
  std::string bytes = read_file(path("a.piece"));
  bytes[bytes.size() / 2] ^= 1;
  write_file(path("a.piece"), bytes);
  EXPECT_EQ(run_json(part)["surfaces"][0]["kept"], false);
  EXPECT_EQ(run_json(part)["surfaces"][0]["kept"], true);
}

TEST_F(Parts, GoToStandardOutputWhenTheyAreMerged) {
  const Arguments pieces = make_pieces(2);
  const Outcome outcome = run(words(words({"merge"}, pieces), {"-o", "-"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  run_json(extract({"-o", path("one.ply")}));
  EXPECT_TRUE(outcome.out == read_file(path("one.ply")));
}

TEST_F(Parts, RefuseWhatIsForTheWholeMesh) {
  const auto refused = [&](const Arguments& more, const std::string& why) {
    expect_refused(run(extract(words({"--part", "1/2"}, more))), 2, {"--part", why});
  };
  refused({"-o", path("a.ply")}, "name it .piece");
  refused({"-o", "-"}, "name it with -o");
  refused({"-o", path("a.piece"), "--simplify", "10%"}, "give it to 'isobrick merge'");
  refused({"-o", path("a.piece"), "--format", "stl"}, "give it to 'isobrick merge'");
  refused({"-o", path("a.piece"), "--preset", "print"}, "give it to 'isobrick merge'");
  refused({"-o", path("a.piece"), "--preview", path("a.png")}, "--preview");
  refused({"-o", path("a.piece"), "--device", "0,1"}, "a second device");
  expect_refused(run(extract({"--part", "3/2"})), 2, {"--part", "3"});
  expect_refused(run(extract({"--part", "0/2"})), 2, {"--part", "0"});
  expect_refused(run(extract({"--part", "two"})), 2, {"--part", "such as 3/8"});
  write_file(path("a.raw"), noise(1000));
  expect_refused(run({"extract", path("a.raw"), "--dims", "10,10,10", "--type", "u8", "--isovalue",
                      "3", "--part", "1/2"}),
                 2, {"isobrick convert"});
}

TEST_F(Parts, ThatDoNotFitAreRefused) {
  const Arguments pieces = make_pieces(3);
  const auto refused = [&](const Arguments& some, int exit_code,
                           std::initializer_list<std::string> why) {
    expect_refused(run(words(words({"merge"}, some), {"-o", path("never.ply")})), exit_code, why);
    EXPECT_FALSE(fs::exists(path("never.ply")));
  };
  refused({pieces[0], pieces[2]}, 2, {"part 2 of 3 is missing"});
  refused({pieces[0], pieces[1], pieces[2], pieces[1]}, 2, {"both part 2 of 3"});
  run_json({"extract", store(), "--isovalue", "130", "--part", "2/3", "-o", path("b.piece")});
  refused({pieces[0], path("b.piece"), pieces[2]}, 2, {"b.piece", "isovalue (120.0 and 130.0)"});
  std::string bytes = read_file(pieces[1]);
  bytes[bytes.size() / 2] ^= 1;
  write_file(path("c.piece"), bytes);
  refused({pieces[0], path("c.piece"), pieces[2]}, 1, {"c.piece", "make it again"});
  write_file(path("d.piece"), bytes.substr(0, bytes.size() / 2));
  refused({pieces[0], path("d.piece"), pieces[2]}, 1, {"d.piece", "make it again"});
  refused({pieces[0], store(), pieces[2]}, 2, {"g.zarr"});
  expect_refused(run(words(words({"merge"}, pieces), {"-o", path("m.ply"), "--memory", "1M"})), 2,
                 {"--memory"});
  expect_refused(
      run(words(words({"merge"}, pieces), {"-o", pieces[0], "--force", "--format", "ply"})), 2, {});
}

TEST_F(Parts, KeepABudgetWhenTheyAreMerged) {
  const Arguments pieces = make_pieces(5);
  run_json(extract({"-o", path("one.ply")}));
  const Outcome refused =
      run(words(words({"merge"}, pieces), {"-o", path("m.ply"), "--memory", "1M"}));
  const std::size_t at = refused.err.find("--memory ");
  ASSERT_NE(at, std::string::npos) << refused.err;
  const std::string least = std::to_string(std::stoi(refused.err.substr(at + 9))) + "M";
  const auto made = merge(pieces, {"-o", path("m.ply"), "--memory", least});
  expect_same(path("one.ply"), path("m.ply"));
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  EXPECT_LE(made["peak_resident_bytes"].get<std::uint64_t>(), std::stoull(least) << 20);
#endif
}

TEST_F(Parts, ResumeAnExtraction) {
  const Arguments options{"--drop-degenerate", "--largest", "2", "--measure"};
  run_json(extract(words({"-o", path("one.glb")}, options)));
  const Arguments resumable = extract(words({"-o", path("r.glb"), "--resume"}, options));
  // What an interrupted run leaves: a piece that is whole, or one that is not.
  const fs::path folder = path("r.glb.pieces");
  for (const bool damaged : {false, true}) {
    fs::create_directory(folder);
    run_json(extract({"--part", "1/1", "--drop-degenerate", "-o", folder / "1of1.piece"}));
    if (damaged) write_file(folder / "1of1.piece", read_file(folder / "1of1.piece").substr(0, 999));
    const auto made = run_json(resumable)["surfaces"][0];
    EXPECT_EQ(made["pieces"], (nlohmann::json{{"total", 1}, {"kept", damaged ? 0 : 1}}));
    EXPECT_EQ(made["output_bytes"], fs::file_size(path("one.glb")));
    EXPECT_TRUE(made.contains("measure"));
    expect_same(path("one.glb"), path("r.glb"));
    EXPECT_FALSE(fs::exists(folder));
    expect_refused(run(resumable), 2, {"exists already"});
    fs::remove(path("r.glb"));
  }
  const auto fresh = run_json(resumable)["surfaces"][0];
  EXPECT_EQ(fresh["pieces"]["kept"], 0);
  EXPECT_GT(fresh["bytes_read"], 0);
}

TEST_F(Parts, ResumeLeavesOtherFilesInItsFolder) {
  fs::create_directory(path("r.ply.pieces"));
  for (const char* name : {"notes.txt", "a.piece", "3of8.piece"})
    write_file(path("r.ply.pieces") + "/" + name, "mine");
  run_json(extract({"-o", path("r.ply"), "--resume"}));
  EXPECT_EQ(read_file(path("r.ply.pieces/notes.txt")), "mine");
  EXPECT_EQ(read_file(path("r.ply.pieces/a.piece")), "mine");
  EXPECT_FALSE(fs::exists(path("r.ply.pieces/3of8.piece"))) << "of other parts, by its name";
  expect_refused(run(extract({"-o", "-", "--resume"})), 2, {"--resume", "-o"});
  expect_refused(run(extract({"-o", path("p.ply"), "--resume", "--preview", path("p.png")})), 2,
                 {"--resume", "--preview"});
}

TEST_F(Parts, OfAConversionBecomeTheStoreOfOneCommand) {
  write_file(path("v.raw"), noise(1100 * 40 * 20));
  const Arguments convert{"convert", path("v.raw"), "--dims",  "1100,40,20",
                          "--type",  "u8",          "--brick", "16"};
  run_json(words(convert, {"--shard", "64", path("one.zarr")}));
  const Arguments parts = words(convert, {"--shard", "64", path("p.zarr")});
  EXPECT_EQ(run_json(words(parts, {"--part", "2/2"}))["output"], path("p.zarr.parts/2of2"));
  expect_refused(run(words(parts, {"--join", "2"})), 2, {"no whole part 1;", "--part 1/2"});
  run_json(words(parts, {"--part", "1/2"}));
  const auto again = run_json(words(parts, {"--part", "1/2"}));
  EXPECT_EQ(again["bricks"]["kept"], again["bricks"]["total"]);
  run_json(words(parts, {"--join", "2"}));
  expect_same(path("one.zarr"), path("p.zarr"));
  EXPECT_FALSE(fs::exists(path("p.zarr.parts")));
  expect_refused(run(words(parts, {"--part", "1/2"})), 2, {"p.zarr", "--force"});
  expect_refused(run(words(parts, {"--part", "1/2", "--join", "2", "--force"})), 2, {"joined"});
  EXPECT_EQ(run({"verify", path("p.zarr")}).exit_code, 0);
}

}  // namespace
}  // namespace isobrick::test
