#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <stop_token>
#include <vector>

#include <isobrick/labels.h>
#include "core/cancellable_progress.h"
#include "pipeline/labels/label_image.h"
#include "pipeline/labels/label_spool.h"
#include "pipeline/workers.h"

namespace isobrick::inline v0 {

/// Makes meshes from the pieces of tiles, which wait in a spool.
class LabelMeshes {
 public:
  /// How it works.
  struct Plan {
    std::filesystem::path scratch_beside;
    std::uint64_t label_bytes = 0;  ///< for what is known of each label
    std::size_t at_a_time = 1;      ///< meshes that are passed on
    std::stop_token cancel = {};
    std::function<void(const LabelTotals&)> check_totals = {};  ///< of LabelOptions
    std::uint64_t max_narrow_vertices = kMaxNarrowVertices;     ///< a test has fewer
  };

  /// `image` must outlive it.
  LabelMeshes(const LabelImage& image, Plan plan)
      : image_(image), plan_(std::move(plan)), spool_(plan_.scratch_beside.string(), image.type) {}

  /// Pieces of tiles that follow those before in Morton order, as LabelSpool::append() takes them.
  /// Throws UsageError for more labels than there is room for.
  void append(std::span<const std::byte> packed);
  /// There are no more. Passes the meshes on, in `workers`; what it took. Throws UsageError where a
  /// label that was named is not there.
  LabelReport finish(Workers& workers, const LabelVisitor& visit, Progress& progress);

 private:
  void check_named(const std::vector<LabelChain>& chains) const;
  MeshHeader header_of(const LabelChain& chain) const;
  void pass_on(const std::vector<LabelChain>& chains, const LabelVisitor& visit,
               CancellableProgress& progress);

  const LabelImage& image_;
  Plan plan_;
  LabelSpool spool_;
};

}  // namespace isobrick
