#include "pipeline/index/part_ranges_file.h"

#include <algorithm>
#include <type_traits>

#include "bricks/zarr/codec.h"

namespace isobrick::inline v0 {
namespace {

static_assert(std::is_trivially_copyable_v<PartRangesEnd> && sizeof(PartRangesEnd) % 8 == 0);
static_assert(std::is_trivially_copyable_v<PartRecord> && sizeof(PartRecord) % 8 == 0);

std::span<const std::byte> bytes_before_checksum(const PartRangesEnd& end) {
  return std::as_bytes(std::span(&end, 1)).first(sizeof end - sizeof end.own_crc32c);
}

/// Whether a record's items are some of its level, and its bytes theirs, which end before `end`.
bool is_possible(const PartRecord& record, std::span<const LevelInfo> levels, std::uint64_t end) {
  using Kind = PartRecord::Kind;
  if (record.level < 0 || static_cast<std::size_t>(record.level) >= levels.size()) return false;
  const Lattice& lattice = levels[static_cast<std::size_t>(record.level)].lattice;
  const Box3 all{{0, 0, 0}, record.kind == Kind::blocks ? lattice.blocks() : lattice.bricks()};
  if (record.items.empty() || intersect(record.items, all) != record.items) return false;
  const std::uint64_t item =
      record.kind == Kind::checksums ? sizeof(std::uint32_t) : 2 * lattice.sample_bytes();
  return record.kind <= Kind::checksums && record.items.extent().z == 1 &&
         record.bytes == static_cast<std::uint64_t>(volume(record.items.extent())) * item &&
         record.bytes <= end && record.offset <= end - record.bytes;
}

}  // namespace

PartRangesWriter::PartRangesWriter(const std::filesystem::path& path, Part part,
                                   std::uint32_t state)
    : out_(path.string(), true) {
  end_.part = part;
  end_.state = state;
}

void PartRangesWriter::write(std::span<const std::byte> bytes) {
  end_.content_crc32c = crc32c(bytes, end_.content_crc32c);
  out_.writer().append(bytes);
}

void PartRangesWriter::append(PartRecord record, std::span<const std::byte> bytes) {
  record.offset = out_.writer().size();
  record.bytes = bytes.size();
  records_.push_back(record);
  write(bytes);
}

void PartRangesWriter::finish(const SampleCounts& counts, bool has_nan) {
  end_.bins = counts.bins;
  end_.counts_offset = out_.writer().size();
  write(std::as_bytes(std::span(counts.counts)));
  end_.records = records_.size();
  write(std::as_bytes(std::span(records_)));
  end_.has_nan = has_nan ? 1 : 0;
  end_.bytes = out_.writer().size() + sizeof end_;
  end_.own_crc32c = crc32c(bytes_before_checksum(end_));
  out_.writer().append(std::as_bytes(std::span(&end_, 1)));
  out_.publish();
}

std::optional<PartRangesReader> PartRangesReader::open(const std::filesystem::path& path, Part part,
                                                       std::uint32_t state,
                                                       std::span<const LevelInfo> levels,
                                                       bool verify) {
  File file = open_if_exists(path);
  PartRangesEnd end;
  if (!file || file.size() < sizeof end) return std::nullopt;
  const std::uint64_t size = file.size();
  file.read_at(size - sizeof end, std::as_writable_bytes(std::span(&end, 1)));
  const bool is_ours = end.magic == PartRangesEnd::kMagic && end.bytes == size &&
                       end.own_crc32c == crc32c(bytes_before_checksum(end)) && end.part == part &&
                       end.state == state;
  if (!is_ours) return std::nullopt;
  PartRangesReader reader(std::move(file), end);
  if (!reader.read_records(levels) || (verify && !reader.is_whole())) return std::nullopt;
  return reader;
}

/// Whether they fit the file and the store.
bool PartRangesReader::read_records(std::span<const LevelInfo> levels) {
  const std::uint64_t content = end_.bytes - sizeof end_;
  if (end_.bins.count < 0 || end_.bins.count > kMaxHistogramBins) return false;
  const auto counts = static_cast<std::uint64_t>(end_.bins.count) * sizeof(std::uint64_t);
  if (end_.records > content / sizeof(PartRecord)) return false;
  const std::uint64_t records = end_.records * sizeof(PartRecord);
  if (counts + records > content || end_.counts_offset != content - counts - records) return false;
  records_.resize(static_cast<std::size_t>(end_.records));
  file_.read_at(content - records, std::as_writable_bytes(std::span(records_)));
  return std::all_of(records_.begin(), records_.end(), [&](const PartRecord& record) {
    return is_possible(record, levels, end_.counts_offset);
  });
}

bool PartRangesReader::is_whole() const {
  constexpr std::uint64_t step = std::uint64_t{1} << 20;
  const std::uint64_t content = end_.bytes - sizeof end_;
  std::uint32_t crc = 0;
  std::vector<std::byte> bytes;
  for (std::uint64_t at = 0; at < content; at += step) {
    bytes.resize(static_cast<std::size_t>(std::min(step, content - at)));
    file_.read_at(at, bytes);
    crc = crc32c(bytes, crc);
  }
  return crc == end_.content_crc32c;
}

std::vector<std::byte> PartRangesReader::read(const PartRecord& record) const {
  std::vector<std::byte> bytes(static_cast<std::size_t>(record.bytes));
  file_.read_at(record.offset, bytes);
  return bytes;
}

SampleCounts PartRangesReader::counts() const {
  SampleCounts all{end_.bins,
                   std::vector<std::uint64_t>(static_cast<std::size_t>(end_.bins.count))};
  file_.read_at(end_.counts_offset, std::as_writable_bytes(std::span(all.counts)));
  return all;
}

}  // namespace isobrick
