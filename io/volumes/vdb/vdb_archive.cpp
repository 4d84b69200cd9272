#include "io/volumes/vdb/vdb_archive.h"

#include <fmt/format.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <istream>
#include <new>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <type_traits>

#include "core/printable.h"
#include "io/volumes/vdb/vdb_half_grid.h"
#include "io/volumes/vdb/vdb_leaves.h"

namespace isobrick::inline v0 {

namespace {

/// Where a file has its version, and the bytes up to its metadata since version 222.
constexpr std::size_t kVersion = 8;
constexpr std::size_t kMaxNameShown = 100;
constexpr std::size_t kPrologue = kVersion + 3 * sizeof(std::uint32_t) + 1 + 36;

/// Bytes of a grid's tree in memory with all values, if it is of this type. `in` is where the
/// tree begins, and stays there.
template <class Grid>
std::optional<std::uint64_t> count_bytes(std::istream& in, const openvdb::GridBase& grid,
                                         bool half) {
  using Leaf = typename Grid::TreeType::LeafNodeType;
  using Value = typename Grid::ValueType;
  if (!grid.isType<Grid>()) return std::nullopt;
  const VdbNodeCounts counts = count_vdb_nodes<typename Grid::TreeType>(in, half);
  const std::size_t leaf = std::is_same_v<Value, bool> ? 0 : Leaf::SIZE * sizeof(Value);
  return counts.bytes + counts.leaves * leaf;
}

template <class... Grids>
std::optional<std::uint64_t> count_bytes_of(std::istream& in, const openvdb::GridBase& grid,
                                            bool half) {
  std::optional<std::uint64_t> bytes;
  ((bytes = bytes ? bytes : count_bytes<Grids>(in, grid, half)), ...);
  return bytes;
}

}  // namespace

VdbArchive::VdbArchive(const std::string& path)
    : path_(path),
      buffer_(path),
      metadata_(std::make_shared<openvdb::io::StreamMetadata>()),
      in_(&buffer_) {
  openvdb::initialize();
  register_vdb_half_grid();
  in_.exceptions(std::ios::failbit | std::ios::badbit | std::ios::eofbit);
  read_header();
  metadata_->setSeekable(true);
  openvdb::io::setStreamMetadataPtr(in_, metadata_, false);
  setFormatVersion(in_);
  setLibraryVersion(in_);
  setDataCompression(in_);
}

/// Version 225 only adds a type of grid: an OpenVDB that does not know it, or a later one, reads
/// it as its own newest version, but would first print a warning to standard output.
void VdbArchive::read_header() {
  std::string bytes(kPrologue, '\0');
  in_.read(bytes.data(), static_cast<std::streamsize>(kPrologue));
  std::uint32_t version;
  std::memcpy(&version, &bytes[kVersion], sizeof version);
  version_ = version;
  if (version < kVdbOldest) {
    in_.seekg(0);
    readHeader(in_);
    return;
  }
  version = std::min<std::uint32_t>(version, openvdb::OPENVDB_FILE_VERSION);
  std::memcpy(&bytes[kVersion], &version, sizeof version);
  std::istringstream header(bytes);
  readHeader(header);
}

openvdb::GridBase::Ptr VdbArchive::read_description(const VdbGrid& from) {
  const openvdb::GridBase::Ptr grid = openvdb::GridBase::createGrid(from.type);
  in_.seekg(static_cast<std::streamoff>(from.begin));
  readGridCompression(in_);
  // Metadata were read with the header: OpenVDB takes any length of them for true.
  grid->setSaveFloatAsHalf(from.half);
  in_.seekg(static_cast<std::streamoff>(from.transform));
  grid->readTransform(in_);
  return grid;
}

openvdb::GridBase::Ptr VdbArchive::read_grid(const std::vector<VdbGrid>& grids,
                                             const VdbGrid& chosen) {
  const openvdb::GridBase::Ptr grid = read_description(chosen);
  if (chosen.parent.empty()) return grid;
  const auto parent = std::find_if(grids.begin(), grids.end(), [&](const VdbGrid& other) {
    return other.unique_name == chosen.parent && other.type == chosen.type && other.parent.empty();
  });
  if (parent == grids.end())
    throw Error(fmt::format("'{}': grid '{}' shares the tree of one that is not there", path_,
                            chosen.name));
  read_description(*parent);
  grid->setSaveFloatAsHalf(parent->half);
  return grid;
}

/// Bytes that the grid's tree, whose description begins at the stream, takes in memory. The stream
/// stays there.
std::uint64_t VdbArchive::bytes_of_next(const openvdb::GridBase& grid) {
  const auto begin = in_.tellg();
  readGridCompression(in_);
  openvdb::MetaMap metadata;
  metadata.readMeta(in_);
  openvdb::math::Transform().read(in_);
  std::optional<std::uint64_t> bytes;
  if (version_ >= kVdbOldest)
    bytes = count_bytes_of<openvdb::FloatGrid, VdbHalfGrid, openvdb::DoubleGrid, openvdb::Int32Grid,
                           openvdb::Int64Grid, openvdb::BoolGrid, openvdb::MaskGrid>(
        in_, grid, grid.saveFloatAsHalf());
  const auto at = in_.tellg();
  in_.seekg(0, std::ios_base::end);
  const auto rest = static_cast<std::uint64_t>(in_.tellg() - at);
  in_.seekg(begin);
  if (bytes) return *bytes;
  // What the writer counted, and no less than is in the file.
  const auto counted = metadata.getMetadata<openvdb::Int64Metadata>("file_mem_bytes");
  return std::max(
      rest,
      counted ? static_cast<std::uint64_t>(std::max<std::int64_t>(0, counted->value())) : rest);
}

std::vector<VdbLoadedGrid> VdbArchive::load_grids(
    const std::function<void(const VdbGrid&, std::uint64_t)>& about_to_read) {
  openvdb::MetaMap().readMeta(in_);
  std::vector<VdbLoadedGrid> loaded;
  std::vector<openvdb::io::GridDescriptor> descriptors;
  NamedGridMap by_name;
  for (std::int32_t count = readGridCount(in_); count > 0; --count) {
    openvdb::io::GridDescriptor& descriptor = descriptors.emplace_back();
    const openvdb::GridBase::Ptr grid = descriptor.read(in_);
    VdbGrid description;
    description.unique_name = descriptor.uniqueName();
    description.name = printable(openvdb::io::GridDescriptor::nameAsString(descriptor.uniqueName()),
                                 kMaxNameShown);
    description.type = grid->type();
    if (!descriptor.isInstance()) about_to_read(description, bytes_of_next(*grid));
    readGrid(grid, descriptor, in_);
    const auto text = [&](const char* name) {
      const auto item = grid->getMetadata<openvdb::StringMetadata>(name);
      return item ? item->value() : std::string();
    };
    describe_vdb_texts(description, text("name"), text("unit"), text("class"),
                       grid->transform().mapType());
    by_name[descriptor.uniqueName()] = grid;
    loaded.push_back({std::move(description), grid});
  }
  for (const openvdb::io::GridDescriptor& descriptor : descriptors)
    connectInstance(descriptor, by_name);
  return loaded;
}

std::vector<VdbLoadedGrid> load_vdb_grids(
    const std::string& path,
    const std::function<void(const VdbGrid&, std::uint64_t)>& about_to_read) {
  constexpr std::size_t kMaxShown = 200;
  const VdbLayout layout = read_vdb_layout(path);
  const auto refused = [&](std::string_view what) {
    return Error(fmt::format(
        "'{}' is an OpenVDB {} of version {}, which OpenVDB {} does not read either: {}", path,
        layout.has_offsets ? "file" : "stream", layout.version, openvdb::getLibraryVersionString(),
        what));
  };
  try {
    return VdbArchive(path).load_grids(about_to_read);
  } catch (const Error&) {
    throw;
  } catch (const std::ios_base::failure&) {
    throw refused("it ends too early");
  } catch (const std::bad_alloc&) {
    throw refused("it needs more memory than there is");
  } catch (const std::exception& error) {
    throw refused(printable(error.what(), kMaxShown));
  }
}

void rethrow_vdb_damage(const std::string& path, std::string_view grid) {
  const auto damaged = [&](std::string_view what) {
    return Error(fmt::format("'{}': grid '{}' is damaged: {}", path, grid, what));
  };
  // OpenVDB's messages may have several lines, and what the file has for a name.
  constexpr std::size_t kMaxShown = 200;
  try {
    throw;
  } catch (const Error&) {
    throw;
  } catch (const std::ios_base::failure&) {
    throw damaged("the file ends before the grid does");
  } catch (const std::bad_alloc&) {
    throw damaged("it needs more memory than there is");
  } catch (const std::exception& error) {
    throw damaged(printable(error.what(), kMaxShown));
  }
}

}  // namespace isobrick
