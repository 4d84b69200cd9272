#include "bricks/storage/storage_keys.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>

#include <isobrick/error.h>

namespace isobrick::inline v0 {

void StoredObject::will_need(std::uint64_t /*offset*/, std::uint64_t /*size*/) const {}

std::string Storage::name_of(const std::string& key) const { return name() + ":/" + key; }

void Storage::will_open(const std::string& /*key*/) const {}

bool Storage::is_remote() const { return false; }

std::uint64_t Storage::memory() const { return 0; }

std::filesystem::path Storage::local_path() const { return {}; }

std::string join_key(std::string_view folder, std::string_view name) {
  std::string key;
  for (const std::string_view path : {folder, name})
    for (std::size_t begin = 0; begin < path.size();) {
      const std::size_t end = std::min(path.find('/', begin), path.size());
      const std::string_view part = path.substr(begin, end - begin);
      begin = end + 1;
      if (part.empty() || part == ".") continue;
      if (!key.empty()) key += '/';
      key += part;
    }
  return key;
}

std::string quoted(const Storage& storage, const std::string& key) {
  return fmt::format("'{}'", storage.name_of(key));
}

std::optional<std::string> read_small_object(const Storage& storage, const std::string& key,
                                             std::uint64_t max_size) {
  const auto object = storage.open(key);
  if (!object) return std::nullopt;
  const std::uint64_t size = object->size();
  if (size > max_size)
    throw DamageError(fmt::format("'{}' has {} bytes, more than the {} that make sense",
                                  object->name(), size, max_size));
  std::string text(static_cast<std::size_t>(size), '\0');
  object->read(0, std::as_writable_bytes(std::span(text)));
  return text;
}

void check_range(const StoredObject& object, std::uint64_t offset, std::uint64_t size) {
  const std::uint64_t end = object.size();
  if (offset > end || size > end - offset)
    throw DamageError(fmt::format("'{}': {} bytes at offset {} go beyond its {} bytes",
                                  object.name(), size, offset, end));
}

std::vector<std::string> list_keys(
    const std::string& folder,
    const std::function<const std::string*(const std::string&)>& first_from) {
  std::vector<std::string> names;
  const std::string prefix = folder.empty() ? "" : folder + '/';
  for (std::string from = prefix;;) {
    const std::string* const key = first_from(from);
    if (key == nullptr || !key->starts_with(prefix)) break;
    const std::size_t slash = key->find('/', prefix.size());
    names.push_back(key->substr(prefix.size(), slash - prefix.size()));
    // The keys below a folder follow each other: from "x/" to before "x0".
    from = slash == key->npos ? *key + '\0' : prefix + names.back() + static_cast<char>('/' + 1);
  }
  // An object may have the name of a folder.
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

}  // namespace isobrick
