#pragma once

#include <openvdb/Grid.h>
#include <openvdb/io/Archive.h>
#include <openvdb/io/io.h>

#include <cstdint>
#include <functional>
#include <istream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "io/volumes/vdb/vdb_header.h"
#include "io/volumes/vdb/vdb_stream.h"

namespace isobrick::inline v0 {

/// A grid that is in memory, its leaves' values included.
struct VdbLoadedGrid {
  VdbGrid description;  ///< without its place and, so far, without its name
  openvdb::GridBase::Ptr grid;
};

/// An OpenVDB file whose grids are read step by step. OpenVDB's own File does not
/// notice that a file ends early; the stream here throws. OpenVDB's delayed
/// loading is not used.
class VdbArchive final : private openvdb::io::Archive {
 public:
  explicit VdbArchive(const std::string& path);

  /// The grid with its transform, but neither metadata nor a tree. stream() is then where the tree
  /// begins: for a grid that shares another one's, at that one's.
  openvdb::GridBase::Ptr read_grid(const std::vector<VdbGrid>& grids, const VdbGrid& chosen);

  /// Reads all grids one after the other, with OpenVDB's own functions and the offsets
  /// that the file states. Calls about_to_read(grid, bytes) before each takes so many bytes.
  std::vector<VdbLoadedGrid> load_grids(
      const std::function<void(const VdbGrid&, std::uint64_t)>& about_to_read);

  /// Throws std::ios_base::failure where the file ends.
  std::istream& stream() { return in_; }

 private:
  openvdb::GridBase::Ptr read_description(const VdbGrid& grid);
  std::uint64_t bytes_of_next(const openvdb::GridBase& grid);
  void read_header();

  std::string path_;
  std::uint32_t version_ = 0;  ///< as the file states it
  VdbFileBuffer buffer_;
  openvdb::io::StreamMetadata::Ptr metadata_;  // the stream refers to this very pointer
  std::istream in_;
};

/// VdbArchive::load_grids() of a file whose layout we do not know. Throws Error where OpenVDB
/// does not know it either.
std::vector<VdbLoadedGrid> load_vdb_grids(
    const std::string& path,
    const std::function<void(const VdbGrid&, std::uint64_t)>& about_to_read);

/// The Error for what went wrong with OpenVDB while a grid was read; call it in a handler.
/// An Error of our own passes.
[[noreturn]] void rethrow_vdb_damage(const std::string& path, std::string_view grid);

/// Calls f(), whose exceptions become Errors that name the grid.
template <class F>
decltype(auto) with_vdb_errors(const std::string& path, std::string_view grid, F&& f) {
  try {
    return std::forward<F>(f)();
  } catch (...) {
    rethrow_vdb_damage(path, grid);
  }
}

}  // namespace isobrick
