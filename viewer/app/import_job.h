#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <isobrick/open_volume.h>
#include <isobrick/selection.h>
#include "core/thread_annotations.h"
#include "io/volumes/vdb/vdb_header.h"

namespace isobrick::inline v0 {

/// Makes a volume ready to view, on a thread of its own: opens it by way of the cache, or adds
/// ranges to an image. The destructor cancels it and waits for the thread.
class ImportJob {
 public:
  /// Opens `input`, any format of open_source(), as OpenedVolume does; of several volumes or grids
  /// the first. `options` needs neither a volume nor on_note.
  ImportJob(std::filesystem::path input, OpenOptions options);
  /// Adds the ranges that a volume of an image lacks, in place, with the options' memory and
  /// threads.
  ImportJob(std::filesystem::path image, const Selection& volume, OpenOptions options);
  ~ImportJob();

  struct State {
    std::string stage;                  ///< description of the present step
    std::uint64_t done = 0, total = 0;  ///< bytes of the step; total 0: unknown
    bool finished = false;              ///< also after failure or cancellation
    std::string failure;                ///< empty after success or cancellation
    bool cancelled = false;
    std::vector<std::string> notes;  ///< messages about the input, as `view INPUT` prints them
  };
  State state() const;
  /// What was opened, once; null before it has finished, after a failure, and of an image.
  std::unique_ptr<OpenedVolume> take();
  void cancel() { cancel_ = true; }

  const std::filesystem::path& input() const { return input_; }
  /// The volume of the image input() whose ranges are added; nullopt for a file that is opened.
  const std::optional<Selection>& volume() const { return volume_; }

 private:
  class Reporter;
  void run();
  void open(Progress& progress);
  void open_first(Progress& progress);
  void add_ranges(Progress& progress);
  void add_note(std::string note);

  std::filesystem::path input_;
  OpenOptions options_;  ///< for the thread only, as begun_
  std::optional<Selection> volume_;
  mutable Mutex mutex_;
  State state_ ISOBRICK_GUARDED_BY(mutex_);
  std::unique_ptr<OpenedVolume> opened_ ISOBRICK_GUARDED_BY(mutex_);
  std::atomic<bool> cancel_ = false;
  bool begun_ = false;  ///< the conversion has begun
  std::thread thread_;  ///< last member: it uses the others
};

/// Chooses the grid of a dropped OpenVDB file with several: the first of floats, else the first
/// that can be read.
std::optional<std::string> grid_to_show(const std::vector<VdbGrid>& grids);

}  // namespace isobrick
