#include "pipeline/pieces/piece_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include <isobrick/error.h>
#include "bricks/zarr/codec.h"

namespace isobrick::inline v0 {
namespace {

/// Larger headers are none of ours.
constexpr std::uint32_t kMaxHeader = 1 << 20;
/// Read at once by those who pass over tiles.
constexpr std::uint64_t kSmallBuffer = 4096;

class PieceFile final : public PieceBytes {
 public:
  explicit PieceFile(const std::filesystem::path& path) : file_(open_input(path)) {}
  std::uint64_t size() const override { return file_.size(); }
  void read_at(std::uint64_t offset, std::span<std::byte> bytes) override {
    file_.read_at(offset, bytes);
  }
  std::string name() const override { return quoted(file_.path()); }

 private:
  File file_;
};

}  // namespace

std::unique_ptr<PieceBytes> open_piece_file(const std::filesystem::path& path) {
  return std::make_unique<PieceFile>(path);
}

PieceReader::PieceReader(std::shared_ptr<PieceBytes> piece) : piece_(std::move(piece)) {
  const std::uint64_t size = piece_->size();
  PieceStart start;
  if (size >= sizeof start) piece_->read_at(0, std::as_writable_bytes(std::span(&start, 1)));
  if (size > 0 && (size < sizeof start || start.magic != PieceStart::kMagic))
    throw UsageError(fmt::format("{} is no piece of a mesh; 'isobrick extract --part' makes them",
                                 piece_->name()));
  if (size > 0 && start.version != PieceStart::kVersion)
    throw UsageError(fmt::format("{} is a piece of version {}, and this isobrick knows version {}",
                                 piece_->name(), start.version, PieceStart::kVersion));
  if (size < sizeof start + sizeof end_ || start.header_bytes > kMaxHeader ||
      size - sizeof start - sizeof end_ < start.header_bytes)
    fail("is cut off");
  text_.resize(start.header_bytes);
  piece_->read_at(sizeof start, std::as_writable_bytes(std::span(text_)));
  piece_->read_at(size - sizeof end_, std::as_writable_bytes(std::span(&end_, 1)));
  const auto all = std::as_bytes(std::span(&end_, 1));
  if (end_.magic != PieceEnd::kMagic || end_.bytes != size ||
      end_.own_crc32c != crc32c(all.first(sizeof end_ - sizeof end_.own_crc32c)))
    fail("is cut off or changed at its end");
  std::optional<PieceDescription> header = parse_description(text_);
  if (!header) fail("is damaged in its description");
  header_ = std::move(*header);
  crc_ = crc32c(std::as_bytes(std::span(text_)), crc32c(std::as_bytes(std::span(&start, 1))));
  at_ = sizeof start + text_.size();
}

void PieceReader::fail(const std::string& what) const {
  throw DamageError(
      fmt::format("{} {}: make it again with the 'isobrick extract --part' that made it",
                  piece_->name(), what));
}

void PieceReader::read_bytes(std::span<std::byte> bytes) {
  if (bytes.size() > left()) fail("is damaged");
  const std::span<std::byte> all = bytes;
  while (!bytes.empty()) {
    if (begin_ == filled_) {
      if (bytes.size() >= kBuffer) {
        piece_->read_at(at_, bytes);
        at_ += bytes.size();
        break;
      }
      buffer_.resize(kBuffer);
      filled_ = std::min<std::uint64_t>(skips_ ? kSmallBuffer : kBuffer, left());
      piece_->read_at(at_, std::span(buffer_).first(filled_));
      begin_ = 0;
    }
    const std::size_t count = std::min(bytes.size(), filled_ - begin_);
    std::memcpy(bytes.data(), buffer_.data() + begin_, count);
    begin_ += count;
    at_ += count;
    bytes = bytes.subspan(count);
  }
  crc_ = crc32c(all, crc_);
}

std::vector<PieceTile> PieceReader::neighbours() {
  std::uint64_t count = 0;
  read(std::span(&count, 1));
  if (count != end_.neighbours || count > left() / sizeof(PieceTile)) fail("is damaged");
  std::vector<PieceTile> tiles(count);
  read(std::span(tiles));
  return tiles;
}

bool PieceReader::next(PieceTile& tile) {
  if (tiles_ == end_.tiles) {
    if (left() != 0 || vertices_ != end_.vertices || triangles_ != end_.triangles)
      fail("is damaged");
    if (!skips_ && crc_ != end_.content_crc32c) fail("is damaged: its checksum is another");
    return false;
  }
  read(std::span(&tile, 1));
  const bool is_next = tiles_ == 0 ? tile.code >= header_.tiles.begin : tile.code > last_code_;
  const std::uint64_t bytes = content_bytes(tile, header_.of_mesh.has_normals);
  if (!is_next || tile.code >= header_.tiles.end || tile.vertices > kMaxTileVertices ||
      tile.triangles > kMaxTileTriangles || bytes > end_.largest_tile || bytes > left())
    fail("is damaged");
  ++tiles_;
  vertices_ += tile.vertices;
  triangles_ += tile.triangles;
  last_code_ = tile.code;
  return true;
}

void PieceReader::skip(const PieceTile& tile) {
  const std::uint64_t bytes = content_bytes(tile, header_.of_mesh.has_normals);
  if (bytes > left()) fail("is damaged");
  at_ += bytes;
  begin_ += std::min<std::uint64_t>(bytes, filled_ - begin_);
  skips_ = true;
}

void PieceReader::verify() {
  std::vector<std::byte> part(kBuffer);
  while (left() > 0) read_bytes(std::span(part).first(std::min<std::uint64_t>(kBuffer, left())));
  if (crc_ != end_.content_crc32c) fail("is damaged: its checksum is another");
}

bool looks_like_piece(const std::filesystem::path& path) {
  const File file = open_input(path);
  const std::uint64_t size = file.size();
  if (size < sizeof(std::uint64_t)) return size == 0;
  std::uint64_t magic = 0;
  file.read_at(0, std::as_writable_bytes(std::span(&magic, 1)));
  return magic == PieceStart::kMagic;
}

}  // namespace isobrick
