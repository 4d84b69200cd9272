#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace {

namespace fs = std::filesystem;

/// What a folder may include besides itself: the table of docs/design/architecture.md.
/// A row names folders, or single headers where only those are allowed.
const std::map<std::string, std::set<std::string>> kMayInclude = {
    {"core", {}},
    {"io", {"core"}},
    {"volumes", {"core", "io"}},
    {"meshes", {"core", "io", "surface/mesh.h"}},
    {"bricks", {"core", "io"}},
    {"index", {"core"}},
    {"surface", {"core"}},
    {"stream", {"core", "bricks", "index"}},
    {"gpu", {"core", "surface", "index"}},
    {"pipeline", {"core", "io", "volumes", "bricks", "index", "surface", "stream", "gpu"}},
    {"render", {"core", "io", "meshes", "surface/mesh.h"}},
    {"viewer", {"core", "volumes", "bricks", "index", "surface", "stream", "gpu", "pipeline"}},
    {"window",
     {"core", "io", "meshes", "volumes", "bricks", "index", "stream", "gpu", "pipeline", "render",
      "viewer"}},
};

fs::path library() { return fs::path(ISOBRICK_SOURCE_DIR) / "isobrick"; }

bool is_source(const fs::path& path) {
  static const std::set<std::string> extensions{".h", ".cpp", ".cu", ".cuh", ".inc"};
  return extensions.contains(path.extension().string());
}

/// The names between quotes or brackets of a file's #include lines.
std::vector<std::string> includes_of(const fs::path& path) {
  std::vector<std::string> names;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    const auto hash = line.find_first_not_of(" \t");
    if (hash == std::string::npos || line[hash] != '#') continue;
    const auto word = line.find("include", hash);
    const auto open = line.find_first_of("\"<", hash);
    if (word == std::string::npos || open == std::string::npos || word > open) continue;
    const auto close = line.find_first_of("\">", open + 1);
    names.push_back(line.substr(open + 1, close - open - 1));
  }
  return names;
}

std::string folder_of(const std::string& name) { return name.substr(0, name.find('/')); }

bool allowed(const std::string& folder, const std::string& included) {
  const auto row = kMayInclude.find(folder);
  return row != kMayInclude.end() &&
         (folder_of(included) == folder || row->second.contains(folder_of(included)) ||
          row->second.contains(included));
}

/// Calls f(folder, path, name) for each header of ours that our library's
/// files include; `name` is below isobrick/.
template <class F>
void for_each_include(F&& f) {
  const std::string prefix = "isobrick/";
  for (const auto& entry : fs::recursive_directory_iterator(library())) {
    if (!entry.is_regular_file() || !is_source(entry.path())) continue;
    const std::string folder = folder_of(fs::relative(entry.path(), library()).string());
    for (const std::string& name : includes_of(entry.path())) {
      EXPECT_FALSE(name.starts_with("tools/") || name.starts_with("tests/"))
          << entry.path() << " includes " << name;
      if (name.starts_with(prefix)) f(folder, entry.path(), name.substr(prefix.size()));
    }
  }
}

TEST(Includes, FollowTheTable) {
  int seen = 0;
  for_each_include([&](const std::string& folder, const fs::path& path, const std::string& name) {
    ++seen;
    EXPECT_TRUE(allowed(folder, name)) << path << ": " << folder << "/ may not include " << name;
  });
  EXPECT_GT(seen, 50) << "the test reads the wrong folder";
}

TEST(Includes, NameFilesThatExist) {
  for_each_include([&](const std::string&, const fs::path& path, const std::string& name) {
    EXPECT_TRUE(fs::exists(library() / name)) << path << " includes " << name;
  });
}

TEST(Includes, OnlyTheGpuFolderKnowsCuda) {
  for (const auto& entry : fs::recursive_directory_iterator(library())) {
    if (!entry.is_regular_file() || !is_source(entry.path())) continue;
    if (folder_of(fs::relative(entry.path(), library()).string()) == "gpu") continue;
    for (const std::string& name : includes_of(entry.path()))
      EXPECT_FALSE(name.starts_with("cuda") || name.starts_with("cub/") || name.ends_with(".cuh"))
          << entry.path() << " includes " << name;
  }
}

TEST(Includes, EveryFolderStandsInTheTable) {
  for (const auto& entry : fs::directory_iterator(library()))
    if (entry.is_directory()) {
      EXPECT_TRUE(kMayInclude.contains(entry.path().filename().string())) << entry.path();
    }
}

TEST(Includes, TheTableRefusesWhatItShould) {
  EXPECT_FALSE(allowed("core", "volumes/volume_source.h"));
  EXPECT_FALSE(allowed("meshes", "surface/cpu_extractor.h"));
  EXPECT_FALSE(allowed("stream", "surface/mesh.h"));
  EXPECT_FALSE(allowed("bricks", "pipeline/convert.h"));
  EXPECT_TRUE(allowed("meshes", "surface/mesh.h"));
}

}  // namespace
