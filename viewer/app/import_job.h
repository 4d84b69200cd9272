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

/// A conversion, or what else makes a volume ready to be shown, in a thread of its own, for a
/// window that goes on meanwhile. The destructor cancels it and waits until nothing unfinished is
/// left.
class ImportJob {
 public:
  /// Converts `input` (any format that open_source or a store can be) to `store`.
  ImportJob(std::filesystem::path input, std::filesystem::path store, ConvertOptions options);
  /// Adds to an image, in its place, the ranges that a volume of it lacks.
  ImportJob(std::filesystem::path image, const Selection& volume, ConvertOptions options);
  ~ImportJob();

  struct State {
    std::string stage;                  ///< what goes on
    std::uint64_t done = 0, total = 0;  ///< bytes of the stage; total 0: unknown
    bool finished = false;              ///< well, cancelled or not
    std::string failure;                ///< empty when all went well or was cancelled
    bool cancelled = false;
    std::vector<std::string> notes;  ///< remarks about the input, as `convert` has them
  };
  State state() const;
  void cancel() { cancel_ = true; }

  const std::filesystem::path& input() const { return input_; }
  const std::filesystem::path& store() const { return store_; }
  /// Whose ranges are added; nothing of a conversion.
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
  bool begun_ = false;  ///< the conversion has a folder of its own; of the thread
  std::thread thread_;  ///< last: it uses the others
};

/// The grid of a dropped OpenVDB file, where somebody would have to choose: the first of
/// floats, else the first that can be read.
std::optional<std::string> grid_to_show(const std::vector<VdbGrid>& grids);

/// Where a dropped file's store goes: beside it if its folder can be written to, else
/// among temporary files; a name that is not taken.
std::filesystem::path store_for(const std::filesystem::path& input);

}  // namespace isobrick
