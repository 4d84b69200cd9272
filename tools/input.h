#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <isobrick/open_volume.h>
#include <isobrick/storage.h>
#include "tools/options.h"

namespace isobrick::tools {

/// A volume that a command reads: a store, or whatever open_source() opens.
struct InputArguments {
  std::string path;
  VolumeRequest volume;
  CacheOptions cache;
};

/// The positional INPUT and what describes it. Without `required` it may be left out.
void add_input(CLI::App* app, InputArguments& input, bool required = true);
/// The options of it alone: those of raw samples, of the place in the world, and of the choice
/// among several volumes.
void add_volume_options(CLI::App* app, VolumeRequest& volume);

/// The options of the cache for what lies behind URLs; `description` says what its folder is for.
void add_remote_cache(CLI::App* app, CacheOptions& cache, const std::string& description);

/// How a URL is read by the options above. `console` must live as long as what is read.
RemoteOptions remote_options(const CacheOptions& cache, Console& console);

/// Opens the storage of an input that is a store or Zarr, with the cache for remote ones. `console`
/// must live as long as the storage.
std::shared_ptr<const Storage> open_input_storage(const InputArguments& input, Console& console);

/// Opens the input as a store, by way of the cache where it is none, and writes what it notes.
/// `downsampling` is that of a conversion.
/// Throws Error and UsageError with what to type instead where it is no volume.
OpenedVolume open_input(const InputArguments& input, std::uint64_t memory, int threads,
                        Console& console, bool needs_ranges = true,
                        std::optional<Downsampling> downsampling = {});

}  // namespace isobrick::tools
