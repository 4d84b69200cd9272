#include "isobrick/pipeline/convert_journal.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "isobrick/core/error.h"

namespace isobrick {
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
    : path_(store / "convert.journal"), lattice_(lattice) {
  fd_ =
      UniqueFd(::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | (resume ? 0 : O_TRUNC), 0666));
  if (fd_.get() < 0) throw system_error("create", path_.string(), errno);
  earlier_.resize(static_cast<std::size_t>(lattice.bricks().z));
  const ssize_t n = ::pread(fd_.get(), earlier_.data(), earlier_.size() * sizeof(earlier_[0]), 0);
  if (n < 0) throw system_error("read", path_.string(), errno);
  earlier_.resize(static_cast<std::size_t>(n) / sizeof(earlier_[0]));
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
  if (::pwrite(fd_.get(), &sum, sizeof(sum), static_cast<off_t>(i * sizeof(sum))) !=
      static_cast<ssize_t>(sizeof(sum)))
    throw system_error("write", path_.string(), errno);
}

void ConvertJournal::remove() { ::unlink(path_.c_str()); }

}  // namespace isobrick
