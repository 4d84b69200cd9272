#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "viewer/app/view_settings.h"

namespace isobrick {

/// A view that somebody wants to come back to.
struct Bookmark {
  std::string name;
  Camera camera;
  ViewSettings settings;
};

/// The bookmarks of one store, in a file of the user's (a store may be read-only).
class Bookmarks {
 public:
  /// $XDG_DATA_HOME/isobrick/bookmarks.json, or that below ~/.local/share. Throws Error
  /// when neither variable is set.
  static std::filesystem::path default_file();

  /// Reads what `file` holds for `store`; a file that is not there holds nothing.
  /// Throws Error for one that is no file of bookmarks.
  Bookmarks(std::filesystem::path file, const std::filesystem::path& store);

  const std::vector<Bookmark>& list() const { return list_; }
  // Both write the file; when that fails they throw Error and nothing has changed.
  /// Adds it, in place of one of the same name.
  void add(Bookmark bookmark);
  void remove(std::size_t number);

 private:
  void save(std::vector<Bookmark> list);

  std::filesystem::path file_;
  std::string store_;
  std::vector<Bookmark> list_;
};

}  // namespace isobrick
