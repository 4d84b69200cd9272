#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "filters/filter_stage.h"

namespace isobrick::inline v0 {

/// Passes a mesh on in another unit of length. Chunks stay as they are.
class UnitStage final : public FilterStage {
 public:
  /// `unit` is as unit_name() has it.
  UnitStage(MeshSink& next, std::stop_token cancel, std::string unit)
      : FilterStage(next, std::move(cancel)), indexing_(next.indexing()), unit_(std::move(unit)) {}

  Indexing indexing() const override { return indexing_; }
  bool takes_wide() const override { return next().takes_wide(); }
  /// Throws UsageError where the mesh has no unit.
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override { next().finish(); }

 private:
  std::uint64_t own_bytes() const override { return 0; }
  std::uint64_t own_memory() const override { return positions_.capacity() * sizeof(Vec3f); }

  Indexing indexing_;
  std::string unit_;
  double ratio_ = 1;  ///< of the new coordinates to those before
  std::vector<Vec3f> positions_;
};

}  // namespace isobrick
