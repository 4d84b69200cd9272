#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <isobrick/storage.h>

namespace isobrick::inline v0 {

/// Whatever lies in a folder of Zarr, of any version, one of these is there.
inline constexpr std::array<const char*, 4> kZarrFiles{"zarr.json", ".zattrs", ".zgroup",
                                                       ".zarray"};

/// The key of `name` below `folder`, either of which may be empty: without the empty parts and the
/// "." that either may have.
std::string join_key(std::string_view folder, std::string_view name);

/// How messages name the object of a key: in single quotes.
std::string quoted(const Storage& storage, const std::string& key);

/// The whole content of an object; nullopt when there is none. DamageError when it is larger than
/// `max_size`.
std::optional<std::string> read_small_object(const Storage& storage, const std::string& key,
                                             std::uint64_t max_size);

/// Throws DamageError unless so many bytes from `offset` on lie within `object`.
void check_range(const StoredObject& object, std::uint64_t offset, std::uint64_t size);

/// Storage::list() of sorted keys. `first_from(text)` returns the first key that is not less than
/// `text`, or null.
std::vector<std::string> list_keys(
    const std::string& folder,
    const std::function<const std::string*(const std::string&)>& first_from);

}  // namespace isobrick
