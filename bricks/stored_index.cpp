#include "bricks/stored_index.h"

#include <fmt/format.h>

#include <algorithm>

#include <isobrick/error.h>
#include "bricks/zarr/json_reader.h"
#include "io/bytes/file.h"
#include "io/bytes/folder_walk.h"

namespace isobrick {

namespace fs = std::filesystem;

static_assert(IndexLayout::kBrick * IndexLayout::kChunk == StoreReader::kRangeChunk * kBlockEdge);

fs::path index_folder(const fs::path& store, int level, const std::string& kind) {
  return store / "isobrick" / std::to_string(level) / "index" / kind;
}

fs::path index_description(const fs::path& folder) { return folder / "index.json"; }

fs::path index_chunk_path(const fs::path& folder, Int3 chunk) {
  return folder / "c" / std::to_string(chunk.z) / std::to_string(chunk.y) / std::to_string(chunk.x);
}

std::vector<std::string> stored_index_kinds(const fs::path& store, int level) {
  std::vector<std::string> kinds;
  std::error_code none;
  const fs::path folder = index_folder(store, level, "").parent_path();
  if (!fs::is_directory(folder, none)) return kinds;
  for (const FolderEntry& entry : folder_entries(folder)) {
    // A folder NAME.partial is still being built.
    if (entry.name.find('.') == std::string::npos &&
        fs::exists(index_description(folder / entry.name), none))
      kinds.push_back(entry.name);
  }
  std::sort(kinds.begin(), kinds.end());
  return kinds;
}

std::vector<std::string> index_folder_kinds(const fs::path& store, int level) {
  const fs::path folder = index_folder(store, level, "").parent_path();
  std::error_code failure;
  if (fs::status(folder, failure).type() == fs::file_type::not_found) return {};
  std::vector<std::string> kinds;
  for (const FolderEntry& entry : folder_entries(folder))
    if (entry.name.find('.') == std::string::npos) kinds.push_back(entry.name);
  std::sort(kinds.begin(), kinds.end());
  return kinds;
}

bool has_index(const fs::path& store, int level, const std::string& kind) {
  std::error_code none;
  return fs::exists(index_description(index_folder(store, level, kind)), none);
}

StoredIndex::StoredIndex(const StoreReader& store, int level, const std::string& kind)
    : folder_(index_folder(store.info().additions, level, kind)) {
  const fs::path file = index_description(folder_);
  const auto text = read_small_file(file, kMaxMetadataBytes);
  if (!text)
    throw Error(
        fmt::format("level {} has no {} index: there is no '{}'", level, kind, file.string()));
  layout_ = parse_index_layout(*text, quoted(file));
  const Lattice& lattice = store.info().levels.at(static_cast<std::size_t>(level)).lattice;
  if (layout_.kind != kind || layout_.type != lattice.type || layout_.extent != lattice.extent)
    throw DamageError(fmt::format("{}: kind, type or shape are not those of level {}'s {} index",
                                  quoted(file), level, kind));
  if (layout_.ranges_crc32c !=
      store.info().levels.at(static_cast<std::size_t>(level)).block_ranges_crc32c)
    throw DamageError(
        fmt::format("{}: is the index of other samples; {} --kind {} --force makes it "
                    "anew",
                    quoted(file), index_command(store.info()), kind));
  crc32c_ = checksum_of(layout_);
}

IndexChunk StoredIndex::open(Int3 chunk) const {
  return {index_chunk_path(folder_, chunk), layout_.parts_of_chunk(chunk),
          layout_.zstd_level.has_value(), name_of(chunk)};
}

std::uint64_t index_bytes(const StoredIndex& index) {
  std::uint64_t bytes = fs::file_size(index_description(index.folder()));
  for_each_point({{0, 0, 0}, index.layout().chunks()}, [&](Int3 c) {
    std::error_code missing;  // verify reports it; here it has no bytes
    const std::uint64_t size = fs::file_size(index_chunk_path(index.folder(), c), missing);
    if (!missing) bytes += size;
  });
  return bytes;
}

}  // namespace isobrick
