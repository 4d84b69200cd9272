#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

class InsideOption : public ProgramTest {
 protected:
  const std::string store_ = make_store("a");

  std::string extracted(const std::string& name, const Arguments& more) {
    Arguments all{"extract", store_, "--isovalue", "128", "-o", path(name)};
    all.insert(all.end(), more.begin(), more.end());
    const Outcome outcome = run(all);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return read_file(path(name));
  }
};

TEST_F(InsideOption, TurnsTrianglesRoundAndNothingElse) {
  const std::string above = extracted("a.obj", {"--normals", "none"}),
                    with_option = extracted("b.obj", {"--inside", "above", "--normals", "none"}),
                    below = extracted("c.obj", {"--inside", "below", "--normals", "none"});
  EXPECT_TRUE(above == with_option);
  EXPECT_FALSE(above == below);
  const std::size_t faces = above.find("\nf ");
  ASSERT_NE(faces, std::string::npos);
  EXPECT_TRUE(above.substr(0, faces) == below.substr(0, faces));
  EXPECT_EQ(above.size(), below.size());
}

TEST_F(InsideOption, IsRefusedWhereItMeansNothing) {
  expect_refused(run({"extract", store_, "--isovalue", "1", "-o", path("x.ply"), "--inside", "in"}),
                 2, {"'in'", "above or below"});
  expect_refused(run({"export", store_, path("x.vdb"), "--inside", "below"}), 2, {"--isovalue"});
}

TEST_F(InsideOption, ALevelSetsBandIsSaid) {
  const Outcome made = run({"export", store_, path("s.vdb"), "--isovalue", "128"});
  if (made.exit_code != 0) GTEST_SKIP() << made.err;
  ASSERT_EQ(run({"convert", path("s.vdb"), path("s.zarr")}).exit_code, 0);
  const auto note = [&](const char* isovalue) {
    const Outcome outcome =
        run({"extract", path("s.zarr"), "--isovalue", isovalue, "-o", path("s.ply"), "--force"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome.err;
  };
  EXPECT_EQ(note("0").find("narrow band"), std::string::npos);
  EXPECT_EQ(note("-2.9").find("narrow band"), std::string::npos);
  for (const char* outside : {"3", "-3", "200"})
    EXPECT_NE(note(outside).find("isovalue " + std::string(outside) +
                                 " lies outside of the narrow band of this level set"),
              std::string::npos)
        << outside;
}

/// The volume that the triangles of a text mesh enclose, by the divergence theorem.
double volume_of(const std::string& obj) {
  std::vector<std::array<double, 3>> points;
  double six_volumes = 0;
  std::istringstream lines(obj);
  for (std::string word, line; std::getline(lines, line);) {
    std::istringstream words(line);
    words >> word;
    if (word == "v") {
      auto& p = points.emplace_back();
      words >> p[0] >> p[1] >> p[2];
    } else if (word == "f") {
      std::array<std::array<double, 3>, 3> t;
      for (auto& corner : t) {
        words >> word;
        corner = points.at(std::stoul(word) - 1);
      }
      for (std::size_t i = 0; i < 3; ++i)
        six_volumes += t[0][i] * (t[1][(i + 1) % 3] * t[2][(i + 2) % 3] -
                                  t[1][(i + 2) % 3] * t[2][(i + 1) % 3]);
    }
  }
  return six_volumes / 6;
}

/// A ball's level set is no less one for having been another file in between.
TEST_F(InsideOption, ALevelSetStaysOneThroughEveryExport) {
  constexpr double kRadius = 10, kVolume = 4.0 / 3 * 3.14159265358979 * 1000;
  std::string samples;
  for (int z = -12; z <= 12; ++z)
    for (int y = -12; y <= 12; ++y)
      for (int x = -12; x <= 12; ++x) {
        const auto distance = static_cast<float>(
            std::clamp(std::sqrt(double(x * x + y * y + z * z)) - kRadius, -3.0, 3.0));
        samples.append(reinterpret_cast<const char*>(&distance), sizeof distance);
      }
  write_file(path("ball.nrrd"),
             "NRRD0004\ntype: float\ndimension: 3\nsizes: 25 25 25\nencoding: raw\n"
             "endian: little\nisobrick grid class:=level set\n"
             "isobrick grid name:=a \\\\ name\nisobrick fill value:=3\n\n" +
                 samples);
  ASSERT_EQ(run({"convert", path("ball.nrrd"), path("ball.zarr"), "--brick", "16"}).exit_code, 0);
  std::string store = path("ball.zarr");
  for (const char* file : {"v.nrrd", "v.raw", "v.vdb", "w.raw"}) {
    SCOPED_TRACE(file);
    const nlohmann::json info = run_json({"info", store});
    EXPECT_EQ(info["grid_class"], "level set");
    EXPECT_EQ(info["grid_name"], "a \\ name");
    EXPECT_EQ(info["fill_value"], 3);
    ASSERT_EQ(run({"extract", store, "--isovalue", "0", "-o", path("v.obj"), "--force"}).exit_code,
              0);
    EXPECT_NEAR(volume_of(read_file(path("v.obj"))), kVolume, 0.02 * kVolume);
    const Outcome exported = run({"export", store, path(file)});
    if (std::string(file) == "v.vdb" && exported.exit_code != 0) continue;  // built without
    ASSERT_EQ(exported.exit_code, 0) << exported.err;
    store = path(std::string(file) + ".zarr");
    const Outcome converted = run({"convert", path(file), store, "--brick", "16"});
    ASSERT_EQ(converted.exit_code, 0) << converted.err;
  }
  const nlohmann::json info = run_json({"info", store});
  EXPECT_EQ(info["grid_class"], "level set");
  ASSERT_EQ(run({"extract", store, "--isovalue", "0", "-o", path("v.obj"), "--force"}).exit_code,
            0);
  EXPECT_NEAR(volume_of(read_file(path("v.obj"))), kVolume, 0.02 * kVolume);
}

}  // namespace
}  // namespace isobrick::test
