#include <cmath>
#include <cstring>
#include <numbers>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

/// `extract --cap`, measured.
class Cap : public ProgramTest {
 protected:
  /// A store of samples f(x, y, z) of 40 x 36 x 33.
  template <class F>
  std::string store_of(const std::string& name, F&& f, const std::string& brick = "16") {
    std::string bytes;
    for (int z = 0; z < 33; ++z)
      for (int y = 0; y < 36; ++y)
        for (int x = 0; x < 40; ++x) {
          const auto value = static_cast<float>(f(x, y, z));
          bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
        }
    write_file(path(name + ".raw"), bytes);
    const Outcome converted = run({"convert", path(name + ".raw"), path(name + ".zarr"), "--dims",
                                   "40,36,33", "--type", "f32", "--brick", brick});
    EXPECT_EQ(converted.exit_code, 0) << converted.err;
    return path(name + ".zarr");
  }
  nlohmann::json capped(const std::string& store, const std::string& isovalue,
                        const Arguments& more = {}) const {
    Arguments words{"extract",          store,     "--isovalue", isovalue,   "-o",
                    path("capped.ply"), "--force", "--cap",      "--measure"};
    words.insert(words.end(), more.begin(), more.end());
    return run_json(words)["surfaces"][0]["measure"];
  }

  static double ball(int x, int y, int z) { return 20 - std::hypot(x - 10, y - 18, z - 16); }
};

TEST_F(Cap, ClosesWhatTheBorderCuts) {
  const std::string store = store_of("ball", ball);
  const nlohmann::json inside = capped(store, "2.5"),
                       outside = capped(store, "2.5", {"--inside", "below"});
  EXPECT_EQ(inside["closed"], true);
  EXPECT_EQ(outside["closed"], true);
  EXPECT_NEAR(inside["volume"].get<double>() + outside["volume"].get<double>(), 39.0 * 35 * 32,
              0.01);
  // A ball of radius 17.5 of which the border takes two caps: x < 0, and a thin one at either z.
  const double radius = 17.5, pi = std::numbers::pi;
  const auto cut = [&](double height) { return pi * height * height * (radius - height / 3); };
  const double expected =
      4.0 / 3 * pi * std::pow(radius, 3) - cut(radius - 10) - 2 * cut(radius - 16);
  EXPECT_NEAR(inside["volume"].get<double>(), expected, 0.01 * expected);
  Arguments plain{"extract", store, "--isovalue", "2.5", "-o", path("open.ply"), "--measure"};
  EXPECT_EQ(run_json(plain)["surfaces"][0]["measure"]["closed"], false);
}

TEST_F(Cap, NothingElseShows) {
  const std::string store = store_of("ball", ball);
  capped(store, "2.5");
  const std::string expected = read_file(path("capped.ply"));
  for (const Arguments& more :
       {Arguments{"--threads", "1"}, {"--threads", "3", "--memory", "64M"}}) {
    capped(store, "2.5", more);
    EXPECT_TRUE(read_file(path("capped.ply")) == expected) << more[1];
  }
  ASSERT_EQ(run({"index", store, "--kind", "octree"}).exit_code, 0);
  capped(store, "2.5", {"--search", "octree"});
  EXPECT_TRUE(read_file(path("capped.ply")) == expected);
  capped(store_of("other", ball, "32"), "2.5");
  EXPECT_TRUE(read_file(path("capped.ply")) == expected);
}

TEST_F(Cap, TheWholeBoxWhereAllIsInside) {
  const std::string store = store_of("ball", ball);
  const nlohmann::json all = capped(store, "-1000");
  EXPECT_NEAR(all["volume"].get<double>(), 39.0 * 35 * 32, 0.01);
  EXPECT_EQ(all["euler_number"], 2);
  const nlohmann::json part = capped(store, "-1000", {"--roi", "3:20,5:9,7:33"});
  EXPECT_NEAR(part["volume"].get<double>(), 16.0 * 3 * 25, 0.01);
  EXPECT_EQ(part["components"], 1);
}

TEST_F(Cap, MissingSamplesAndConstantBricks) {
  // A hole of NaN far from the surface, in a brick that is inside as a whole, and absent bricks.
  const std::string store = store_of("hole", [](int x, int y, int z) {
    if (std::abs(x - 8) < 2 && std::abs(y - 8) < 2 && std::abs(z - 8) < 2) return std::nan("");
    return x < 30 ? 1.0 : 0.0;
  });
  const nlohmann::json measure = capped(store, "0.5");
  EXPECT_EQ(measure["closed"], true);
  EXPECT_EQ(measure["components"], 2);
  // Cells with a corner in the hole: 4 x 4 x 4.
  EXPECT_NEAR(measure["volume"].get<double>(), 29.5 * 35 * 32 - 64, 0.01);
  for (const char* topology : {"consistent", "trilinear"})
    EXPECT_EQ(capped(store, "0.5", {"--topology", topology})["closed"], true);
}

TEST_F(Cap, WithoutDegenerateTriangles) {
  // Every sample of the plane equals the isovalue, at the border too.
  const std::string store = store_of("steps", [](int, int, int z) { return z / 4; });
  const nlohmann::json kept = capped(store, "3", {"--drop-degenerate"});
  EXPECT_EQ(kept["closed"], true);
  EXPECT_EQ(kept["euler_number"], 2);
  EXPECT_NEAR(kept["volume"].get<double>(), 39.0 * 35 * (32 - 12), 0.01);
  const std::string mesh = read_file(path("capped.ply"));
  capped(store, "3", {"--drop-degenerate", "--threads", "1"});
  EXPECT_TRUE(read_file(path("capped.ply")) == mesh);
}

TEST_F(Cap, IsEstimated) {
  const Outcome estimate = run({"extract", store_of("ball", ball), "--isovalue", "2.5", "--cap",
                                "-o", path("never.ply"), "--estimate"});
  EXPECT_EQ(estimate.exit_code, 0) << estimate.err;
}

}  // namespace
}  // namespace isobrick::test
