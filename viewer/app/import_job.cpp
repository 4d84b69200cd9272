#include "viewer/app/import_job.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "bricks/zarr/metadata_files.h"
#include "core/file_error.h"
#include "core/shell_word.h"
#include "io/bytes/file.h"
#include "io/meshes/mesh_name.h"
#include "io/volumes/open/volume_format.h"
#include "pipeline/convert/convert_staging.h"
#include "pipeline/convert/store_source.h"
#include "pipeline/index/add_ranges.h"

namespace isobrick {

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

ImportJob::ImportJob(fs::path input, fs::path store, ConvertOptions options)
    : input_(std::move(input)), store_(std::move(store)), options_(options) {
  thread_ = std::thread([this] { run(); });
}

ImportJob::ImportJob(fs::path image, const Selection& volume, ConvertOptions options)
    : input_(image), store_(std::move(image)), options_(options), volume_(volume) {
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
std::unique_ptr<VolumeSource> ImportJob::open_first(VolumeRequest request) {
  const std::string input = input_.string();
  std::exception_ptr why;
  for (const Selection& selection :
       {Selection{}, Selection{.channel = 0, .time = {}}, Selection{.channel = {}, .time = 0},
        Selection{.channel = 0, .time = 0}}) {
    request.selection = selection;
    try {
      auto source = open_any_source(input, request);
      if (selection.channel || selection.time)
        add_note(fmt::format(
            "'{}' has several volumes; this is the first (others: isobrick convert{}{})",
            input_.filename().string(), selection.channel ? " --channel" : "",
            selection.time ? " --time" : ""));
      return source;
    } catch (const UsageError&) {
      if (!why) why = std::current_exception();
    }
  }
  std::rethrow_exception(why);
}

std::unique_ptr<VolumeSource> ImportJob::open() {
  VolumeRequest request;
  request.threads = options_.threads;
  const std::string input = input_.string();
  if (is_zarr(input)) return open_first(request);
  if (has_mesh_name(input_)) {
    fs::path picture = input_;
    throw Error(fmt::format("'{}' is a mesh, no volume; draw it: isobrick render {} -o {}", input,
                            shell_word(input),
                            shell_word(picture.replace_extension(".png").string())));
  }
  request.memory = options_.memory;
  // A folder of slices has no format.
  if (fs::is_regular_file(input_) && recognise_format(input) == VolumeFormat::vdb)
    request.grid = grid_to_show(read_vdb_header(input));
  if (request.grid)
    add_note(fmt::format("'{}' has several grids; this is '{}' (others: isobrick convert --grid)",
                         input_.filename().string(), *request.grid));
  return open_first(request);
}

void ImportJob::convert_input(Progress& progress) {
  const auto source = open();
  convert(*source, store_, options_, progress);
  for (std::string& note : source->notes()) add_note(std::move(note));
}

void ImportJob::add_ranges(Progress& progress) {
  add_missing_ranges(store_, *volume_, options_.memory, options_.threads, progress);
  add_note(fmt::format("the ranges of the samples were computed; they are in '{}'",
                       (store_ / "isobrick").string()));
}

/// Removes a cancelled conversion, which is not resumed after a drop. Another process may have
/// taken it over, and locked it; then it stays.
void ImportJob::discard() const {
  const fs::path partial = staging_path(store_);
  const UniqueFd folder(::open(partial.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
  if (folder.get() < 0 || ::flock(folder.get(), LOCK_EX | LOCK_NB) != 0) return;
  std::error_code ignored;
  fs::remove_all(partial, ignored);
}

void ImportJob::run() {
  std::string failure;
  bool cancelled = false;
  try {
    Reporter reporter(*this);
    if (volume_)
      add_ranges(reporter);
    else
      convert_input(reporter);
  } catch (const Cancelled&) {
    cancelled = true;
  } catch (const std::exception& e) {
    failure = error_message(e);
  }
  if (begun_ && !volume_ && (cancelled || !failure.empty())) discard();
  const MutexLock lock(mutex_);
  state_.finished = true;
  state_.cancelled = cancelled;
  state_.failure = std::move(failure);
}

ImportJob::State ImportJob::state() const {
  const MutexLock lock(mutex_);
  return state_;
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

fs::path store_for(const fs::path& input) {
  const fs::path full = fs::absolute(input);
  const fs::path folder = access(full.parent_path().c_str(), W_OK) == 0 ? full.parent_path()
                                                                        : fs::temp_directory_path();
  const std::string stem = volume_stem(full.string());
  fs::path store = folder / (stem + ".zarr");
  const auto taken = [](const fs::path& path) {
    return fs::exists(path) || fs::exists(staging_path(path));
  };
  for (int number = 2; taken(store); ++number)
    store = folder / fmt::format("{}-{}.zarr", stem, number);
  return store;
}

}  // namespace isobrick
