#include "pipeline/pieces/piece_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include <isobrick/error.h>
#include "bricks/zarr/codec.h"

namespace isobrick::inline v0 {
namespace {

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

std::optional<PieceKind> kind_of(std::uint64_t magic) {
  if (magic == PieceStart::kMagic) return PieceKind::surface;
  if (magic == PieceStart::kLabelsMagic) return PieceKind::labels;
  return std::nullopt;
}

const char* kind_text(PieceKind kind) {
  return kind == PieceKind::labels ? "labels" : "an isosurface";
}

/// Throws UsageError where a file of `size` bytes does not begin as such a piece does.
void check_start(const PieceBytes& piece, const PieceStart& start, std::uint64_t size,
                 PieceKind kind) {
  if (size == 0) return;
  const auto found = size < sizeof start ? std::nullopt : kind_of(start.magic);
  if (!found)
    throw UsageError(fmt::format("{} is no piece of a mesh; 'isobrick extract --part' makes them",
                                 piece.name()));
  if (*found != kind)
    throw UsageError(fmt::format("{} is a piece of {}, and not of {}", piece.name(),
                                 kind_text(*found), kind_text(kind)));
  if (start.version != PieceStart::kVersion)
    throw UsageError(fmt::format("{} is a piece of version {}, and this isobrick knows version {}",
                                 piece.name(), start.version, PieceStart::kVersion));
}

}  // namespace

std::unique_ptr<PieceBytes> open_piece_file(const std::filesystem::path& path) {
  return std::make_unique<PieceFile>(path);
}

PieceInput::PieceInput(std::shared_ptr<PieceBytes> piece, PieceKind kind)
    : piece_(std::move(piece)) {
  const std::uint64_t size = piece_->size();
  PieceStart start;
  if (size >= sizeof start) piece_->read_at(0, std::as_writable_bytes(std::span(&start, 1)));
  check_start(*piece_, start, size, kind);
  if (size < sizeof start + sizeof end_ || start.header_bytes > PieceStart::kMaxHeader ||
      size - sizeof start - sizeof end_ < start.header_bytes)
    fail("is cut off");
  text_.resize(start.header_bytes);
  piece_->read_at(sizeof start, std::as_writable_bytes(std::span(text_)));
  piece_->read_at(size - sizeof end_, std::as_writable_bytes(std::span(&end_, 1)));
  const auto all = std::as_bytes(std::span(&end_, 1));
  if (end_.magic != PieceEnd::kMagic || end_.bytes != size ||
      end_.own_crc32c != crc32c(all.first(sizeof end_ - sizeof end_.own_crc32c)))
    fail("is cut off or changed at its end");
  crc_ = crc32c(std::as_bytes(std::span(text_)), crc32c(std::as_bytes(std::span(&start, 1))));
  at_ = sizeof start + text_.size();
}

void PieceInput::fail(const std::string& what) const {
  throw DamageError(
      fmt::format("{} {}: make it again with the 'isobrick extract --part' that made it",
                  piece_->name(), what));
}

void PieceInput::read_bytes(std::span<std::byte> bytes) {
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

void PieceInput::skip(std::uint64_t bytes) {
  if (bytes > left()) fail("is damaged");
  at_ += bytes;
  begin_ += std::min<std::uint64_t>(bytes, filled_ - begin_);
  skips_ = true;
}

void PieceInput::check_end() const {
  if (left() != 0) fail("is damaged");
  if (!skips_ && crc_ != end_.content_crc32c) fail("is damaged: its checksum is another");
}

void PieceInput::verify() {
  std::vector<std::byte> part(kBuffer);
  while (left() > 0) read_bytes(std::span(part).first(std::min<std::uint64_t>(kBuffer, left())));
  check_end();
}

void check_piece_name(const std::filesystem::path& path) {
  if (path.native() == kStandardOutput)
    throw UsageError(
        "a piece has a name, by which it is found again: it cannot go to standard output");
}

std::optional<PieceKind> find_piece_kind(const std::filesystem::path& path) {
  const File file = open_input(path);
  std::uint64_t magic = 0;
  if (file.size() < sizeof magic) return std::nullopt;
  file.read_at(0, std::as_writable_bytes(std::span(&magic, 1)));
  return kind_of(magic);
}

std::optional<PieceEnd> find_piece(const std::filesystem::path& path, PieceKind kind,
                                   const std::string& text, bool force) {
  std::error_code none;
  if (!std::filesystem::exists(path, none)) return std::nullopt;
  check_output(path.string(), true);  // a folder or a device
  if (std::filesystem::file_size(path) > 0 && !find_piece_kind(path)) {
    check_output(path.string(), force);
    return std::nullopt;
  }
  try {
    PieceInput piece(open_piece_file(path), kind);
    if (piece.text() != text) return std::nullopt;
    piece.verify();
    return piece.end();
  } catch (const DamageError&) {
    return std::nullopt;
  } catch (const UsageError&) {  // of another version or kind
    return std::nullopt;
  }
}

}  // namespace isobrick
