#include "bricks/stored_index.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include <isobrick/error.h>
#include "bricks/storage/storage_keys.h"
#include "bricks/zarr/json_reader.h"
#include "bricks/zarr/store_names.h"

namespace isobrick::inline v0 {

static_assert(IndexLayout::kBrick * IndexLayout::kChunk == StoreReader::kRangeChunk * kBlockEdge);

namespace {

std::string description_key(const std::string& folder) {
  return join_key(folder, kIndexDescription);
}

}  // namespace

std::string index_folder(const std::string& additions, int level, const std::string& kind) {
  return level_addition(additions, level, join_key("index", kind));
}

std::string index_chunk_name(Int3 chunk) {
  return fmt::format("c/{}/{}/{}", chunk.z, chunk.y, chunk.x);
}

std::vector<std::string> stored_index_kinds(const StoreReader& store, int level) {
  std::vector<std::string> kinds = index_folder_kinds(store, level);
  std::erase_if(kinds, [&](const std::string& kind) { return !has_index(store, level, kind); });
  return kinds;
}

std::vector<std::string> index_folder_kinds(const StoreReader& store, int level) {
  std::vector<std::string> kinds =
      store.storage()->list(index_folder(store.info().additions, level, ""));
  // One that ends in .partial is still being built.
  std::erase_if(kinds, [](const std::string& kind) { return kind.find('.') != kind.npos; });
  std::sort(kinds.begin(), kinds.end());
  return kinds;
}

void hint_index(const StoreReader& store, int level, const std::string& kind) {
  const std::string folder = index_folder(store.info().additions, level, kind);
  store.storage()->will_open(description_key(folder));
}

bool has_index(const StoreReader& store, int level, const std::string& kind) {
  const std::string folder = index_folder(store.info().additions, level, kind);
  return store.storage()->open(description_key(folder)) != nullptr;
}

StoredIndex::StoredIndex(const StoreReader& store, int level, const std::string& kind)
    : storage_(store.storage()), folder_(index_folder(store.info().additions, level, kind)) {
  const std::string key = description_key(folder_), where = quoted(*storage_, key);
  const auto text = read_small_object(*storage_, key, kMaxMetadataBytes);
  if (!text)
    throw Error(fmt::format("level {} has no {} index: there is no {}", level, kind, where));
  layout_ = parse_index_layout(*text, where);
  const Lattice& lattice = store.info().levels.at(static_cast<std::size_t>(level)).lattice;
  if (layout_.kind != kind || layout_.type != surface_type(lattice.type) ||
      layout_.extent != lattice.extent)
    throw DamageError(fmt::format("{}: kind, type or shape are not those of level {}'s {} index",
                                  where, level, kind));
  if (layout_.ranges_crc32c !=
      store.info().levels.at(static_cast<std::size_t>(level)).block_ranges_crc32c)
    throw DamageError(
        fmt::format("{}: is the index of other samples; {} --kind {} --force makes it "
                    "anew",
                    where, index_command(store.info()), kind));
  crc32c_ = checksum_of(layout_);
}

std::shared_ptr<const StoredObject> StoredIndex::open_chunk(Int3 chunk) const {
  return storage_->open(join_key(folder_, index_chunk_name(chunk)));
}

IndexChunk StoredIndex::open(Int3 chunk) const {
  auto file = open_chunk(chunk);
  if (!file)
    throw DamageError(quoted(*storage_, join_key(folder_, index_chunk_name(chunk))) +
                      " is missing");
  return {std::move(file), layout_.parts_of_chunk(chunk), layout_.zstd_level.has_value(),
          name_of(chunk)};
}

std::uint64_t StoredIndex::bytes() const {
  const auto bytes_of = [](const std::shared_ptr<const StoredObject>& file) {
    return file ? file->size() : 0;
  };
  std::uint64_t bytes = bytes_of(storage_->open(description_key(folder_)));
  for_each_point({{0, 0, 0}, layout_.chunks()}, [&](Int3 c) { bytes += bytes_of(open_chunk(c)); });
  return bytes;
}

}  // namespace isobrick
