#include "tools/input.h"

#include <fmt/format.h>

#include "tools/interrupt.h"
#include "tools/open_store.h"

namespace isobrick::tools {
namespace {

/// "none" or a folder.
std::filesystem::path parse_cache(const std::string& text) {
  return text == "none" ? std::filesystem::path() : std::filesystem::path(text);
}

/// "none" or a number of bytes.
std::uint64_t parse_remote_cache(const std::string& text) {
  return text == "none" ? 0 : parse_bytes(text);
}

}  // namespace

void add_volume_options(CLI::App* app, VolumeRequest& volume) {
  add_dims(app, volume.extent);
  add_type(app, volume.type);
  add_parsed(app, volume.order, parse_byte_order,
             {"--endian", "little|big", "Byte order of the samples of a raw file", "little"});
  add_parsed(app, volume.offset, parse_offset,
             {"--offset", "BYTES", "Bytes before the first sample of a raw file", "0"});
  add_parsed(app, volume.spacing, parse_vector,
             {"--spacing", "X,Y,Z", "World distance between samples", "the file's, or 1,1,1"});
  add_parsed(app, volume.origin, parse_vector,
             {"--origin", "X,Y,Z", "World position of the first sample", "the file's, or 0,0,0"});
  add_parsed(app, volume.unit, [](const std::string& text) { return text; },
             {"--unit", "NAME", "Unit of world space, such as mm or micrometer"});
  add_selection(app, volume.selection);
  add_parsed(app, volume.grid, [](const std::string& text) { return text; },
             {"--grid", "NAME", "Which grid of an OpenVDB file that has several"});
  add_parsed(app, volume.bounds, parse_roi,
             {"--bounds", "X0:X1,Y0:Y1,Z0:Z1",
              "Box of an OpenVDB grid in its own coordinates, such as --bounds=-8:8,:,:",
              "its active voxels"});
  add_parsed(app, volume.stride, parse_stride,
             {"--stride", "N|X,Y,Z", "Take every so-many-th sample", "1"});
  add_parsed(app, volume.nodata, parse_number,
             {"--nodata", "V", "Samples of this value are missing: no surface touches them"});
}

void add_remote_cache(CLI::App* app, CacheOptions& cache, const std::string& description) {
  cache.folder = default_cache_folder();
  add_parsed(app, cache.folder, parse_cache,
             {"--cache", "DIR|none", description, "~/.cache/isobrick"});
  add_parsed(app, cache.remote_limit, parse_remote_cache,
             {"--remote-cache", "BYTES|none",
              "Bytes of stores behind URLs that are kept in the folder of --cache", "none"});
}

RemoteOptions remote_options(const CacheOptions& cache, Console& console) {
  RemoteOptions options;
  options.cache_folder = cache.folder;
  options.cache_limit = cache.remote_limit;
  options.on_note = [&console](const std::string& note) { console.note(note); };
  return options;
}

void add_input(CLI::App* app, InputArguments& input, bool required) {
  add_text(app,
           {"INPUT", "",
            "Volume to read: a store, another program's Zarr, a zip of either, the URL of any of "
            "these (https:// or s3://), a file of a known format, FILE:/NAME for an array in it, "
            "or a folder of slices",
            "", required},
           [&path = input.path](const std::string& text) { path = text; });
  add_volume_options(app, input.volume);
  add_remote_cache(app, input.cache,
                   "Where stores of inputs that are none are kept; none: they go with the command");
  add_parsed(app, input.cache.limit, parse_bytes,
             {"--cache-limit", "BYTES", "Bytes of all stores that are kept", "20G"});
}

std::shared_ptr<const Storage> open_input_storage(const InputArguments& input, Console& console) {
  return open_storage(input.path, remote_options(input.cache, console));
}

OpenedVolume open_input(const InputArguments& input, std::uint64_t memory, int threads,
                        Console& console, bool needs_ranges,
                        std::optional<Downsampling> downsampling) {
  check_input(input.path);
  if (!input.cache.folder.empty())
    set_interrupt_note([] { return "the same command goes on with what is done"; });
  OpenedVolume opened = [&] {
    try {
      return OpenedVolume(input.path,
                          {.volume = input.volume,
                           .cache = input.cache,
                           .needs_ranges = needs_ranges,
                           .downsampling = downsampling,
                           .memory = memory,
                           .threads = threads,
                           .on_note = [&](const std::string& note) { console.note(note); }},
                          console.progress());
    } catch (const UsageError&) {
      refuse_folder_of_zarr(input.path);
      throw;
    }
  }();
  set_interrupt_note({});
  return opened;
}

}  // namespace isobrick::tools
