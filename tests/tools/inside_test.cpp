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
                    said = extracted("b.obj", {"--inside", "above", "--normals", "none"}),
                    below = extracted("c.obj", {"--inside", "below", "--normals", "none"});
  EXPECT_TRUE(above == said);
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

}  // namespace
}  // namespace isobrick::test
