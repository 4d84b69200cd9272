#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "viewer/app/picture_setup.h"
#include "viewer/app/view_settings.h"
#include "viewer/render/renderer.h"
#include "viewer/scene/scene_stream.h"

namespace isobrick::inline v0 {

/// The slices of a store in a renderer's format. Not thread-safe.
class SliceViews {
 public:
  using Samples = std::array<std::shared_ptr<const SliceSamples>, 3>;

  /// `last`: the last sample of level 0; `type`: of the samples.
  SliceViews(const PictureBudgets& budgets, Vec3d last, ScalarType type);

  /// Bytes of host memory for slices, including the renderer's copies.
  static std::uint64_t memory(const PictureBudgets& budgets) { return budgets.memory / 8; }

  /// Requests the slices of the settings and takes finished ones; the previous images stay until
  /// then.
  void update(SceneStream& stream, const ViewSettings& settings);
  /// The present slices across x, y, z; null: none.
  Samples samples() const;
  /// Draws the slices and appends their damage to `damage`.
  void draw(Renderer& renderer, const ViewSettings& settings,
            std::vector<std::string>& damage) const;
  /// Bytes of device memory while they are drawn.
  std::uint64_t bytes() const;

 private:
  struct Slice {
    std::shared_ptr<const SliceSamples> from;
    std::vector<float> samples;
    bool requested = false;
  };

  Vec3d last_;
  std::uint64_t max_bytes_;  ///< of one slice's samples
  std::array<Slice, 3> slices_;
};

}  // namespace isobrick
