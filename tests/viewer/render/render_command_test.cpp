#include "tests/tools/program.h"
#include "viewer/render/gl_context.h"

namespace isobrick::test {
namespace {

class RenderCommand : public ProgramTest {
 protected:
  void SetUp() override {
    if (!GlContext::available()) GTEST_SKIP() << "no OpenGL 4.5 without a window here";
  }

  std::string triangle(const std::string& name, const std::string& unit) {
    write_file(path(name), (unit.empty() ? "" : "# unit " + unit + "\n") +
                               "v 0 0 0\nv 2 0 0\nv 0 2 0\nf 1 2 3\n");
    return path(name);
  }
  Arguments render(Arguments arguments) const {
    arguments.insert(arguments.begin(), "render");
    arguments.insert(arguments.end(), {"-o", path("a.png"), "--size", "64x64", "--force"});
    return arguments;
  }
};

TEST_F(RenderCommand, TheScaleBarHasTheUnitOfTheMesh) {
  const std::string um = triangle("um.obj", "um"), none = triangle("none.obj", "");
  EXPECT_EQ(run_json(render({um, "--scale-bar"}))["unit"], "micrometer");
  // A mesh after an option that lacks its value is not taken for a unit.
  EXPECT_EQ(run_json(render({"--scale-bar", um}))["unit"], "micrometer");
  for (const char* unit : {"auto", "km", "micrometer", "µm", "inches"})
    EXPECT_EQ(run(render({"--scale-bar", unit, um})).exit_code, 0) << unit;
  EXPECT_EQ(run_json(render({none, "--scale-bar"}))["unit"], "");
}

TEST_F(RenderCommand, AScaleBarInAnUnknownUnitIsRefused) {
  const std::string um = triangle("um.obj", "um"), none = triangle("none.obj", "");
  for (const Arguments& banana :
       {Arguments{um, "--scale-bar", "banana"}, Arguments{"--scale-bar", "banana", um},
        Arguments{um, "--scale-bar=banana"}})
    expect_refused(run(render(banana)), 2,
                   {"--scale-bar: 'banana' is no unit of length", "millimeter, micrometer"});
  expect_refused(run(render({none, "--scale-bar", "mm"})), 2,
                 {"none.obj' has no unit", "cannot be in millimeter"});
}

TEST_F(RenderCommand, AColourGoesBeforeThoseOfTheVertices) {
  write_file(path("a.obj"), "v 0 0 0 0 1 0\nv 2 0 0 0 1 0\nv 0 2 0 0 1 0\nf 1 2 3\n");
  const auto drawn = [&](const Arguments& options) {
    Arguments arguments{path("a.obj")};
    arguments.insert(arguments.end(), options.begin(), options.end());
    run_json(render(arguments));
    return read_file(path("a.png"));
  };
  EXPECT_NE(drawn({}), drawn({"--colour", "#dec9b0"}));
  EXPECT_NE(drawn({"--colour", "#dec9b0"}), drawn({"--colour", "#00ff00"}));
}

TEST_F(RenderCommand, TheUnitComesFromTheStore) {
  write_file(path("a_8x8x8_uint8.raw"), noise(512));
  const std::string store = path("a.zarr");
  ASSERT_EQ(run({"convert", path("a_8x8x8_uint8.raw"), store, "--unit", "mm"}).exit_code, 0);
  for (const char* name : {"a.ply", "a.obj", "a.glb"}) {
    run_json({"extract", store, "--isovalue", "127.5", "-o", path(name)});
    const nlohmann::json drawn = run_json(render({path(name), "--scale-bar", "um"}));
    EXPECT_EQ(drawn["unit"], "millimeter") << name;
    EXPECT_NEAR(drawn["bounds"][1][0].get<double>(), 7, 1e-5) << name;
  }
  run_json({"extract", store, "--isovalue", "127.5", "-o", path("a.stl")});
  EXPECT_EQ(run_json(render({path("a.stl"), "--scale-bar"}))["unit"], "");
}

}  // namespace
}  // namespace isobrick::test
