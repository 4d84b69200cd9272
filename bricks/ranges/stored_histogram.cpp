#include "bricks/ranges/stored_histogram.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include <isobrick/error.h>
#include "bricks/ranges/range_format.h"
#include "bricks/zarr/array_metadata.h"
#include "bricks/zarr/json_reader.h"
#include "io/bytes/file.h"

namespace isobrick {
namespace {

constexpr int kZstdLevel = 3;

/// An array without elements is none: where no sample is finite, it has a bin without samples.
ArrayMetadata array_of(Index bins) {
  ArrayMetadata array;
  array.shape = array.chunk = {std::max<Index>(bins, 1)};
  array.wide = WideType::u64;
  array.type = widened(WideType::u64);
  array.codecs = CodecChain::ours(kZstdLevel);
  array.dimension_names = {"bin"};
  return array;
}

std::filesystem::path chunk_file(const std::filesystem::path& folder, const ArrayMetadata& array) {
  return folder / array.chunk_key(std::vector<Index>{0});
}

std::uint64_t sum_of(const SampleCounts& read) {
  return std::accumulate(read.counts.begin(), read.counts.end(),
                         read.bins.not_a_number + read.bins.infinite);
}

}  // namespace

std::filesystem::path histogram_folder(const std::filesystem::path& store) {
  return store / "isobrick" / "0" / "histogram";
}

StoredHistogram write_histogram(const std::filesystem::path& folder, const SampleCounts& counts,
                                Publisher& publisher) {
  const ArrayMetadata array = array_of(counts.bins.count);
  std::vector<std::uint64_t> values = counts.counts;
  values.resize(static_cast<std::size_t>(array.shape.front()));
  const std::vector<std::byte> encoded =
      encode_bytes(array.codecs, std::as_bytes(std::span(values)));
  publisher.write(chunk_file(folder, array), encoded);
  publisher.write(folder / "zarr.json", to_json(array));
  return {counts.bins, last_checksum(encoded)};
}

SampleCounts read_histogram(const std::filesystem::path& folder, const StoredHistogram& stored,
                            std::uint64_t samples) {
  const std::filesystem::path metadata = folder / "zarr.json";
  const auto text = read_small_file(metadata, kMaxMetadataBytes);
  if (!text) throw DamageError(quoted(metadata) + " is missing");
  const ArrayMetadata expected = array_of(stored.bins.count);
  const ArrayMetadata array = parse_array_metadata(*text, quoted(metadata));
  if (array.shape != expected.shape || array.chunk != expected.chunk ||
      array.wide != expected.wide || array.sharding)
    throw DamageError(quoted(metadata) + ": is not the array of the store's histogram");
  const std::filesystem::path file = chunk_file(folder, array);
  std::vector<std::uint64_t> values(static_cast<std::size_t>(array.shape.front()));
  const auto decoded = std::as_writable_bytes(std::span(values));
  const auto content = read_small_file(file, 2 * decoded.size() + 1024);
  if (!content) throw DamageError(quoted(file) + " is missing");
  const auto encoded = std::as_bytes(std::span(*content));
  try {
    decode_bytes(array.codecs, sizeof(std::uint64_t), encoded, decoded);
  } catch (const DamageError& e) {
    throw DamageError(quoted(file) + ": " + e.what());
  }
  if (last_checksum(encoded) != stored.crc32c)
    throw DamageError(quoted(file) + " is the histogram of another store");
  values.resize(static_cast<std::size_t>(stored.bins.count));
  SampleCounts read{stored.bins, std::move(values)};
  if (const std::uint64_t sum = sum_of(read); sum != samples)
    throw DamageError(
        fmt::format("{} counts {} samples, not the {} that there are", quoted(file), sum, samples));
  return read;
}

}  // namespace isobrick
