#include "pipeline/convert/convert_journal.h"

#include <fcntl.h>
#include <fmt/format.h>

#include <algorithm>
#include <span>

#include <isobrick/error.h>
#include "bricks/zarr/store_names.h"

namespace isobrick::inline v0 {
namespace {

/// Spreads a brick's place and checksum over 64 bits (the finaliser of
/// SplitMix64), so that their sum does not depend on the order of the bricks.
std::uint64_t mix(std::uint64_t place, std::uint32_t crc) {
  std::uint64_t v = (place + 1) * 0x9e3779b97f4a7c15ULL ^ crc;
  v = (v ^ v >> 30) * 0xbf58476d1ce4e5b9ULL;
  v = (v ^ v >> 27) * 0x94d049bb133111ebULL;
  return v ^ v >> 31;
}

}  // namespace

ConvertJournal::ConvertJournal(const std::filesystem::path& store, const Lattice& lattice,
                               bool resume)
    : folder_(store), path_(store / kConvertJournal), lattice_(lattice) {
  if (resume) read_earlier();
  // Always a file of our own making.
  const std::filesystem::path temporary = temporary_name(path_);
  file_ = folder_.create_file(temporary);
  file_.set_path(path_);
  file_.write_at(0, std::as_bytes(std::span(earlier_)));
  folder_.rename_file(temporary, path_);
}

void ConvertJournal::read_earlier() {
  const File file = folder_.open_file(path_, O_RDONLY);
  if (!file) return;
  const auto layers = static_cast<std::uint64_t>(lattice_.bricks().z);
  earlier_.resize(static_cast<std::size_t>(std::min(file.size() / sizeof(earlier_[0]), layers)));
  file.read_at(0, std::as_writable_bytes(std::span(earlier_)));
}

void ConvertJournal::add(Int3 brick, std::uint32_t crc) {
  open_[brick.z] += mix(static_cast<std::uint64_t>(linear_index(brick, lattice_.bricks())), crc);
}

void ConvertJournal::close(Index z1) {
  const Index layers = z1 >= lattice_.extent.z ? lattice_.bricks().z : z1 / lattice_.brick.z;
  for (; next_ < layers; ++next_) {
    record(next_, open_[next_]);
    open_.erase(next_);
  }
}

void ConvertJournal::record(Index layer, std::uint64_t sum) {
  const auto i = static_cast<std::size_t>(layer);
  if (i < earlier_.size()) {
    if (earlier_[i] == sum) return;
    const Index z0 = layer * lattice_.brick.z;
    throw Error(fmt::format(
        "the input is not the one that '{}' was begun with: planes {} to {} "
        "differ; --force starts anew",
        path_.parent_path().string(), z0, std::min(z0 + lattice_.brick.z, lattice_.extent.z) - 1));
  }
  file_.write_at(i * sizeof(sum), std::as_bytes(std::span(&sum, 1)));
}

void ConvertJournal::remove() { folder_.remove_file(path_); }

}  // namespace isobrick
