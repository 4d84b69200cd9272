#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <isobrick/convert.h>
#include <isobrick/selection.h>
#include <isobrick/volume_request.h>
#include "core/thread_annotations.h"
#include "io/volumes/vdb/vdb_header.h"

namespace isobrick {

/// Makes a volume ready to view, on a thread of its own: converts it, or adds ranges to an image.
/// The destructor cancels it and waits until no unfinished files are left.
class ImportJob {
 public:
  /// Converts `input`, a store or any format of open_source(), to `store`.
  ImportJob(std::filesystem::path input, std::filesystem::path store, ConvertOptions options);
  /// Adds the ranges that a volume of an image lacks, in place.
  ImportJob(std::filesystem::path image, const Selection& volume, ConvertOptions options);
  ~ImportJob();

  struct State {
    std::string stage;                  ///< description of the present step
    std::uint64_t done = 0, total = 0;  ///< bytes of the step; total 0: unknown
    bool finished = false;              ///< also after failure or cancellation
    std::string failure;                ///< empty after success or cancellation
    bool cancelled = false;
    std::vector<std::string> notes;  ///< messages about the input, as `convert` prints them
  };
  State state() const;
  void cancel() { cancel_ = true; }

  const std::filesystem::path& input() const { return input_; }
  const std::filesystem::path& store() const { return store_; }
  /// The volume whose ranges are added; nullopt for a conversion.
  const std::optional<Selection>& volume() const { return volume_; }

 private:
  class Reporter;
  void run();
  void convert_input(Progress& progress);
  void add_ranges(Progress& progress);
  void discard() const;
  std::unique_ptr<VolumeSource> open();
  std::unique_ptr<VolumeSource> open_first(VolumeRequest request);
  void add_note(std::string note);

  std::filesystem::path input_, store_;
  ConvertOptions options_;
  std::optional<Selection> volume_;
  mutable Mutex mutex_;
  State state_ ISOBRICK_GUARDED_BY(mutex_);
  std::atomic<bool> cancel_ = false;
  bool begun_ = false;  ///< the conversion has made its folder; for the thread only
  std::thread thread_;  ///< last member: it uses the others
};

/// Chooses the grid of a dropped OpenVDB file with several: the first of floats, else the first
/// that can be read.
std::optional<std::string> grid_to_show(const std::vector<VdbGrid>& grids);

/// The path of a dropped file's store, which does not exist yet: beside the file if its folder is
/// writable, else among temporary files.
std::filesystem::path store_for(const std::filesystem::path& input);

}  // namespace isobrick
