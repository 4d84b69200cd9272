#pragma once

#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include <isobrick/mesh.h>
#include "io/bytes/output_file.h"
#include "pipeline/pieces/piece_format.h"
#include "surface/tile_places.h"

namespace isobrick::inline v0 {

/// Writes a piece: takes the mesh of a part and where its tiles lie in it. The bytes depend on
/// neither the chunks nor who makes them.
class PieceWriter final : public MeshSink, public TilePlaces {
 public:
  /// Appends to `out`, which must outlive it.
  PieceWriter(FileWriter& out, const PieceDescription& header);

  void place(const TilePlace& tile) override;

  Indexing indexing() const override { return Indexing::welded; }
  void begin(const MeshHeader&) override {}
  void write(const MeshChunk& chunk) override;
  void finish() override;
  std::uint64_t bytes() const override { return out_.size(); }
  /// The tiles before the part wait for its first.
  std::uint64_t memory() const override;

  /// What the piece ends with; after finish().
  const PieceEnd& end() const { return end_; }

 private:
  template <class T>
  void append(std::span<const T> items);
  void write_neighbours();
  std::optional<TilePlace> take_place();

  FileWriter& out_;
  TileRange tiles_;
  Int3 extent_;
  bool has_normals_;
  PieceEnd end_;
  bool has_neighbours_ = false;   ///< are written
  std::mutex mutex_;              ///< of `places_`
  std::deque<TilePlace> places_;  ///< of tiles that are not written
};

}  // namespace isobrick
