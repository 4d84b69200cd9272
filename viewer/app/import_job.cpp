#include "viewer/app/import_job.h"

#include <exception>
#include <utility>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/file_error.h"
#include "core/shell_word.h"
#include "io/meshes/mesh_name.h"
#include "io/volumes/open/volume_format.h"
#include "pipeline/index/add_ranges.h"

namespace isobrick::inline v0 {

namespace fs = std::filesystem;

/// Reports progress to the window, and throws when the window cancels.
class ImportJob::Reporter final : public Progress {
 public:
  explicit Reporter(ImportJob& job) : job_(job) {}

  void begin(std::string_view stage, std::uint64_t total) override {
    job_.begun_ = true;
    check();
    const MutexLock lock(job_.mutex_);
    job_.state_.stage = stage;
    job_.state_.done = 0;
    job_.state_.total = total;
  }
  void advance(std::uint64_t done) override {
    check();
    const MutexLock lock(job_.mutex_);
    job_.state_.done += done;
  }
  void end() override {}

 private:
  void check() const {
    if (job_.cancel_) throw Cancelled("cancelled");
  }
  ImportJob& job_;
};

ImportJob::ImportJob(fs::path input, OpenOptions options)
    : input_(std::move(input)), options_(std::move(options)) {
  options_.on_note = [this](const std::string& note) { add_note(note); };
  thread_ = std::thread([this] { run(); });
}

ImportJob::ImportJob(fs::path image, const Selection& volume, OpenOptions options)
    : input_(std::move(image)), options_(std::move(options)), volume_(volume) {
  thread_ = std::thread([this] { run(); });
}

ImportJob::~ImportJob() {
  cancel();
  thread_.join();
}

void ImportJob::add_note(std::string note) {
  const MutexLock lock(mutex_);
  state_.notes.push_back(std::move(note));
}

/// Opens the first volume of a file with several.
void ImportJob::open_first(Progress& progress) {
  const std::string input = input_.string();
  std::exception_ptr why;
  for (const Selection& selection :
       {Selection{}, Selection{.channel = 0, .time = {}}, Selection{.channel = {}, .time = 0},
        Selection{.channel = 0, .time = 0}}) {
    options_.volume.selection = selection;
    try {
      auto opened = std::make_unique<OpenedVolume>(input, options_, progress);
      if (selection.channel || selection.time)
        add_note(
            fmt::format("'{}' has several volumes; this is the first (others: isobrick view{}{})",
                        input_.filename().string(), selection.channel ? " --channel" : "",
                        selection.time ? " --time" : ""));
      const MutexLock lock(mutex_);
      opened_ = std::move(opened);
      return;
    } catch (const UsageError&) {
      if (begun_) throw;
      if (!why) why = std::current_exception();
    }
  }
  std::rethrow_exception(why);
}

void ImportJob::open(Progress& progress) {
  const std::string input = input_.string();
  if (has_mesh_name(input_)) {
    fs::path picture = input_;
    throw Error(fmt::format("'{}' is a mesh, no volume; draw it: isobrick render {} -o {}", input,
                            shell_word(input),
                            shell_word(picture.replace_extension(".png").string())));
  }
  // A folder of slices has no format.
  if (fs::is_regular_file(input_) && recognise_format(input) == VolumeFormat::vdb)
    options_.volume.grid = grid_to_show(read_vdb_header(input));
  if (options_.volume.grid)
    add_note(fmt::format("'{}' has several grids; this is '{}' (others: isobrick view --grid)",
                         input_.filename().string(), *options_.volume.grid));
  open_first(progress);
}

void ImportJob::add_ranges(Progress& progress) {
  add_missing_ranges(input_, *volume_, options_.memory, options_.threads, progress);
  add_note(fmt::format("the ranges of the samples were computed; they are in '{}'",
                       (input_ / "isobrick").string()));
}

void ImportJob::run() {
  std::string failure;
  bool cancelled = false;
  try {
    Reporter reporter(*this);
    if (volume_)
      add_ranges(reporter);
    else
      open(reporter);
  } catch (const Cancelled&) {
    cancelled = true;
  } catch (const std::exception& e) {
    failure = error_message(e);
  }
  const MutexLock lock(mutex_);
  state_.finished = true;
  state_.cancelled = cancelled;
  state_.failure = std::move(failure);
}

ImportJob::State ImportJob::state() const {
  const MutexLock lock(mutex_);
  return state_;
}

std::unique_ptr<OpenedVolume> ImportJob::take() {
  const MutexLock lock(mutex_);
  return std::move(opened_);
}

std::optional<std::string> grid_to_show(const std::vector<VdbGrid>& grids) {
  const VdbGrid* first = nullptr;
  int readable = 0;
  for (const VdbGrid& grid : grids) {
    if (!is_readable(grid)) continue;
    ++readable;
    if (first == nullptr || (grid.value_type() == "float" && first->value_type() != "float"))
      first = &grid;
  }
  return readable > 1 ? std::optional(first->name) : std::nullopt;
}

}  // namespace isobrick
