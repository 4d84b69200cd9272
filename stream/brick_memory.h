#pragma once

#include <cstddef>
#include <memory>

namespace isobrick {

/// Where decoded bricks lie, and how they come there. Called from any thread.
class BrickMemory {
 public:
  virtual ~BrickMemory() = default;

  /// Room for bricks, one after the other; given back when nothing points to it any more.
  virtual std::shared_ptr<std::byte> room(std::size_t bytes) = 0;
  /// Where decoder `thread`, counted from 0, is to decode the brick of a place in that room,
  /// which need not be memory that a processor writes.
  virtual std::byte* begin(int /*thread*/, std::byte* place) { return place; }
  /// The samples that were begun last are whole and belong to `place`: they are to be there for
  /// whoever reads that memory.
  virtual void end(int /*thread*/, std::byte* /*place*/) {}
  /// Bricks a thread that should be decoded ahead: enough for all to be busy while whoever
  /// takes batches does something else.
  virtual std::size_t bricks_ahead() const { return 12; }
};

}  // namespace isobrick
