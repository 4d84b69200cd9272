#include "bricks/ranges/stored_histogram.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include <isobrick/error.h>
#include "bricks/ranges/range_format.h"
#include "bricks/storage/storage_keys.h"
#include "bricks/zarr/array_metadata.h"
#include "bricks/zarr/json_reader.h"
#include "bricks/zarr/store_names.h"

namespace isobrick::inline v0 {
namespace {

constexpr int kZstdLevel = 3;

/// An array without elements is none: where no sample is finite, it has a bin without samples.
ArrayMetadata array_of(Index bins) {
  ArrayMetadata array;
  array.shape = array.chunk = {std::max<Index>(bins, 1)};
  array.type = ScalarType::u64;
  array.codecs = CodecChain::ours(kZstdLevel);
  array.dimension_names = {"bin"};
  return array;
}

/// Below the array's folder.
std::string chunk_name(const ArrayMetadata& array) {
  return array.chunk_key(std::vector<Index>{0});
}

std::uint64_t sum_of(const SampleCounts& read) {
  return std::accumulate(read.counts.begin(), read.counts.end(),
                         read.bins.not_a_number + read.bins.infinite);
}

}  // namespace

std::string histogram_folder(const std::string& additions) {
  return level_addition(additions, 0, "histogram");
}

StoredHistogram write_histogram(const std::filesystem::path& folder, const SampleCounts& counts,
                                Publisher& publisher) {
  const ArrayMetadata array = array_of(counts.bins.count);
  std::vector<std::uint64_t> values = counts.counts;
  values.resize(static_cast<std::size_t>(array.shape.front()));
  const std::vector<std::byte> encoded =
      encode_bytes(array.codecs, std::as_bytes(std::span(values)));
  publisher.write(folder / chunk_name(array), encoded);
  publisher.write(folder / "zarr.json", to_json(array));
  return {counts.bins, last_checksum(encoded)};
}

SampleCounts read_histogram(const Storage& storage, const std::string& folder,
                            const StoredHistogram& stored, std::uint64_t samples) {
  const std::string metadata = join_key(folder, "zarr.json"), where = quoted(storage, metadata);
  const auto text = read_small_object(storage, metadata, kMaxMetadataBytes);
  if (!text) throw DamageError(where + " is missing");
  const ArrayMetadata expected = array_of(stored.bins.count);
  const ArrayMetadata array = parse_array_metadata(*text, where);
  if (array.shape != expected.shape || array.chunk != expected.chunk ||
      array.type != expected.type || array.sharding)
    throw DamageError(where + ": is not the array of the store's histogram");
  const std::string key = join_key(folder, chunk_name(array)), file = quoted(storage, key);
  std::vector<std::uint64_t> values(static_cast<std::size_t>(array.shape.front()));
  const auto decoded = std::as_writable_bytes(std::span(values));
  const auto content = read_small_object(storage, key, 2 * decoded.size() + 1024);
  if (!content) throw DamageError(file + " is missing");
  const auto encoded = std::as_bytes(std::span(*content));
  try {
    decode_bytes(array.codecs, sizeof(std::uint64_t), encoded, decoded);
  } catch (const DamageError& e) {
    throw DamageError(file + ": " + e.what());
  }
  if (last_checksum(encoded) != stored.crc32c)
    throw DamageError(file + " is the histogram of another store");
  values.resize(static_cast<std::size_t>(stored.bins.count));
  SampleCounts read{stored.bins, std::move(values)};
  if (const std::uint64_t sum = sum_of(read); sum != samples)
    throw DamageError(
        fmt::format("{} counts {} samples, not the {} that there are", file, sum, samples));
  return read;
}

}  // namespace isobrick
