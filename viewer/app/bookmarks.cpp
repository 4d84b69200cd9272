#include "viewer/app/bookmarks.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iterator>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::uintmax_t kMaxBytes = 16u << 20;

/// Reads all bookmarks of the user: an object of lists, by the stores' absolute paths.
Json read(const fs::path& file) {
  std::error_code missing;
  const std::uintmax_t size = fs::file_size(file, missing);
  if (missing) return Json::object();
  if (size > kMaxBytes)
    throw Error(fmt::format("'{}' is too large for a file of bookmarks", file.string()));
  std::ifstream in(file, std::ios::binary);
  const std::string text(std::istreambuf_iterator<char>(in), {});
  Json json = Json::parse(text, nullptr, false);
  if (!json.is_object())
    throw Error(
        fmt::format("'{}' is no file of bookmarks; remove it to start anew", file.string()));
  return json;
}

Bookmark bookmark_from(const Json& json) {
  if (!json.is_object() || !json.contains("name") || !json["name"].is_string() ||
      !json.contains("camera") || !json.contains("settings"))
    throw Error("bookmark without name, camera or settings");
  return {json["name"].get<std::string>(), camera_from(json["camera"]),
          view_settings_from(json["settings"])};
}

}  // namespace

fs::path Bookmarks::default_file() {
  const char* data = std::getenv("XDG_DATA_HOME");
  if (data != nullptr && *data != '\0') return fs::path(data) / "isobrick" / "bookmarks.json";
  const char* home = std::getenv("HOME");
  if (home == nullptr || *home == '\0')
    throw Error("there is no folder for bookmarks: neither XDG_DATA_HOME nor HOME is set");
  return fs::path(home) / ".local" / "share" / "isobrick" / "bookmarks.json";
}

Bookmarks::Bookmarks(fs::path file, const fs::path& store)
    : file_(std::move(file)), store_(fs::weakly_canonical(store).string()) {
  const Json all = read(file_);
  if (!all.contains(store_)) return;
  if (!all[store_].is_array())
    throw Error(
        fmt::format("'{}' is no file of bookmarks; remove it to start anew", file_.string()));
  for (const Json& item : all[store_]) list_.push_back(bookmark_from(item));
}

void Bookmarks::add(Bookmark bookmark) {
  std::vector<Bookmark> list = list_;
  const auto same = std::find_if(list.begin(), list.end(),
                                 [&](const Bookmark& b) { return b.name == bookmark.name; });
  if (same == list.end())
    list.push_back(std::move(bookmark));
  else
    *same = std::move(bookmark);
  save(std::move(list));
}

void Bookmarks::remove(std::size_t number) {
  std::vector<Bookmark> list = list_;
  list.erase(list.begin() + static_cast<std::ptrdiff_t>(number));
  save(std::move(list));
}

void Bookmarks::save(std::vector<Bookmark> list) {
  fs::create_directories(file_.parent_path());
  Json all = read(file_);  // another process may have written it
  Json mine = Json::array();
  for (const Bookmark& b : list) {
    mine.push_back(
        {{"name", b.name}, {"camera", to_json(b.camera)}, {"settings", to_json(b.settings)}});
    bookmark_from(mine.back());  // throws; an unreadable one would hide all others
  }
  all[store_] = std::move(mine);
  OutputFile out(file_.string(), true);
  out.writer().append(all.dump(1) + "\n");
  out.publish();
  list_ = std::move(list);
}

}  // namespace isobrick
