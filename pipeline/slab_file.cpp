#include "pipeline/slab_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

/// Calls f(offset in the file, offset in the box, bytes) for each contiguous
/// run that `box` has in common with the array.
template <class F>
void for_each_run(Box3 box, Int3 extent, std::size_t sample_bytes, F&& f) {
  const Int3 e = box.extent();
  const bool whole_rows = e.x == extent.x;
  const bool whole_planes = whole_rows && e.y == extent.y;
  const Int3 run{e.x, whole_rows ? e.y : 1, whole_planes ? e.z : 1};
  const std::size_t bytes = static_cast<std::size_t>(volume(run)) * sample_bytes;
  std::size_t inside = 0;
  for (Index z = box.lo.z; z < box.hi.z; z += run.z)
    for (Index y = box.lo.y; y < box.hi.y; y += run.y, inside += bytes)
      f(static_cast<std::uint64_t>(linear_index({box.lo.x, y, z}, extent)) * sample_bytes, inside,
        bytes);
}

File open_nameless(const std::filesystem::path& beside) {
  const std::string described = "a temporary file beside '" + beside.string() + "'";
  const std::filesystem::path parent = beside.parent_path();
  const std::string folder = parent.empty() ? "." : parent.string();
  UniqueFd fd(::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600));
  if (fd.get() >= 0) return {std::move(fd), described};
  // Not every file system has nameless files.
  std::string name = beside.string() + ".spool-XXXXXX";
  UniqueFd named(::mkostemp(name.data(), O_CLOEXEC));
  if (named.get() < 0) throw system_error("create a temporary file in", folder, errno);
  ::unlink(name.c_str());
  return {std::move(named), described};
}

}  // namespace

SlabFile::SlabFile(File file, Int3 extent, std::size_t sample_bytes, std::uint64_t begin)
    : file_(std::move(file)), extent_(extent), sample_bytes_(sample_bytes), begin_(begin) {}

std::uint64_t SlabFile::bytes() const {
  return static_cast<std::uint64_t>(volume(extent_)) * sample_bytes_;
}

void SlabFile::reserve() const {
  const int failure =
      ::posix_fallocate(file_.fd(), static_cast<off_t>(begin_), static_cast<off_t>(bytes()));
  // A file system that cannot reserve shows a full disk when it is written to.
  if (failure != 0 && failure != EOPNOTSUPP && failure != EINVAL)
    throw system_error(fmt::format("make room for {} bytes for", bytes()), file_.path().string(),
                       failure);
}

void SlabFile::write(Box3 box, const std::byte* samples) {
  for_each_run(box, extent_, sample_bytes_,
               [&](std::uint64_t offset, std::size_t inside, std::size_t bytes) {
                 file_.write_at(begin_ + offset, {samples + inside, bytes});
               });
}

void SlabFile::read(Box3 box, std::byte* samples) const {
  for_each_run(box, extent_, sample_bytes_,
               [&](std::uint64_t offset, std::size_t inside, std::size_t bytes) {
                 file_.read_at(begin_ + offset, {samples + inside, bytes});
               });
}

SpooledVolume::SpooledVolume(const std::filesystem::path& beside, VolumeInfo info)
    : info_(std::move(info)), file_(open_nameless(beside), info_.extent, size_of(info_.type)) {}

}  // namespace isobrick
