#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <numeric>
#include <random>

#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include "tests/pipeline/foreign_image.h"
#include "tests/pipeline/index_fixture.h"

namespace isobrick::test {

class IndexParts : public ::testing::Test {
 protected:
  /// A copy with the times of the files, as parts know a store by them.
  std::filesystem::path copy(const std::filesystem::path& store, const std::string& name) {
    const std::filesystem::path to = folder_ / name;
    std::filesystem::remove_all(to);
    std::filesystem::copy(store, to, std::filesystem::copy_options::recursive);
    return to;
  }
  static std::filesystem::path parts_of(const std::filesystem::path& store) {
    return store.string() + ".index.parts";
  }

  static IndexReport make_part(const std::filesystem::path& store, IndexOptions options,
                               Part part) {
    options.part = part;
    return add_index_quietly(store, options);
  }
  /// Makes all parts in some order.
  static void make_parts(const std::filesystem::path& store, const IndexOptions& options,
                         std::uint32_t parts) {
    std::vector<std::uint32_t> order(parts);
    std::iota(order.begin(), order.end(), 1u);
    std::shuffle(order.begin(), order.end(), std::mt19937(parts));
    for (const std::uint32_t number : order) make_part(store, options, {number, parts});
  }
  static IndexReport join(const std::filesystem::path& store, IndexOptions options,
                          std::uint32_t parts) {
    options.join = parts;
    return add_index_quietly(store, options);
  }
  static std::string refusal(const std::function<void()>& work) {
    try {
      work();
    } catch (const UsageError& error) {
      return std::string("usage: ") + error.what();
    } catch (const Error& error) {
      return error.what();
    }
    ADD_FAILURE() << "not refused";
    return "";
  }

  static void expect_same(const std::map<std::string, std::string>& files,
                          const std::map<std::string, std::string>& expected) {
    EXPECT_EQ(files.size(), expected.size());
    for (const auto& [name, bytes] : expected) {
      ASSERT_TRUE(files.contains(name)) << name;
      EXPECT_TRUE(files.at(name) == bytes) << name;
    }
  }
  void expect_same_store(const std::filesystem::path& store, const IndexOptions& options,
                         std::initializer_list<std::uint32_t> counts) {
    SCOPED_TRACE(std::string(name_of(options.kind)) + ", leaf " + std::to_string(options.leaf));
    const std::filesystem::path one = copy(store, "one");
    const IndexReport expected = add_index_quietly(one, options);
    const auto files = tree_of(one);
    for (const std::uint32_t parts : counts) {
      SCOPED_TRACE(std::to_string(parts) + " parts");
      const std::filesystem::path joined = copy(store, "joined");
      make_parts(joined, options, parts);
      EXPECT_TRUE(tree_of(joined) == tree_of(store));  // until it is joined
      const IndexReport report = join(joined, options, parts);
      expect_same(tree_of(joined), files);
      EXPECT_EQ(report.level_bytes, expected.level_bytes);
      EXPECT_EQ(report.chunks, expected.chunks);
      EXPECT_EQ(report.ranges_added, expected.ranges_added);
      EXPECT_FALSE(std::filesystem::exists(parts_of(joined)));
    }
  }

  std::filesystem::path convert_to(const std::string& name, const MemorySource& source,
                                   const ConvertOptions& options) {
    MemorySource of_task = source;
    convert_quietly(of_task, folder_ / name, options);
    return folder_ / name;
  }
  /// The store as if another program had written it.
  static void make_foreign(const std::filesystem::path& store) {
    const std::filesystem::path file = store / "zarr.json";
    nlohmann::json root = nlohmann::json::parse(content_of(file));
    root["attributes"].erase("isobrick");
    std::ofstream(file) << root.dump();
    std::filesystem::remove_all(store / "isobrick");
  }

  TemporaryFolder folder_;
};

}  // namespace isobrick::test
