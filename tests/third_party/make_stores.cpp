// Writes stores of many kinds and, beside them, what their arrays hold, for
// readers of others to compare. Prints a line "STORE ARRAY=RAW …" for each.

#include <cstdio>

#include "bricks/ranges/range_format.h"
#include "tests/bricks/store_fixture.h"

namespace isobrick::test {
namespace {

void write_raw(const std::filesystem::path& path, const std::vector<std::byte>& bytes) {
  write_file(path, std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

// A canonical NaN, as fill values and ours are: other readers may not keep payloads.
void make_store(const std::filesystem::path& folder, const std::string& name,
                const std::vector<Level>& levels, Compression compression, double fill) {
  const std::filesystem::path store = folder / (name + ".zarr");
  write_store(store, levels, compression, fill);
  std::string line = store.string();
  const auto stored_ranges = [&](const Level& level, Int3 edge) {
    std::vector<std::byte> room;
    const std::vector<std::byte> pairs = make_ranges(level, edge);
    const auto stored = stored_pairs(level.lattice.type, pairs, room);
    return std::vector<std::byte>(stored.begin(), stored.end());
  };
  const auto add = [&](const std::string& array, const std::vector<std::byte>& bytes) {
    const std::filesystem::path raw = folder / (name + "." + std::to_string(line.size()) + ".raw");
    write_raw(raw, bytes);
    line += " " + array + "=" + raw.string();
  };
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const std::string number = std::to_string(i);
    add(number, levels[i].samples);
    add("isobrick/" + number + "/range", stored_ranges(levels[i], levels[i].lattice.brick));
    add("isobrick/" + number + "/block_range",
        stored_ranges(levels[i], {kBlockEdge, kBlockEdge, kBlockEdge}));
  }
  std::printf("%s\n", line.c_str());
}

void make_stores(const std::filesystem::path& folder) {
  for (const ScalarType type : kScalarTypes)
    for (const bool zstd : {false, true})
      make_store(folder, std::string(short_name(type)) + (zstd ? "_zstd" : "_none"),
                 {make_level(type, {37, 41, 53}, 16, 32, 3, true)},
                 zstd ? std::optional(3) : std::nullopt, 3);
  make_store(folder, "one_sample", {make_level(ScalarType::f32, {1, 1, 1}, 16, 16, 0, false)}, 3,
             0);
  make_store(folder, "nan_fill",
             {make_level(ScalarType::f64, {61, 7, 5}, 16, 16,
                         std::numeric_limits<double>::quiet_NaN(), true)},
             3, std::numeric_limits<double>::quiet_NaN());
  make_store(folder, "levels",
             {make_level(ScalarType::u16, {127, 131, 137}, 64, 128, 0, true),
              make_level(ScalarType::u16, {64, 66, 69}, 32, 64, 0, true)},
             3, 0);
  make_store(folder, "all_absent",
             {make_level(ScalarType::i8, {1, 1, 1}, 16, 16, -1, false),
              [] {
                Level level = make_level(ScalarType::i8, {20, 20, 20}, 16, 16, -1, false);
                std::fill(level.samples.begin(), level.samples.end(), std::byte{0xff});
                return level;
              }()},
             3, -1);
}

}  // namespace
}  // namespace isobrick::test

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  isobrick::test::make_stores(argv[1]);
}
