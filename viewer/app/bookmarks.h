#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "viewer/app/view_settings.h"

namespace isobrick::inline v0 {

/// A stored view.
struct Bookmark {
  std::string name;
  Camera camera;
  ViewSettings settings;
};

/// The bookmarks of one store, in a file of the user's, since a store may be read-only.
class Bookmarks {
 public:
  /// $XDG_DATA_HOME/isobrick/bookmarks.json, or the same below ~/.local/share. Throws Error if
  /// neither XDG_DATA_HOME nor HOME is set.
  static std::filesystem::path default_file();

  /// Reads the bookmarks of `store` from `file`, which need not exist. Throws Error if `file` is no
  /// file of bookmarks.
  Bookmarks(std::filesystem::path file, const std::filesystem::path& store);

  const std::vector<Bookmark>& list() const { return list_; }
  // Both write the file. If that fails they throw Error and change nothing.
  /// Adds a bookmark; it replaces one of the same name.
  void add(Bookmark bookmark);
  void remove(std::size_t number);

 private:
  void save(std::vector<Bookmark> list);

  std::filesystem::path file_;
  std::string store_;
  std::vector<Bookmark> list_;
};

}  // namespace isobrick
