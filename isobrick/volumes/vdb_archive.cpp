#include "isobrick/volumes/vdb_archive.h"

#include <fmt/format.h>
#include <openvdb/io/Archive.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/io/io.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <fstream>
#include <new>
#include <stdexcept>

#include "isobrick/core/error.h"

namespace isobrick {
namespace {

/// OpenVDB's own File neither notices that a file ends early nor can be told to;
/// a stream that throws can. It is read at once: nothing is loaded later.
class GridArchive : public openvdb::io::Archive {
 public:
  // OpenVDB seeks often, and a file stream fills its buffer anew each time.
  explicit GridArchive(const std::string& path) : buffer_(std::size_t{1} << 14) {
    in_.rdbuf()->pubsetbuf(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
    in_.exceptions(std::ios::failbit | std::ios::badbit | std::ios::eofbit);
    in_.open(path, std::ios::binary);
    readHeader(in_);
    metadata_ = std::make_shared<openvdb::io::StreamMetadata>();
    metadata_->setSeekable(true);
    openvdb::io::setStreamMetadataPtr(in_, metadata_, false);
    setFormatVersion(in_);
    setLibraryVersion(in_);
    setDataCompression(in_);
  }

  openvdb::GridBase::Ptr read(const VdbGrid& from) {
    openvdb::io::GridDescriptor place(from.unique_name, from.type, from.half);
    place.setInstanceParentName(from.parent);
    const openvdb::GridBase::Ptr grid = openvdb::GridBase::createGrid(from.type);
    grid->setSaveFloatAsHalf(from.half);
    in_.seekg(static_cast<std::streamoff>(from.begin));
    readGrid(grid, place, in_);
    return grid;
  }

 private:
  std::vector<char> buffer_;
  std::ifstream in_;
  openvdb::io::StreamMetadata::Ptr metadata_;
};

openvdb::GridBase::Ptr read_with_parent(const std::string& path, const std::vector<VdbGrid>& grids,
                                        const VdbGrid& chosen) {
  openvdb::initialize();
  GridArchive archive(path);
  const openvdb::GridBase::Ptr grid = archive.read(chosen);
  if (chosen.parent.empty()) return grid;
  const auto parent = std::find_if(grids.begin(), grids.end(), [&](const VdbGrid& other) {
    return other.unique_name == chosen.parent && other.type == chosen.type && other.parent.empty();
  });
  if (parent == grids.end())
    throw Error(
        fmt::format("'{}': grid '{}' shares the tree of one that is not there", path, chosen.name));
  grid->setTree(archive.read(*parent)->baseTreePtr());
  return grid;
}

/// OpenVDB's messages may have several lines, and what the file has for a name.
std::string one_line(std::string text) {
  for (char& c : text)
    if (c < 0x20 || c > 0x7e) c = ' ';
  if (text.size() > 200) text.resize(200);
  return text;
}

}  // namespace

openvdb::GridBase::Ptr read_vdb_grid(const std::string& path, const std::vector<VdbGrid>& grids,
                                     const VdbGrid& chosen) {
  const auto damaged = [&](const std::string& what) {
    return Error(fmt::format("'{}': grid '{}' is damaged: {}", path, chosen.name, what));
  };
  try {
    return read_with_parent(path, grids, chosen);
  } catch (const Error&) {
    throw;
  } catch (const std::ios_base::failure&) {
    throw damaged("the file ends before the grid does");
  } catch (const std::bad_alloc&) {
    throw damaged("it asks for more memory than there is");
  } catch (const std::exception& error) {
    throw damaged(one_line(error.what()));
  }
}

}  // namespace isobrick
