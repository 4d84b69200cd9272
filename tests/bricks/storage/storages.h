#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include <isobrick/storage.h>
#include "tests/bricks/storage/zip_writer.h"

namespace isobrick::test {

using Contents = std::map<std::string, std::string>;  ///< by key

/// The files of a folder.
inline Contents contents_of(const std::filesystem::path& folder) {
  Contents contents;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    std::ifstream in(entry.path(), std::ios::binary);
    contents[std::filesystem::relative(entry.path(), folder).string()] = {
        std::istreambuf_iterator<char>(in), {}};
  }
  return contents;
}

inline std::vector<std::byte> bytes_of(const std::string& text) {
  std::vector<std::byte> bytes(text.size());
  std::ranges::copy(std::as_bytes(std::span(text)), bytes.begin());
  return bytes;
}

/// A zip of these, in which the names begin with `top`.
inline std::string zip_of(const Contents& contents, const ZipForm& form = {},
                          const std::string& top = "") {
  ZipWriter zip(form);
  for (const auto& [key, bytes] : contents) zip.add(top + key, bytes);
  return zip.finish();
}

inline std::shared_ptr<const Storage> memory_of(const Contents& contents) {
  std::map<std::string, std::vector<std::byte>> objects;
  for (const auto& [key, bytes] : contents) objects.emplace(key, bytes_of(bytes));
  return memory_storage(std::move(objects));
}

/// A zip in memory.
inline std::shared_ptr<const Storage> zip_in_memory(const std::string& zip) {
  return zip_storage(memory_of({{"x.zip", zip}})->open("x.zip"));
}

inline std::shared_ptr<const Storage> functions_of(const Contents& contents) {
  const auto shared = std::make_shared<const Contents>(contents);
  StorageFunctions functions;
  functions.size = [shared](const std::string& key) -> std::optional<std::uint64_t> {
    const auto found = shared->find(key);
    if (found == shared->end()) return std::nullopt;
    return found->second.size();
  };
  functions.read = [shared](const std::string& key, std::uint64_t offset,
                            std::span<std::byte> bytes) {
    if (!bytes.empty()) std::memcpy(bytes.data(), shared->at(key).data() + offset, bytes.size());
  };
  functions.list = [shared](const std::string& folder) {
    const std::string prefix = folder.empty() ? "" : folder + "/";
    std::set<std::string> names;
    for (const auto& [key, bytes] : *shared)
      if (key.starts_with(prefix))
        names.insert(key.substr(prefix.size(), key.find('/', prefix.size()) - prefix.size()));
    return std::vector<std::string>(names.begin(), names.end());
  };
  return function_storage(std::move(functions), "functions");
}

/// The kinds of storage that make_storage() makes.
inline const std::vector<std::string>& storage_kinds() {
  static const std::vector<std::string> kinds{"folder", "zip",           "zip64",  "zip_to_a_pipe",
                                              "top",    "zip_in_memory", "memory", "functions"};
  return kinds;
}

/// A storage of such a kind with these contents; `folder` takes its files.
inline std::shared_ptr<const Storage> make_storage(const std::string& kind,
                                                   const Contents& contents,
                                                   const std::filesystem::path& folder) {
  namespace fs = std::filesystem;
  const auto write = [](const fs::path& file, const std::string& bytes) {
    fs::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << bytes;
    return file;
  };
  const auto zip_file = [&](const std::string& zip) {
    return zip_storage(write(folder / "x.zarr.zip", zip));
  };
  if (kind == "folder") {
    for (const auto& [key, bytes] : contents) write(folder / "x.zarr" / key, bytes);
    return folder_storage(folder / "x.zarr");
  }
  if (kind == "zip") return zip_file(zip_of(contents));
  if (kind == "zip64") return zip_file(zip_of(contents, {.zip64 = true}));
  if (kind == "zip_to_a_pipe") return zip_file(zip_of(contents, {.descriptors = true}));
  if (kind == "top") return zip_file(zip_of(contents, {}, "x.zarr/"));
  if (kind == "zip_in_memory") return zip_in_memory(zip_of(contents));
  return kind == "memory" ? memory_of(contents) : functions_of(contents);
}

}  // namespace isobrick::test
