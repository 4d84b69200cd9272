#pragma once

#include <cstddef>
#include <string>

#include <isobrick/volume.h>
#include <isobrick/volume_source.h>
#include "pipeline/volume/volume_samples.h"

namespace isobrick::python {

/// The samples of a volume in memory, or behind a function, as the input of a conversion. Missing
/// ones are NaN.
class ArraySource final : public VolumeSource {
 public:
  /// What the volume names must outlive it. `memory` are bytes that its function takes. Throws
  /// UsageError for a volume that makes no sense.
  ArraySource(const Volume& volume, const std::string& name, std::size_t memory);

  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return true; }
  bool parallel() const override { return samples_.array.has_value() || samples_.concurrent; }
  std::size_t memory() const override;
  void read(Box3 box, std::byte* out) override;

 private:
  void read_with_missing(Box3 box, std::byte* out);

  VolumeSamples samples_;
  VolumeInfo info_;
  std::size_t memory_;
};

}  // namespace isobrick::python
