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

namespace isobrick {

/// Slices of a store, as a renderer takes them. Not thread-safe.
class SliceViews {
 public:
  using Samples = std::array<std::shared_ptr<const SliceSamples>, 3>;

  /// `last`: the last sample of level 0; `type`: of the samples.
  SliceViews(const PictureBudgets& budgets, Vec3d last, ScalarType type);

  /// Of host memory: what slices take, with what renderers are given of them.
  static std::uint64_t memory(const PictureBudgets& budgets) { return budgets.memory / 8; }

  /// Asks for the samples that settings want, and takes those that have come; until new ones are
  /// there the last ones stay.
  void update(SceneStream& stream, const ViewSettings& settings);
  /// What is there, across x, y, z; null: nothing.
  Samples samples() const;
  /// Draws them; appends what is wrong with them to `damage`.
  void draw(Renderer& renderer, const ViewSettings& settings,
            std::vector<std::string>& damage) const;
  /// Of device memory, while they are drawn.
  std::uint64_t bytes() const;

 private:
  struct Slice {
    std::shared_ptr<const SliceSamples> from;
    std::vector<float> samples;
    bool requested = false;
  };

  Vec3d last_;
  std::uint64_t max_bytes_;  ///< of the samples of one
  std::array<Slice, 3> slices_;
};

}  // namespace isobrick
