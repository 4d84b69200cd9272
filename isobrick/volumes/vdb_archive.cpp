#include "isobrick/volumes/vdb_archive.h"

#include <fmt/format.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <istream>
#include <new>
#include <sstream>
#include <stdexcept>

#include "isobrick/core/printable.h"
#include "isobrick/volumes/vdb_half_grid.h"

namespace isobrick {

namespace {

/// What a file begins with, up to its metadata. Version 225 only adds a type of grid: an
/// OpenVDB that does not know it reads it as its own newest version, but would first
/// print a warning to standard output.
std::string read_prologue(std::istream& in) {
  constexpr std::size_t kVersion = 8;
  constexpr std::size_t kSize = kVersion + 3 * sizeof(std::uint32_t) + 1 + 36;
  std::string bytes(kSize, '\0');
  in.read(bytes.data(), static_cast<std::streamsize>(kSize));
  std::uint32_t version;
  std::memcpy(&version, &bytes[kVersion], sizeof version);
  version = std::min<std::uint32_t>(version, openvdb::OPENVDB_FILE_VERSION);
  std::memcpy(&bytes[kVersion], &version, sizeof version);
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
  std::istringstream header(read_prologue(in_));
  readHeader(header);
  metadata_->setSeekable(true);
  openvdb::io::setStreamMetadataPtr(in_, metadata_, false);
  setFormatVersion(in_);
  setLibraryVersion(in_);
  setDataCompression(in_);
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

void rethrow_vdb_damage(const std::string& path, std::string_view grid) {
  const auto damaged = [&](std::string_view what) {
    return Error(fmt::format("'{}': grid '{}' is damaged: {}", path, grid, what));
  };
  // OpenVDB's messages may have several lines, and what the file has for a name.
  constexpr std::size_t kMostShown = 200;
  try {
    throw;
  } catch (const Error&) {
    throw;
  } catch (const std::ios_base::failure&) {
    throw damaged("the file ends before the grid does");
  } catch (const std::bad_alloc&) {
    throw damaged("it asks for more memory than there is");
  } catch (const std::exception& error) {
    throw damaged(printable(error.what(), kMostShown));
  }
}

}  // namespace isobrick
