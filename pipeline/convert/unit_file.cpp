#include "pipeline/convert/unit_file.h"

#include <algorithm>
#include <type_traits>

#include <isobrick/error.h>
#include "bricks/zarr/codec.h"

namespace isobrick::inline v0 {
namespace {

static_assert(std::is_trivially_copyable_v<UnitEnd> && sizeof(UnitEnd) % 8 == 0);

std::span<const std::byte> checked_bytes(const UnitEnd& end) {
  return std::as_bytes(std::span(&end, 1)).first(sizeof end - sizeof end.own_crc32c);
}

}  // namespace

UnitWriter::UnitWriter(const std::filesystem::path& path, std::uint32_t layout_crc32c, Box3 box)
    : out_(path.string(), true) {
  end_.layout_crc32c = layout_crc32c;
  end_.box = box;
}

void UnitWriter::append(std::span<const std::byte> bytes) {
  end_.content_crc32c = crc32c(bytes, end_.content_crc32c);
  out_.writer().append(bytes);
}

void UnitWriter::append_coarse(std::span<const std::byte> samples) {
  append(samples);
  end_.coarse_bytes += samples.size();
}

void UnitWriter::finish(const UnitContent& content) {
  append(content.block_ranges);
  append(content.brick_ranges);
  append(std::as_bytes(std::span(content.counts.counts)));
  append(std::as_bytes(std::span(content.has_bricks)));
  end_.block_bytes = content.block_ranges.size();
  end_.brick_bytes = content.brick_ranges.size();
  end_.shards = content.has_bricks.size();
  end_.bins = content.counts.bins;
  end_.has_nan = content.has_nan ? 1 : 0;
  end_.samples_crc32c = content.samples_crc32c;
  end_.bricks = content.bricks;
  end_.absent = content.absent;
  end_.bytes = out_.writer().size() + sizeof end_;
  end_.own_crc32c = crc32c(checked_bytes(end_));
  out_.writer().append(std::as_bytes(std::span(&end_, 1)));
  out_.publish();
}

std::optional<UnitReader> UnitReader::open(const std::filesystem::path& path,
                                           std::uint32_t layout_crc32c, Box3 box, bool verify) {
  File file = open_if_exists(path);
  UnitEnd end;
  if (!file || file.size() < sizeof end) return std::nullopt;
  const std::uint64_t size = file.size();
  file.read_at(size - sizeof end, std::as_writable_bytes(std::span(&end, 1)));
  const bool is_ours = end.magic == UnitEnd::kMagic && end.bytes == size &&
                       end.own_crc32c == crc32c(checked_bytes(end)) &&
                       end.layout_crc32c == layout_crc32c && end.box == box;
  if (!is_ours) return std::nullopt;
  UnitReader reader(std::move(file), end);
  if (verify && !reader.is_whole()) return std::nullopt;
  return reader;
}

bool UnitReader::is_whole() const {
  constexpr std::uint64_t step = std::uint64_t{1} << 20;
  const std::uint64_t content = end_.bytes - sizeof end_;
  std::uint32_t crc = 0;
  for (std::uint64_t at = 0; at < content; at += step)
    crc = crc32c(read(at, std::min(step, content - at)), crc);
  return crc == end_.content_crc32c;
}

std::vector<std::byte> UnitReader::read(std::uint64_t offset, std::uint64_t size) const {
  std::vector<std::byte> bytes(size);
  file_.read_at(offset, bytes);
  return bytes;
}

std::vector<std::byte> UnitReader::block_ranges() const {
  return read(end_.coarse_bytes, end_.block_bytes);
}

std::vector<std::byte> UnitReader::brick_ranges() const {
  return read(end_.coarse_bytes + end_.block_bytes, end_.brick_bytes);
}

std::vector<std::uint8_t> UnitReader::has_bricks() const {
  std::vector<std::uint8_t> all(end_.shards);
  file_.read_at(end_.bytes - sizeof end_ - end_.shards, std::as_writable_bytes(std::span(all)));
  return all;
}

SampleCounts UnitReader::counts() const {
  SampleCounts all{end_.bins,
                   std::vector<std::uint64_t>(static_cast<std::size_t>(end_.bins.count))};
  file_.read_at(end_.coarse_bytes + end_.block_bytes + end_.brick_bytes,
                std::as_writable_bytes(std::span(all.counts)));
  return all;
}

}  // namespace isobrick
