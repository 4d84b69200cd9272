#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace {

namespace fs = std::filesystem;
using Names = std::set<std::string>;

/// What a folder may include besides itself: the table of docs/design/architecture.md.
/// A row names folders, or single public headers where only those are allowed.
const std::map<std::string, Names> kMayInclude = {
    {"core", {}},
    {"io/bytes", {"core"}},
    {"io/vtk", {"core", "io/bytes"}},
    {"io/volumes", {"core", "io/bytes", "io/vtk"}},
    {"io/meshes", {"core", "io/bytes", "io/vtk", "filters", "isobrick/mesh.h"}},
    {"filters", {"core", "io/bytes", "isobrick/mesh.h", "isobrick/mesh_sinks.h"}},
    {"io/http", {"core", "io/bytes"}},
    {"packed", {"core"}},
    {"bricks", {"core", "io/bytes", "io/http", "packed"}},
    {"index", {"core"}},
    {"surface", {"core"}},
    {"stream", {"core", "bricks", "index"}},
    {"gpu", {"core", "surface", "index", "packed"}},
    {"pipeline", {"core", "io/bytes", "io/volumes", "bricks", "index", "surface", "stream", "gpu"}},
    {"ranks", {"core", "io/bytes", "io/meshes", "bricks", "surface", "pipeline"}},
    {"viewer/scene",
     {"core", "io/volumes", "bricks", "index", "surface", "stream", "gpu", "pipeline"}},
    {"viewer/render", {"core", "io/bytes", "io/meshes", "isobrick/mesh.h"}},
    {"viewer/app",
     {"core", "io/bytes", "io/meshes", "io/volumes", "bricks", "index", "stream", "gpu", "pipeline",
      "viewer/render", "viewer/scene"}},
    // What names all that a program of others begins with.
    {"isobrick", {"core", "io/meshes", "io/volumes", "filters", "bricks", "surface", "pipeline"}},
};

/// The room that each public header belongs to.
const std::map<std::string, Names> kPublicHeaders = {
    {"core",
     {"api", "downsampling", "error", "inside", "label", "label_properties", "lattice",
      "pod_buffer", "part", "progress", "range", "sample_value", "scalar", "selection", "transform",
      "vec", "version"}},
    {"io/volumes", {"array_view", "volume_request", "volume_source"}},
    {"io/volumes/open", {"open_source"}},
    {"io/volumes/synth", {"synth_source"}},
    {"io/meshes", {"mesh_file_sink"}},
    {"filters", {"mesh_filters"}},
    {"bricks", {"store_reader"}},
    {"bricks/ranges", {"range_table"}},
    {"bricks/storage", {"storage"}},
    {"bricks/zarr", {"brick_codec", "image_metadata", "level_info"}},
    {"index", {"index_kind"}},
    {"surface", {"mesh", "mesh_sinks", "surface_options", "surface_report", "topology"}},
    {"gpu/memory", {"device", "device_array"}},
    {"gpu/resident", {"device_mesh", "device_volume"}},
    {"pipeline/cache", {"open_volume"}},
    {"pipeline/histogram", {"histogram", "isovalue"}},
    {"pipeline/convert", {"convert"}},
    {"pipeline/export", {"export"}},
    {"pipeline/recode", {"recode"}},
    {"pipeline/extract", {"estimate", "extract", "index_choice"}},
    {"pipeline/index", {"index_build", "label_index"}},
    {"pipeline/labels", {"label_pieces", "labels"}},
    {"pipeline/pieces", {"pieces"}},
    {"pipeline/sample", {"attributes"}},
    {"pipeline/upload", {"upload"}},
    {"pipeline/verify", {"verify"}},
    {"pipeline/volume", {"device_extractor", "volume", "volume_extractor"}},
    {"isobrick", {"isobrick"}},
};

const fs::path kRoot = ISOBRICK_SOURCE_DIR;

bool is_source(const fs::path& path) {
  static const Names extensions{".h", ".cpp", ".cu", ".cuh", ".inc"};
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

bool is_public(const std::string& name) { return name.starts_with("isobrick/"); }

/// The row of the table that a room belongs to, or "".
std::string folder_of(const std::string& room) {
  for (const auto& [folder, allowed] : kMayInclude)
    if (room == folder || room.starts_with(folder + "/")) return folder;
  return "";
}

/// The room of a header as it is included; "" for one that is not ours.
std::string room_of(const std::string& name) {
  if (!is_public(name)) {
    const std::string room = fs::path(name).parent_path().string();
    return folder_of(room).empty() ? "" : room;
  }
  const std::string stem = fs::path(name).stem().string();
  for (const auto& [room, headers] : kPublicHeaders)
    if (headers.contains(stem)) return room;
  return "no room has this header";
}

bool allowed(const std::string& folder, const std::string& name) {
  const std::string other = folder_of(room_of(name));
  const Names& row = kMayInclude.at(folder);
  return other == folder || row.contains(other) || row.contains(name);
}

/// Calls f(path, its room) for each source file of the library.
void for_each_file(const std::function<void(const fs::path&, const std::string&)>& f) {
  for (const char* top : {"include", "core", "io", "filters", "bricks", "index", "surface", "gpu",
                          "stream", "pipeline", "ranks", "viewer"})
    for (const auto& entry : fs::recursive_directory_iterator(kRoot / top)) {
      if (!entry.is_regular_file() || !is_source(entry.path())) continue;
      const fs::path name = fs::relative(entry.path(), kRoot);
      f(entry.path(), std::string(top) == "include"
                          ? room_of(fs::relative(name, "include").string())
                          : name.parent_path().string());
    }
}

/// Calls f(path, its room, name) for each of our headers that the library's files include.
void for_each_include(
    const std::function<void(const fs::path&, const std::string&, const std::string&)>& f) {
  for_each_file([&](const fs::path& path, const std::string& room) {
    for (const std::string& name : includes_of(path))
      if (!room_of(name).empty()) f(path, room, name);
  });
}

TEST(Includes, FollowTheTable) {
  int seen = 0;
  for_each_include([&](const fs::path& path, const std::string& room, const std::string& name) {
    ++seen;
    const std::string folder = folder_of(room);
    ASSERT_NE(folder, "") << path << ": " << room;
    EXPECT_TRUE(allowed(folder, name)) << path << ": " << folder << "/ may not include " << name;
  });
  EXPECT_GT(seen, 1000) << "the test reads the wrong folder";
}

// So a header that does not compile alone shows when its source is compiled.
TEST(Includes, SourcesBeginWithTheirHeader) {
  int seen = 0;
  for_each_file([&](const fs::path& path, const std::string&) {
    const fs::path name = fs::relative(path, kRoot);
    const std::string header = fs::path(name).replace_extension(".h").string();
    const bool is_source =
        path.extension() == ".cpp" ||
        (path.extension() == ".cu" && !fs::exists(fs::path(path).replace_extension(".cpp")));
    if (!is_source || !fs::exists(kRoot / header)) return;
    const std::vector<std::string> names = includes_of(path);
    ASSERT_FALSE(names.empty()) << path;
    EXPECT_EQ(names.front(), header) << path;
    ++seen;
  });
  EXPECT_GT(seen, 200) << "the test reads the wrong folder";
}

TEST(Includes, NameFilesThatExist) {
  for_each_include([&](const fs::path& path, const std::string&, const std::string& name) {
    EXPECT_TRUE(fs::exists(is_public(name) ? kRoot / "include" / name : kRoot / name))
        << path << " includes " << name;
  });
}

TEST(Includes, KnowNothingOfProgramsAndTests) {
  for_each_file([](const fs::path& path, const std::string&) {
    for (const std::string& name : includes_of(path))
      EXPECT_FALSE(name.starts_with("tools/") || name.starts_with("tests/") ||
                   name.starts_with("bench/"))
          << path << " includes " << name;
  });
}

TEST(Includes, OfPublicHeadersArePublic) {
  for (const auto& entry : fs::directory_iterator(kRoot / "include/isobrick"))
    for (const std::string& name : includes_of(entry.path())) {
      EXPECT_TRUE(room_of(name).empty() || is_public(name)) << entry.path() << ": " << name;
    }
}

TEST(Includes, EveryPublicHeaderHasARoom) {
  std::size_t listed = 0, there = 0;
  for (const auto& [room, headers] : kPublicHeaders) listed += headers.size();
  for (const auto& entry : fs::directory_iterator(kRoot / "include/isobrick")) {
    ++there;
    EXPECT_NE(folder_of(room_of("isobrick/" + entry.path().filename().string())), "")
        << entry.path();
  }
  EXPECT_EQ(listed, there);
}

/// Rooms that lead back to themselves through what they include: empty where none does.
std::vector<std::string> find_cycle(const std::map<std::string, Names>& includes) {
  Names finished;
  std::vector<std::string> path;
  const std::function<bool(const std::string&)> leads_back = [&](const std::string& room) {
    if (std::find(path.begin(), path.end(), room) != path.end()) return true;
    if (finished.contains(room)) return false;
    path.push_back(room);
    if (const auto row = includes.find(room); row != includes.end())
      for (const std::string& other : row->second)
        if (leads_back(other)) return true;
    path.pop_back();
    finished.insert(room);
    return false;
  };
  for (const auto& [room, row] : includes)
    if (leads_back(room)) return path;
  return {};
}

TEST(Includes, NoArrowBetweenRoomsRunsUp) {
  std::map<std::string, Names> includes;
  for_each_include([&](const fs::path&, const std::string& room, const std::string& name) {
    if (room_of(name) != room) includes[room].insert(room_of(name));
  });
  EXPECT_EQ(find_cycle(includes), std::vector<std::string>());
  EXPECT_EQ(find_cycle({{"a", {"b"}}, {"b", {"c"}}, {"c", {"b"}}}),
            (std::vector<std::string>{"a", "b", "c"}));
}

TEST(Includes, OnlyTheGpuFolderKnowsCuda) {
  for_each_file([](const fs::path& path, const std::string& room) {
    if (folder_of(room) == "gpu") return;
    for (const std::string& name : includes_of(path))
      EXPECT_FALSE(name.starts_with("cuda") || name.starts_with("cub/") || name.ends_with(".cuh"))
          << path << " includes " << name;
  });
}

TEST(Includes, TheTableRefusesWhatItShould) {
  EXPECT_FALSE(allowed("core", "isobrick/volume_source.h"));
  EXPECT_FALSE(allowed("core", "io/bytes/file.h"));
  EXPECT_FALSE(allowed("io/meshes", "surface/cpu_extractor.h"));
  EXPECT_FALSE(allowed("stream", "isobrick/mesh.h"));
  EXPECT_FALSE(allowed("bricks", "isobrick/convert.h"));
  EXPECT_TRUE(allowed("io/meshes", "isobrick/mesh.h"));
}

}  // namespace
