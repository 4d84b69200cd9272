#pragma once

#include <cstddef>
#include <functional>
#include <future>

#include <isobrick/pod_buffer.h>
#include "pipeline/volume/array_samples.h"
#include "pipeline/workers.h"

namespace isobrick::inline v0 {

/// Reads boxes of samples, the next one while the caller works on the last one.
class RegionReader {
 public:
  /// Copies the samples of a box, C order [z, y, x].
  using Read = std::function<void(Box3 box, std::byte* out)>;

  /// `concurrent`: several threads, those of `workers`, may call `read` at a time.
  RegionReader(Read read, bool concurrent, ScalarType type, Workers& workers)
      : read_(std::move(read)), concurrent_(concurrent), type_(type), workers_(workers) {}
  /// Waits for what is being read.
  ~RegionReader();

  /// Begins to read a box; the one before was taken.
  void begin(Box3 box);
  /// Waits for the box that was begun. Its samples stay until the next but one is begun. Throws
  /// what reading threw.
  SampleArray take();

 private:
  void read(Box3 box, std::byte* out) const;

  Read read_;
  bool concurrent_;
  ScalarType type_;
  Workers& workers_;
  PodBuffer<std::byte> buffers_[2];
  Box3 box_;
  int next_ = 0;  ///< buffer to read to
  std::future<void> reading_;
};

}  // namespace isobrick
