#include "tools/codec_report.h"

#include <fmt/format.h>

#include <isobrick/storage.h>
#include "bricks/zarr/metadata_files.h"
#include "core/shell_word.h"

namespace isobrick::tools {
namespace {

double ratio(const CodecSample& sample) {
  return static_cast<double>(sample.packed_bytes) / static_cast<double>(sample.zstd_bytes);
}

/// How many times as fast packed decodes; 0 where no time was measured.
double speed(const CodecSample& sample) {
  return sample.packed_seconds > 0 ? sample.zstd_seconds / sample.packed_seconds : 0;
}

std::string speed_text(const CodecSample& sample) {
  return speed(sample) > 0 ? fmt::format(" and decodes {:.2g} times as fast", speed(sample)) : "";
}

/// The command that writes a store, or an image of another program, by another codec.
std::string command(const StoreReader& store, const std::string& input, const char* codec) {
  // Zarr version 2 has no packed bricks; a conversion makes version 3 of it.
  const bool is_v3 = store.storage()->open("zarr.json") != nullptr;
  const bool recode = store.info().ours && is_v3 && is_zarr(input);
  return fmt::format("isobrick {} {} {}.zarr --codec {}", recode ? "recode" : "convert",
                     shell_word(input), codec, codec);
}

}  // namespace

nlohmann::ordered_json codec_sample_json(const std::optional<CodecSample>& sample) {
  if (!sample) return nullptr;
  return {{"bricks", sample->bricks},
          {"bytes", sample->bytes},
          {"zstd_bytes", sample->zstd_bytes},
          {"packed_bytes", sample->packed_bytes},
          {"zstd_decode_seconds", sample->zstd_seconds},
          {"packed_decode_seconds", sample->packed_seconds}};
}

std::string codec_sample_text(const CodecSample& sample) {
  if (sample.bricks == 0) return "no brick was found that is stored";
  return fmt::format("in {} brick{} packed takes {:.2f} of the bytes of zstd{}", sample.bricks,
                     sample.bricks == 1 ? "" : "s", ratio(sample), speed_text(sample));
}

std::string codec_advice(const StoreReader& store, const std::string& input,
                         const CodecSample& sample) {
  if (sample.bricks == 0) return codec_sample_text(sample);
  const bool is_packed = store.info().codec == "packed";
  // What takes more bytes must be faster.
  const bool packed_suits = ratio(sample) <= (speed(sample) >= 1 ? kMaxPackedFactor : 1);
  if (is_packed == packed_suits) return codec_sample_text(sample);
  return fmt::format("{}: {}", codec_sample_text(sample),
                     command(store, input, packed_suits ? "packed" : "zstd"));
}

}  // namespace isobrick::tools
