#pragma once

#include <stop_token>

#include <isobrick/labels.h>
#include <isobrick/transform.h>
#include "pipeline/labels/label_spool.h"

namespace isobrick::inline v0 {

/// The mesh of a label whose pieces wait in a spool.
class SpooledLabelMesh final : public LabelMesh {
 public:
  /// All but `chain` must outlive it. `header` is what sinks hear before the first chunk.
  SpooledLabelMesh(const LabelSpool& spool, const LabelChain& chain, std::uint64_t index,
                   const Transform& transform, MeshHeader header, std::stop_token cancel,
                   std::uint64_t max_narrow_vertices = kMaxNarrowVertices)
      : spool_(spool),
        chain_(chain),
        index_(index),
        transform_(transform),
        header_(std::move(header)),
        cancel_(std::move(cancel)),
        max_narrow_vertices_(max_narrow_vertices) {}

  Label label() const override { return chain_.label; }
  std::uint64_t index() const override { return index_; }
  MeshSize size() const override { return {chain_.vertices, 2 * chain_.quads}; }
  void write(MeshSink& sink) const override;

 private:
  template <class Number>
  void write_chunks(MeshSink& sink) const;

  const LabelSpool& spool_;
  LabelChain chain_;
  std::uint64_t index_;
  const Transform& transform_;
  MeshHeader header_;
  std::stop_token cancel_;
  std::uint64_t max_narrow_vertices_;  ///< more have numbers of 64 bits
};

}  // namespace isobrick
