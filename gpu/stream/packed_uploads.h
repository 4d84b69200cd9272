#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <isobrick/lattice.h>
#include <isobrick/range.h>
#include "gpu/memory/cuda_objects.h"
#include "gpu/memory/device_buffer.h"
#include "gpu/memory/upload_tracker.h"

namespace isobrick::inline v0::gpu {

/// Packed bricks in pinned buffers on their way to a device, which decodes them. Beside each buffer
/// lies one on the device, for what is packed.
class PackedUploads {
 public:
  /// Buffers of packed_room(). Throws OutOfDeviceMemory.
  PackedUploads(const Lattice& lattice, std::size_t buffers);
  ~PackedUploads();

  /// What the thread that fills a buffer has put there. Throws DamageError for bytes that no brick
  /// is packed to.
  void set(std::size_t buffer, std::span<const std::byte> packed, Int3 brick,
           ValueRange<double> range);
  std::size_t bytes(std::size_t buffer) const { return loads_[buffer].bytes; }
  /// Where a buffer is copied to.
  std::byte* on_device(std::size_t buffer) { return memory_.data() + buffer * buffer_bytes_; }
  /// Decodes bricks once `copies` has copied them, and compares them with their ranges. Few bricks
  /// keep a device busy for as long as many, so that several calls are worked on at a time.
  void decode(std::span<const UploadTracker::PendingBrick> bricks, const Stream& copies);
  /// What comes after all bricks that were decoded so far, in the order of the calls.
  const Stream& decoded() const { return order_; }

  /// On the device: the number of a brick that was found wrong, of those decoded so far, or
  /// kNoBrick.
  const unsigned long long* failed() const { return failed_.data(); }
  static constexpr unsigned long long kNoBrick = ~0ull;

 private:
  struct Load {
    std::size_t bytes = 0;
    std::uint32_t palette = 0;
    bool is_plain = false;
    Int3 brick;
    ValueRange<double> range;
  };

  static constexpr std::size_t kStreams = 4;
  /// What calls are worked on in, in turn.
  struct DecodeStream {
    Stream stream;
    Event copied{cudaEventDisableTiming}, decoded{cudaEventDisableTiming};
  };

  void launch(std::span<const UploadTracker::PendingBrick> bricks, const Stream& stream);

  Lattice lattice_;
  std::size_t buffer_bytes_;
  std::array<DecodeStream, kStreams> streams_;
  std::uint64_t calls_ = 0;
  Stream order_;
  std::vector<Load> loads_;  ///< of each buffer
  DeviceBuffer<std::byte> memory_;
  DeviceBuffer<unsigned long long> failed_;
};

}  // namespace isobrick::gpu
