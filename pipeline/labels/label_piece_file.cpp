#include "pipeline/labels/label_piece_file.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include <isobrick/error.h>
#include "bricks/zarr/codec.h"
#include "pipeline/labels/label_record.h"
#include "pipeline/labels/label_spool.h"

namespace isobrick::inline v0 {
namespace {

/// Whether no quad names a vertex that is not there.
bool names_its_vertices(const LabelRecord& record, std::span<const std::byte> items) {
  const std::uint64_t vertices = std::uint64_t{record.vertices} + record.foreign;
  std::span<const std::byte> quads = items.last(record.quads * sizeof(LabelQuad));
  for (; !quads.empty(); quads = quads.subspan(sizeof(LabelQuad))) {
    LabelQuad quad;
    std::memcpy(&quad, quads.data(), sizeof quad);
    if (std::any_of(quad.begin(), quad.end(), [&](std::uint32_t v) { return v >= vertices; }))
      return false;
  }
  return true;
}

}  // namespace

LabelPieceWriter::LabelPieceWriter(FileWriter& out, const LabelPieceDescription& description)
    : out_(out) {
  const std::string text = to_text(description);
  if (text.size() > PieceStart::kMaxHeader)
    throw UsageError("the names of the labels take more than a piece holds: make all in one");
  const PieceStart start{.magic = PieceStart::kLabelsMagic,
                         .header_bytes = static_cast<std::uint32_t>(text.size())};
  write(std::as_bytes(std::span(&start, 1)));
  write(std::as_bytes(std::span(text)));
}

void LabelPieceWriter::write(std::span<const std::byte> bytes) {
  end_.content_crc32c = crc32c(bytes, end_.content_crc32c);
  out_.append(bytes);
}

void LabelPieceWriter::append(std::span<const std::byte> packed) {
  write(packed);
  while (!packed.empty()) {
    LabelRecord record;
    std::memcpy(&record, packed.data(), sizeof record);
    const std::uint64_t bytes = sizeof record + record.item_bytes();
    packed = packed.subspan(bytes);
    ++end_.tiles;
    end_.vertices += record.vertices;
    end_.triangles += 2 * std::uint64_t{record.quads};
    end_.largest_tile = std::max(end_.largest_tile, bytes);
  }
}

const PieceEnd& LabelPieceWriter::finish() {
  end_.bytes = out_.size() + sizeof end_;
  const auto all = std::as_bytes(std::span(&end_, 1));
  end_.own_crc32c = crc32c(all.first(sizeof end_ - sizeof end_.own_crc32c));
  out_.append(all);
  return end_;
}

LabelPieceReader::LabelPieceReader(const std::filesystem::path& path)
    : input_(open_piece_file(path), PieceKind::labels) {
  std::optional<LabelPieceDescription> description = parse_label_description(input_.text());
  if (!description) fail("is damaged in its description");
  description_ = std::move(*description);
}

std::span<const std::byte> LabelPieceReader::next() {
  if (records_ == end().tiles) {
    if (vertices_ != end().vertices || triangles_ != end().triangles) fail("is damaged");
    input_.check_end();
    return {};
  }
  LabelRecord record;
  input_.read(std::span(&record, 1));
  const TileRange& tiles = description_.tiles;
  const std::uint64_t bytes = sizeof record + record.item_bytes();
  if (record.tile < std::max(tiles.begin, last_tile_) || record.tile >= tiles.end ||
      bytes > std::min(end().largest_tile, LabelSpool::max_packed_bytes()) ||
      record.item_bytes() > input_.left())
    fail("is damaged");
  record_.resize(bytes);
  std::memcpy(record_.data(), &record, sizeof record);
  const std::span<std::byte> items = std::span(record_).subspan(sizeof record);
  input_.read(items);
  if (!names_its_vertices(record, items)) fail("is damaged");
  ++records_;
  vertices_ += record.vertices;
  triangles_ += 2 * std::uint64_t{record.quads};
  last_tile_ = record.tile;
  return record_;
}

}  // namespace isobrick
