#include <regex>

#include "tests/tools/program.h"
#include "viewer/render/gl_context.h"

namespace isobrick::test {
namespace {

/// Memory budgets hold for pictures, including OpenGL's driver.
class PictureMemory : public ProgramTest {
 protected:
  void SetUp() override {
    if (!GlContext::available()) GTEST_SKIP() << "no OpenGL 4.5 without a window here";
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers take memory of their own";
#endif
    run_json({"synth", "gyroid", store(), "--dims", "192,192,192", "--type", "u8"});
  }

  std::string store() const { return path("g.zarr"); }

  /// Runs with a budget that is too small, then within the one that the message names.
  void expect_least_holds(Arguments arguments, std::uint64_t most_mib) const {
    arguments.insert(arguments.end(), {"--force", "--memory", "64M"});
    const Outcome refused = run(arguments);
    expect_refused(refused, 2, {"is too small", "OpenGL's driver"});
    std::smatch found;
    ASSERT_TRUE(std::regex_search(refused.err, found, std::regex("--memory ([0-9]+)M")))
        << refused.err;
    arguments.back() = found.str(1) + "M";
    const std::uint64_t mib = std::stoul(found.str(1));
    EXPECT_LE(mib, most_mib) << refused.err;
    const Outcome drawn = run(arguments);
    EXPECT_EQ(drawn.exit_code, 0) << drawn.err;
    EXPECT_LE(drawn.peak_bytes, mib << 20) << refused.err;
    arguments.back() = std::to_string(mib - 1) + "M";
    EXPECT_EQ(run(arguments).exit_code, 2);
  }
};

TEST_F(PictureMemory, OfAMeshFile) {
  for (const char* name : {"m.ply", "m.stl", "m.obj"}) {
    run_json({"extract", store(), "--isovalue", "127.5", "-o", path(name)});
    expect_least_holds({"render", path(name), "-o", path("m.png"), "--size", "400x300"}, 252);
  }
  expect_least_holds({"render", path("m.ply"), "-o", path("m.png"), "--size", "400x300",
                      "--opacity", "0.5", "--box", "--axes", "--scale-bar", "--clip", "1,0,0,50"},
                     252);
}

TEST_F(PictureMemory, OfAPreview) {
  expect_least_holds({"extract", store(), "--isovalue", "127.5", "--threads", "2", "-o",
                      path("m.ply"), "--preview", path("p.png"), "--size", "400x300"},
                     252);
}

TEST_F(PictureMemory, OfPreviewsOfSeveralIsovalues) {
  expect_least_holds({"extract", store(), "--isovalue", "110", "--isovalue", "127.5", "--isovalue",
                      "140", "--threads", "2", "--preview", path("p.png"), "--size", "400x300"},
                     252);
}

TEST_F(PictureMemory, OfAView) {
  expect_least_holds({"view", store(), "--isovalue", "127.5", "--screenshot", path("v.png"),
                      "--size", "400x300", "--threads", "2"},
                     252);
}

TEST_F(PictureMemory, OfASceneOfManyValues) {
  std::string scene = R"({"asset":{"version":"2.0"},"extras":[)";
  while (scene.size() < (std::size_t{40} << 20)) scene += "[[[]]],";
  scene += "0]}";
  scene.resize((scene.size() + 3) / 4 * 4, ' ');
  const auto word = [](std::size_t value) {
    std::string bytes;
    for (int i = 0; i < 4; ++i) bytes += static_cast<char>(value >> 8 * i & 0xff);
    return bytes;
  };
  write_file(path("many.glb"),
             "glTF" + word(2) + word(20 + scene.size()) + word(scene.size()) + "JSON" + scene);
  const Outcome refused = run({"render", path("many.glb"), "-o", path("m.png")});
  expect_refused(refused, 1, {"many.glb", "has so many values"});
  EXPECT_LE(refused.peak_bytes, std::uint64_t{384} << 20);
}

}  // namespace
}  // namespace isobrick::test
