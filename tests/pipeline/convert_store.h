#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include <isobrick/convert.h>
#include <isobrick/store_reader.h>
#include "pipeline/slab_reader.h"
#include "tests/pipeline/convert_doubles.h"
#include "tests/temporary_folder.h"

namespace isobrick::test {

inline std::string content_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Every file below `root` with its bytes.
inline std::map<std::string, std::string> tree_of(const std::filesystem::path& root) {
  std::map<std::string, std::string> tree;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(root))
    if (entry.is_regular_file())
      tree[std::filesystem::relative(entry.path(), root).string()] = content_of(entry.path());
  return tree;
}

/// All samples of a level.
inline std::vector<std::byte> samples_of(const StoreReader& store, int level) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  std::vector<std::byte> samples(bytes_of(lattice.extent, lattice.type));
  read_slab(store, level, lattice.box(), samples.data());
  return samples;
}

/// Expects the same samples, ranges and places in the world on all levels.
inline void expect_same_levels(const StoreReader& a, const StoreReader& b) {
  ASSERT_EQ(a.info().levels.size(), b.info().levels.size());
  for (std::size_t i = 0; i < a.info().levels.size(); ++i) {
    const int level = static_cast<int>(i);
    EXPECT_EQ(samples_of(a, level), samples_of(b, level));
    EXPECT_EQ(a.info().levels[i].transform, b.info().levels[i].transform);
    const Box3 bricks{{0, 0, 0}, a.info().levels[i].lattice.bricks()};
    EXPECT_EQ(a.brick_ranges(level, bricks).ranges, b.brick_ranges(level, bricks).ranges);
  }
}

template <class T>
MemorySource make_source(Int3 extent, unsigned seed, bool odd = false, bool random_access = true) {
  return {extent, scalar_type_of<T>, as_bytes(make_samples<T>(extent, seed, odd)), random_access};
}

inline ConvertReport convert_quietly(VolumeSource& source, const std::filesystem::path& out,
                                     const ConvertOptions& options) {
  NoProgress progress;
  return convert(source, out, options, progress);
}

}  // namespace isobrick::test
