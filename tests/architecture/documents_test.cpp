#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

// Links between documents: every file and every heading that a link names is there.
namespace {

namespace fs = std::filesystem;

fs::path sources() { return fs::path(ISOBRICK_SOURCE_DIR); }

/// The Markdown files of the sources, of no build and no package of others.
std::vector<fs::path> documents() {
  std::vector<fs::path> list;
  for (const auto& entry : fs::directory_iterator(sources()))
    if (entry.path().extension() == ".md") list.push_back(entry.path());
  for (const char* folder : {"docs", "bench", "data"})
    for (const auto& entry : fs::recursive_directory_iterator(sources() / folder))
      if (entry.path().extension() == ".md") list.push_back(entry.path());
  return list;
}

/// The lines of a document, those of code blocks left out.
std::vector<std::string> prose_of(const fs::path& document) {
  std::ifstream file(document);
  std::vector<std::string> lines;
  bool in_block = false;
  for (std::string line; std::getline(file, line);) {
    if (line.find("```") == line.find_first_not_of(' ') && line.find("```") != line.npos)
      in_block = !in_block;
    else if (!in_block)
      lines.push_back(line);
  }
  return lines;
}

/// The anchor that GitHub gives a heading. Bytes beyond ASCII stay as they are.
std::string anchor_of(const std::string& heading) {
  const std::string text =
      std::regex_replace(heading, std::regex(R"(\[([^\]]*)\]\([^)]*\))"), "$1");
  std::string anchor;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == ' ')
      anchor += '-';
    else if (byte >= 128 || std::isalnum(byte) != 0 || c == '-' || c == '_')
      anchor += static_cast<char>(byte < 128 ? std::tolower(byte) : byte);
  }
  return anchor;
}

std::set<std::string> anchors_of(const fs::path& document) {
  std::set<std::string> anchors;
  std::map<std::string, int> seen;
  for (const std::string& line : prose_of(document)) {
    const auto level = line.find_first_not_of('#');
    if (level == 0 || level == line.npos || level > 6 || line[level] != ' ') continue;
    const std::string anchor = anchor_of(line.substr(level + 1));
    const int count = seen[anchor]++;
    anchors.insert(count == 0 ? anchor : anchor + "-" + std::to_string(count));
  }
  return anchors;
}

/// What the links of a document name: "file.md", "file.md#heading", "#heading".
std::vector<std::string> links_of(const fs::path& document) {
  static const std::regex link(R"(\]\(([^)\s]+)\))");
  std::vector<std::string> targets;
  for (const std::string& line : prose_of(document))
    for (std::sregex_iterator at(line.begin(), line.end(), link), end; at != end; ++at)
      if (const std::string target = (*at)[1]; target.find("://") == target.npos)
        targets.push_back(target);
  return targets;
}

TEST(Documents, LinksResolve) {
  int links = 0;
  for (const fs::path& document : documents())
    for (const std::string& target : links_of(document)) {
      SCOPED_TRACE(document.string() + " -> " + target);
      ++links;
      const auto hash = target.find('#');
      const fs::path file = hash == 0 ? document : document.parent_path() / target.substr(0, hash);
      EXPECT_TRUE(fs::exists(file));
      if (hash != target.npos && fs::exists(file) && file.extension() == ".md") {
        EXPECT_TRUE(anchors_of(file).contains(target.substr(hash + 1)));
      }
    }
  EXPECT_GT(links, 100) << "the test reads the wrong folder";
}

// The source files, scripts and settings name documents by their path in the sources.
TEST(Documents, ThatSourcesNameAreThere) {
  static const std::regex name(R"(\bdocs/[\w/.-]+\.md\b)");
  static const std::set<std::string> text{".h",  ".cpp",   ".cu",   ".cuh", ".py",
                                          ".md", ".cmake", ".json", ".txt", ""};
  int names = 0;
  const auto look = [&](const fs::path& path) {
    if (!text.contains(path.extension().string())) return;
    std::ifstream file(path);
    for (std::string line; std::getline(file, line);)
      for (std::sregex_iterator at(line.begin(), line.end(), name), end; at != end; ++at) {
        ++names;
        EXPECT_TRUE(fs::exists(sources() / at->str())) << path << " names " << at->str();
      }
  };
  for (const char* folder :
       {"bench", "bricks", "cmake", "core", "gpu", "include", "index", "io", "pipeline", "scripts",
        "stream", "surface", "tests", "tools", "viewer"})
    for (const auto& entry : fs::recursive_directory_iterator(sources() / folder))
      if (entry.is_regular_file() &&
          entry.path().string().find("node_modules") == std::string::npos)
        look(entry.path());
  for (const char* file : {"CMakeLists.txt", "CMakePresets.json"}) look(sources() / file);
  EXPECT_GT(names, 10) << "the test reads the wrong folder";
}

std::string text_of(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// What the guide shows is compiled and run against an installation.
TEST(Documents, ProgramsOfTheGuideAreThoseThatAreTested) {
  const std::string guide = text_of(sources() / "docs/guide/cpp.md");
  for (const char* name :
       {"store", "array", "simulation", "in_situ", "device", "device_store", "cancel"}) {
    const std::string program =
        text_of(sources() / "tests/consumer/project" / (std::string(name) + ".cpp"));
    const auto begin = program.find("#include");
    ASSERT_NE(begin, std::string::npos) << name;
    EXPECT_NE(guide.find("```cpp\n" + program.substr(begin) + "```"), std::string::npos) << name;
  }
}

TEST(Documents, HeadingsBecomeAnchors) {
  EXPECT_EQ(anchor_of("My mesh is open"), "my-mesh-is-open");
  EXPECT_EQ(anchor_of("VTK's own searches"), "vtks-own-searches");
  EXPECT_EQ(anchor_of("OpenVDB: `.vdb`"), "openvdb-vdb");
}

}  // namespace
