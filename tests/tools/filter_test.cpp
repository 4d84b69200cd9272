#include <cmath>
#include <cstring>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

/// Filters of meshes as options of the program.
class Filter : public ProgramTest {
 protected:
  Filter() : store_(make_store("a")) {
    // Noise: a surface of many pieces.
    write_file(path("noise.raw"), noise(24 * 24 * 24));
    const Outcome made = run({"convert", path("noise.raw"), "--dims", "24,24,24", "--type", "u8",
                              path("noise.zarr"), "--spacing", "0.5,0.5,0.5", "--unit", "mm"});
    EXPECT_EQ(made.exit_code, 0) << made.err;
  }

  nlohmann::json extract(const std::string& store, const std::string& isovalue,
                         const std::string& output, const Arguments& more) const {
    Arguments words{"extract", store, "--isovalue", isovalue, "-o", path(output), "--force"};
    words.insert(words.end(), more.begin(), more.end());
    return run_json(words)["surfaces"][0];
  }
  nlohmann::json of_noise(const std::string& output, const Arguments& more) const {
    return extract(path("noise.zarr"), "250.5", output, more);
  }
  Outcome refused(const Arguments& more) const {
    Arguments words{"extract", store_, "--isovalue", "127.5", "-o", path("never.ply")};
    words.insert(words.end(), more.begin(), more.end());
    Outcome outcome = run(words);
    EXPECT_FALSE(std::filesystem::exists(path("never.ply")));
    return outcome;
  }

  std::string store_;
};

TEST_F(Filter, MeasuresWhatItWrites) {
  const nlohmann::json plain = of_noise("plain.ply", {});
  EXPECT_FALSE(plain.contains("measure"));
  EXPECT_FALSE(plain.contains("extracted"));
  const nlohmann::json surface = of_noise("measured.ply", {"--measure"});
  const nlohmann::json& measure = surface["measure"];
  EXPECT_EQ(read_file(path("measured.ply")), read_file(path("plain.ply")));
  EXPECT_GT(measure["components"].get<int>(), 50);
  EXPECT_GT(measure["open_sides"].get<int>(), 0);  // pieces at the border
  EXPECT_EQ(measure["closed"], false);
  EXPECT_TRUE(measure["volume"].is_null());
  EXPECT_GT(measure["area"].get<double>(), 0);
  EXPECT_EQ(measure["unit"], "millimeter");
  EXPECT_GE(measure["bounds"]["lo"][0].get<double>(), 0);
  EXPECT_LE(measure["bounds"]["hi"][2].get<double>(), 11.5);
  const Outcome text = run(
      {"extract", path("noise.zarr"), "--isovalue", "250.5", "-o", path("text.ply"), "--measure"});
  EXPECT_NE(text.out.find(" components, Euler number "), std::string::npos) << text.out;
  EXPECT_NE(text.out.find(" millimeter², open at "), std::string::npos) << text.out;
}

TEST_F(Filter, MeasuresAClosedMeshOfEveryFormat) {
  const std::string ball = path("ball.zarr");
  ASSERT_EQ(run({"synth", "sphere", ball, "--dims", "40,40,40", "--type", "f32"}).exit_code, 0);
  const nlohmann::json info = run_json({"info", ball});
  const auto& range = info["value_range"];
  const double middle = (range[0].get<double>() + range[1].get<double>()) / 2;
  nlohmann::json first;
  for (const char* name : {"m.ply", "m.stl", "m.obj", "m.glb", "m.vtp", "m.pvtp"}) {
    const nlohmann::json surface = extract(ball, std::to_string(middle), name, {"--measure"});
    if (first.is_null()) first = surface["measure"];
    EXPECT_EQ(surface["measure"], first) << name;
  }
  EXPECT_EQ(first["closed"], true);
  EXPECT_EQ(first["components"], 1);
  EXPECT_EQ(first["euler_number"], 2);
  EXPECT_NE(first["volume"].get<double>(), 0);
}

TEST_F(Filter, KeepsLargeComponents) {
  const nlohmann::json all = of_noise("all.ply", {"--measure"});
  const nlohmann::json some = of_noise("some.ply", {"--min-component", "12", "--measure"});
  EXPECT_EQ(some["extracted"]["triangles"], all["triangles"]);
  EXPECT_EQ(some["extracted"]["vertices"], all["vertices"]);
  EXPECT_LT(some["triangles"].get<int>(), all["triangles"].get<int>());
  EXPECT_LT(some["measure"]["components"].get<int>(), all["measure"]["components"].get<int>());
  EXPECT_GT(some["measure"]["components"].get<int>(), 0);
  const std::string mesh = read_file(path("some.ply"));
  EXPECT_NE(mesh.find("element face " + some["triangles"].dump()), std::string::npos);
  EXPECT_NE(mesh.find("element vertex " + some["vertices"].dump()), std::string::npos);
  const nlohmann::json three = of_noise("three.ply", {"--largest", "3", "--measure"});
  EXPECT_EQ(three["measure"]["components"], 3);
}

TEST_F(Filter, WritesStlOfTheSameTriangles) {
  const nlohmann::json plain = of_noise("plain.stl", {});
  const nlohmann::json kept = of_noise("kept.stl", {"--min-component", "1", "--measure"});
  EXPECT_EQ(read_file(path("kept.stl")), read_file(path("plain.stl")));
  EXPECT_TRUE(kept["vertices"].is_null());
  const nlohmann::json three = of_noise("three.stl", {"--largest", "3"});
  EXPECT_EQ(read_file(path("three.stl")).size(), 84 + 50 * three["triangles"].get<std::size_t>());
}

TEST_F(Filter, SmoothsAndKeepsTheCounts) {
  const nlohmann::json plain = extract(store_, "127.5", "plain.ply", {"--measure"});
  const nlohmann::json smooth =
      extract(store_, "127.5", "smooth.ply", {"--smooth", "10", "--measure"});
  EXPECT_EQ(smooth["triangles"], plain["triangles"]);
  EXPECT_EQ(smooth["vertices"], plain["vertices"]);
  EXPECT_EQ(smooth["measure"]["euler_number"], plain["measure"]["euler_number"]);
  EXPECT_NE(read_file(path("smooth.ply")), read_file(path("plain.ply")));
  extract(store_, "127.5", "wide.ply", {"--smooth", "10", "--pass-band", "0.5"});
  EXPECT_NE(read_file(path("wide.ply")), read_file(path("smooth.ply")));
}

TEST_F(Filter, DependsOnNeitherThreadsNorMemoryNorBricks) {
  const Arguments filters{"--largest", "20", "--smooth", "3"};
  of_noise("a.ply", filters);
  Arguments small = filters;
  small.insert(small.end(), {"--memory", "64M", "--threads", "1"});
  of_noise("b.ply", small);
  EXPECT_EQ(read_file(path("b.ply")), read_file(path("a.ply")));
  ASSERT_EQ(run({"convert", path("noise.raw"), "--dims", "24,24,24", "--type", "u8", path("n.zarr"),
                 "--spacing", "0.5,0.5,0.5", "--unit", "mm", "--brick", "16"})
                .exit_code,
            0);
  extract(path("n.zarr"), "250.5", "c.ply", filters);
  EXPECT_EQ(read_file(path("c.ply")), read_file(path("a.ply")));
}

TEST_F(Filter, TakesSeveralIsovaluesAndStandardOutput) {
  Arguments words{"extract",     store_,      "--isovalue", "100,127.5", "-o",
                  path("m.ply"), "--largest", "1",          "--measure"};
  const nlohmann::json both = run_json(words);
  ASSERT_EQ(both["surfaces"].size(), 2u);
  for (const nlohmann::json& surface : both["surfaces"])
    EXPECT_EQ(surface["measure"]["components"], 1);
  const Outcome streamed =
      run({"extract", store_, "--isovalue", "127.5", "-o", "-", "--largest", "1"});
  EXPECT_EQ(streamed.out, read_file(path("m_127.5.ply")));
}

TEST_F(Filter, SaysThatNoComponentIsLeft) {
  const Outcome outcome = run({"extract", store_, "--isovalue", "127.5", "-o", path("e.ply"),
                               "--min-component", "1M", "--measure"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_NE(outcome.err.find("no component is large enough for --min-component"), std::string::npos)
      << outcome.err;
  EXPECT_NE(read_file(path("e.ply")).find("element vertex 0"), std::string::npos);
}

TEST_F(Filter, Simplifies) {
  const nlohmann::json whole = extract(store_, "127.5", "whole.ply", {});
  const auto all = whole["triangles"].get<double>();
  for (const char* goal : {"0.25", "25%"}) {
    const nlohmann::json part = extract(store_, "127.5", "part.ply", {"--simplify", goal});
    EXPECT_NEAR(part["triangles"].get<double>(), all / 4, 2) << goal;
  }
  const nlohmann::json count = extract(store_, "127.5", "count.ply", {"--simplify", "3k"});
  EXPECT_NEAR(count["triangles"].get<double>(), 3000, 2);
  EXPECT_LT(extract(store_, "127.5", "near.stl", {"--max-error", "0.2"})["triangles"].get<double>(),
            all);
  EXPECT_EQ(extract(store_, "127.5", "fraction.ply", {"--simplify", "2.5k"})["simplify_goal"],
            2500);
  const Outcome missed = run({"extract", path("noise.zarr"), "--isovalue", "250.5", "-o",
                              path("few.ply"), "--simplify", "4"});
  EXPECT_EQ(missed.exit_code, 0);
  EXPECT_NE(missed.err.find("triangles are left instead of 4: components"), std::string::npos)
      << missed.err;
  extract(store_, "127.5", "one.ply", {"--simplify", "1"});
  EXPECT_EQ(read_file(path("one.ply")), read_file(path("whole.ply")));
  for (const char* wrong : {"0", "1.5", "-0.1", "120%", "nan", "0.0"})
    expect_refused(refused({"--simplify", wrong}), 2, {wrong});
  for (const char* wrong : {"0", "-1", "nan", "inf"})
    expect_refused(refused({"--max-error", wrong}), 2, {wrong});
}

TEST_F(Filter, DrawsTheFilteredSurface) {
  const Arguments words{"extract", path("noise.zarr"), "--isovalue", "250.5", "--size", "64x64"};
  const auto draw = [&](const std::string& name, const Arguments& more) {
    Arguments all = words;
    all.insert(all.end(), {"--preview", path(name)});
    all.insert(all.end(), more.begin(), more.end());
    return run(all);
  };
  if (const Outcome plain = draw("plain.png", {}); plain.exit_code != 0) GTEST_SKIP() << plain.err;
  const Outcome largest = draw("largest.png", {"--largest", "1", "--measure", "--json"});
  ASSERT_EQ(largest.exit_code, 0) << largest.err;
  EXPECT_NE(read_file(path("largest.png")), read_file(path("plain.png")));
  EXPECT_EQ(nlohmann::json::parse(largest.out)["surfaces"][0]["measure"]["components"], 1);
  // Beside a mesh the same picture.
  ASSERT_EQ(draw("beside.png", {"-o", path("beside.ply"), "--largest", "1"}).exit_code, 0);
  EXPECT_EQ(read_file(path("beside.png")), read_file(path("largest.png")));
}

TEST_F(Filter, ChangesTheUnit) {
  const nlohmann::json plain = of_noise("plain.stl", {"--measure"})["measure"],
                       scaled =
                           of_noise("scaled.stl", {"--measure", "--mesh-unit", "um"})["measure"];
  EXPECT_EQ(plain["unit"], "millimeter");
  EXPECT_EQ(scaled["unit"], "micrometer");
  EXPECT_NEAR(scaled["area"].get<double>(), 1e6 * plain["area"].get<double>(),
              1 * plain["area"].get<double>());
  // GLB is in metres, whatever the unit of the mesh.
  of_noise("scaled.glb", {"--mesh-unit", "cm"});
  EXPECT_NE(read_file(path("scaled.glb")).find("\"scale\":[0.01,"), std::string::npos);
  expect_refused(refused({"--mesh-unit", "mm"}), 2, {"--mesh-unit", "--unit"});
  expect_refused(refused({"--mesh-unit", "furlong"}), 2, {"--mesh-unit", "furlong"});
}

TEST_F(Filter, IsSetByThePresetForPrinting) {
  const std::string store = path("noise.zarr");
  const Arguments words{"extract", store, "--isovalue", "250.5", "--preset", "print", "--measure"};
  Arguments named = words;
  named.insert(named.end(), {"-o", path("print.stl")});
  const nlohmann::json surface = run_json(named)["surfaces"][0];
  EXPECT_EQ(surface["measure"]["closed"], true);
  EXPECT_EQ(surface["measure"]["components"], 1);
  EXPECT_EQ(surface["measure"]["unit"], "millimeter");
  EXPECT_EQ(surface["simplify_goal"], 500000);
  const Arguments same{"--cap",      "--largest", "1",           "--smooth", "10",
                       "--simplify", "500k",      "--mesh-unit", "mm"};
  extract(store, "250.5", "options.stl", same);
  EXPECT_EQ(read_file(path("options.stl")), read_file(path("print.stl")));
  // What is given stays.
  Arguments fewer = named;
  fewer.insert(fewer.end(), {"--simplify", "50%", "--force", "--mesh-unit", "m"});
  const nlohmann::json half = run_json(fewer)["surfaces"][0];
  EXPECT_EQ(half["measure"]["unit"], "meter");
  EXPECT_LT(half["triangles"], surface["triangles"]);
  // Without a name it is an STL all the same; without a unit there is a note.
  const Outcome streamed =
      run({"extract", store_, "--isovalue", "127.5", "--preset", "print", "-o", "-"});
  EXPECT_EQ(streamed.exit_code, 0);
  EXPECT_NE(streamed.err.find("as if it were millimetres"), std::string::npos) << streamed.err;
  std::uint32_t triangles = 0;
  ASSERT_GT(streamed.out.size(), 84U);
  std::memcpy(&triangles, streamed.out.data() + 80, 4);
  EXPECT_EQ(streamed.out.size(), 84 + 50 * std::size_t{triangles});
  expect_refused(refused({"--preset", "print", "--mesh-unit", "mm"}), 2, {"--mesh-unit", "--unit"});
  expect_refused(refused({"--preset", "paper"}), 2, {"--preset", "paper", "print"});
}

TEST_F(Filter, RefusesWhatMakesNoSense) {
  expect_refused(refused({"--largest", "0"}), 2, {"--largest: '0' is no count"});
  expect_refused(refused({"--largest", "-3"}), 2, {"--largest: '-3' is no count"});
  expect_refused(refused({"--min-component", "0"}), 2, {"--min-component: '0' is no count"});
  expect_refused(refused({"--min-component", "-1"}), 2, {"--min-component"});
  expect_refused(refused({"--min-component", "5", "--largest", "2"}), 2,
                 {"--min-component and --largest", "give one"});
  expect_refused(refused({"--smooth", "0"}), 2, {"--smooth", "'0'", "1 to 10000"});
  expect_refused(refused({"--smooth", "-4"}), 2, {"--smooth", "'-4'"});
  expect_refused(refused({"--smooth", "2.5"}), 2, {"--smooth", "'2.5'"});
  expect_refused(refused({"--smooth", "5", "--pass-band", "1.5"}), 2, {"pass band", "0.8", "1.5"});
  expect_refused(refused({"--pass-band", "0.2"}), 2, {"--pass-band", "add --smooth"});
  expect_refused(refused({"--measure", "--estimate"}), 2, {"--measure", "--estimate"});
}

TEST_F(Filter, IsIgnoredByEstimates) {
  const Outcome outcome =
      run({"extract", store_, "--isovalue", "127.5", "--estimate", "--largest", "1"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_NE(outcome.err.find("before it is filtered"), std::string::npos) << outcome.err;
}

}  // namespace
}  // namespace isobrick::test
