#include <regex>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

/// What small volumes need, and that the advice after a refusal is enough.
class SmallBudget : public ProgramTest {
 protected:
  SmallBudget() {
    write_file(path("tiny.raw"), noise(34 * 1 * 3));
    write_file(path("small.raw"), noise(128 * 128 * 96));
  }

  Arguments convert(const std::string& name, const std::string& dims) const {
    return {"convert", path(name + ".raw"), path(name + ".zarr"), "--dims", dims, "--type", "u8",
            "--force"};
  }

  /// The least budget that a refusal names; running with it then succeeds within it.
  long least(Arguments arguments) const {
    arguments.insert(arguments.end(), {"--threads", "3", "--json", "--memory"});
    arguments.push_back("1M");
    const Outcome refused = run(arguments);
    EXPECT_EQ(refused.exit_code, 2) << refused.err;
    EXPECT_NE(refused.err.find("for the program and its libraries"), std::string::npos)
        << refused.err;
    std::smatch found;
    if (!std::regex_search(refused.err, found, std::regex("--memory ([0-9]+)M"))) {
      ADD_FAILURE() << refused.err;
      return 0;
    }
    arguments.back() = found.str(1) + "M";
    const Outcome done = run(arguments);
    EXPECT_EQ(done.exit_code, 0) << done.err;
    const auto said = nlohmann::json::parse(done.out, nullptr, false);
    const long mib = std::stol(found.str(1));
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    if (said.is_object() && said.contains("peak_resident_bytes")) {
      EXPECT_LE(said["peak_resident_bytes"].get<long>(), mib << 20) << arguments[0];
    }
#endif
    return mib;
  }
};

TEST_F(SmallBudget, IsEnoughForSmallVolumes) {
  for (const auto& [name, dims] : {std::pair("tiny", "34,1,3"), std::pair("small", "128,128,96")}) {
    EXPECT_LE(least(convert(name, dims)), 32);
    const std::string store = path(name) + ".zarr";
    EXPECT_LE(least({"extract", store, "--isovalue", "100", "-o", path("m.ply"), "--force"}), 48);
    EXPECT_LE(least({"index", store, "--kind", "octree", "--force"}), 32);
    EXPECT_LE(least({"index", store, "--kind", "kdtree", "--leaf", "1", "--force"}), 64);
    EXPECT_LE(least({"export", store, path("e.nrrd"), "--force"}), 32);
  }
}

/// An image of another program, whose chunks hold three channels: what decoding them takes is in
/// the advice.
TEST_F(SmallBudget, TheAdviceIsEnoughForAnImageOfOthers) {
  const std::string image = path("image.zarr");
  std::filesystem::create_directories(image + "/c/0/0/0");
  write_file(image + "/zarr.json",
             R"({"zarr_format":3,"node_type":"array","shape":[3,32,32,32],"data_type":"uint8",
                 "chunk_grid":{"name":"regular","configuration":{"chunk_shape":[3,32,32,32]}},
                 "chunk_key_encoding":{"name":"default"},"fill_value":0,
                 "codecs":[{"name":"bytes"}]})");
  write_file(image + "/c/0/0/0/0", noise(3 * 32 * 32 * 32));
  EXPECT_LE(least({"index", image, "--kind", "octree", "--channel", "1"}), 32);
}

}  // namespace
}  // namespace isobrick::test
