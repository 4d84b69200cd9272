#include "io/volumes/hdf5/hdf5_lzf.h"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <new>

#include <isobrick/error.h>
#include "io/volumes/hdf5/hdf5_filters.h"

namespace isobrick::inline v0 {
namespace {

/// A smaller control byte n is followed by n + 1 literals.
constexpr unsigned kFirstReference = 32;
/// A reference of this length has a byte more for it.
constexpr unsigned kLongReference = 7;
/// Of a chunk, and what filters add to it.
constexpr std::size_t kMaxFiltered = kMaxHdf5Chunk + (std::size_t{1} << 16);

/// Reads one packed stream and writes its samples.
class Unpacker {
 public:
  Unpacker(std::span<const std::byte> packed, std::span<std::byte> out)
      : packed_(packed), out_(out) {}

  void run() {
    while (at_ < packed_.size()) {
      const unsigned control = next();
      if (control < kFirstReference)
        copy_literals(control + 1);
      else
        copy_reference(control);
    }
    if (done_ != out_.size()) fail();
  }

 private:
  [[noreturn]] void fail() const {
    throw DamageError(fmt::format("it does not unpack to {} bytes (LZF)", out_.size()));
  }

  unsigned next() {
    if (at_ == packed_.size()) fail();
    return std::to_integer<unsigned>(packed_[at_++]);
  }

  void copy_literals(std::size_t count) {
    if (count > packed_.size() - at_ || count > out_.size() - done_) fail();
    std::copy_n(packed_.data() + at_, count, out_.data() + done_);
    at_ += count;
    done_ += count;
  }

  void copy_reference(unsigned control) {
    std::size_t count = control >> 5;
    if (count == kLongReference) count += next();
    count += 2;
    const std::size_t distance = ((control & 31u) << 8 | next()) + 1;
    if (distance > done_ || count > out_.size() - done_) fail();
    // Byte by byte: a reference may reach into what it writes.
    for (; count > 0; --count, ++done_) out_[done_] = out_[done_ - distance];
  }

  std::span<const std::byte> packed_;
  std::span<std::byte> out_;
  std::size_t at_ = 0, done_ = 0;
};

/// Bytes that a packed stream states it unpacks to.
std::size_t unpacked_size(std::span<const std::byte> packed) {
  std::size_t size = 0;
  for (std::size_t at = 0; at < packed.size();) {
    const auto control = std::to_integer<unsigned>(packed[at++]);
    if (control < kFirstReference) {
      size += control + 1;
      at += control + 1;
    } else {
      size += (control >> 5) + 2;
      if (control >> 5 == kLongReference && at < packed.size())
        size += std::to_integer<unsigned>(packed[at++]);
      ++at;
    }
  }
  return size;
}

/// The filter as libhdf5 calls it; 0 is failure. h5py's third value is the chunk's size, but
/// another filter before this one may have made it smaller or larger.
std::size_t filter(unsigned flags, std::size_t, const unsigned*, std::size_t size,
                   std::size_t* room, void** buffer) {
  if ((flags & H5Z_FLAG_REVERSE) == 0) return 0;
  const std::span packed{static_cast<const std::byte*>(*buffer), size};
  const std::size_t unpacked_bytes = unpacked_size(packed);
  if (unpacked_bytes == 0 || unpacked_bytes > kMaxFiltered) return 0;
  try {
    PodBuffer<std::byte> out;
    unpack_lzf(packed, unpacked_bytes, out);
    void* const unpacked = H5allocate_memory(out.size(), false);
    if (unpacked == nullptr) return 0;
    std::copy_n(out.data(), out.size(), static_cast<std::byte*>(unpacked));
    H5free_memory(*buffer);
    *buffer = unpacked;
    *room = out.size();
    return out.size();
  } catch (const std::bad_alloc&) {
    return 0;
  } catch (const Error&) {
    return 0;
  }
}

}  // namespace

void unpack_lzf(std::span<const std::byte> packed, std::size_t size, PodBuffer<std::byte>& out) {
  out.resize(size);
  Unpacker(packed, {out.data(), size}).run();
}

void register_hdf5_lzf() {
  if (H5Zfilter_avail(kHdf5LzfFilter) > 0) return;
  const H5Z_class2_t lzf{H5Z_CLASS_T_VERS, kHdf5LzfFilter, 0, 1, "lzf", nullptr, nullptr, filter};
  H5Zregister(&lzf);
}

}  // namespace isobrick
