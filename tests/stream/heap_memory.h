#pragma once

#include <atomic>
#include <cstddef>
#include <memory>

#include "stream/brick_memory.h"

namespace isobrick::test {

/// Room for bricks on the heap, and how many bytes of it were requested.
class HeapMemory : public BrickMemory {
 public:
  std::shared_ptr<std::byte> room(std::size_t size) override {
    bytes += size;
    bytes.notify_all();
    return {new std::byte[size], std::default_delete<std::byte[]>()};
  }
  /// Returns after the first call of room().
  void wait_for_demand() const { bytes.wait(0); }

  std::atomic<std::size_t> bytes = 0;
};

}  // namespace isobrick::test
