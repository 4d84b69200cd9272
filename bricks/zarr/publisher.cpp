#include "bricks/zarr/publisher.h"

#include <utility>

#include "bricks/zarr/store_names.h"

namespace isobrick::inline v0 {
namespace {

// Each waiting file holds a descriptor.
constexpr std::size_t kMaxQueue = 64;
constexpr std::size_t kMaxThreads = 8;
// Files up to so many bytes wait in memory.
constexpr std::size_t kMaxWaiting = std::size_t{64} << 10;

}  // namespace

Publisher::Publisher(const std::filesystem::path& root) : folder_(root) {}

Publisher::~Publisher() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void Publisher::run(Job& job) const {
  if (job.kind == Job::Kind::sync_directory) return folder_.sync_folder(job.path);
  if (job.kind == Job::Kind::sync_file) return job.file.sync();
  try {
    if (job.kind == Job::Kind::write) {
      job.file = create_temporary(job.path);
      job.file.write_at(0, job.content);
    }
    publish_now(std::move(job.file), job.path);
  } catch (...) {
    discard_temporary(job.path);
    throw;
  }
}

void Publisher::publish_now(File temporary, const std::filesystem::path& path) const {
  temporary.sync();
  folder_.rename_file(temporary_name(path), path);
}

void Publisher::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] { return stop_ || !queue_.empty(); });
    if (queue_.empty()) return;
    Job job = std::move(queue_.front());
    queue_.pop_front();
    ++busy_;
    lock.unlock();
    std::exception_ptr failure;
    try {
      run(job);
    } catch (...) {
      failure = std::current_exception();
    }
    lock.lock();
    --busy_;
    if (failure && !failure_) failure_ = failure;
    changed_.notify_all();
  }
}

void Publisher::rethrow_failure() {
  // Kept, so that after a failure nothing can pretend to be finished.
  if (failure_) std::rethrow_exception(failure_);
}

void Publisher::start_thread() {
  if (threads_.size() < kMaxThreads && threads_.size() < queue_.size() + busy_)
    threads_.emplace_back([this] { run(); });
  changed_.notify_all();
}

void Publisher::add(Job job, const std::filesystem::path& parent) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return queue_.size() < kMaxQueue; });
  rethrow_failure();
  // The folders above may be new as well, so their own entries must be synced too; those above
  // the root are not ours. The root may be written in several ways ("a", "a/"): what is below it
  // is not.
  std::filesystem::path below = parent.lexically_relative(folder_.root());
  if (below == ".") below.clear();
  while (directories_.insert(folder_.root() / below).second && !below.empty())
    below = below.parent_path();
  queue_.push_back(std::move(job));
  start_thread();
}

void Publisher::publish(File temporary, std::filesystem::path path) {
  const std::filesystem::path parent = path.parent_path();
  add({Job::Kind::publish, std::move(temporary), std::move(path), {}}, parent);
}

void Publisher::sync(File file) {
  const std::filesystem::path parent = file.path().parent_path();
  add({Job::Kind::sync_file, std::move(file), {}, {}}, parent);
}

File Publisher::create_temporary(const std::filesystem::path& path) const {
  return folder_.create_file(temporary_name(path));
}

void Publisher::discard_temporary(const std::filesystem::path& path) const noexcept {
  try {
    folder_.remove_file(temporary_name(path));
  } catch (const std::exception&) {
  }
}

File Publisher::write_temporary(const std::filesystem::path& path,
                                std::span<const std::byte> content) {
  File file = create_temporary(path);
  file.write_at(0, content);
  count(content.size());
  return file;
}

void Publisher::write(const std::filesystem::path& path, std::span<const std::byte> content) {
  if (content.size() > kMaxWaiting) return publish(write_temporary(path, content), path);
  count(content.size());
  add({Job::Kind::write, {}, path, {content.begin(), content.end()}}, path.parent_path());
}

void Publisher::write(const std::filesystem::path& path, std::string_view text) {
  write(path, std::as_bytes(std::span(text)));
}

void Publisher::drain(std::unique_lock<std::mutex>& lock) {
  changed_.wait(lock, [&] { return queue_.empty() && busy_ == 0; });
  rethrow_failure();
}

void Publisher::wait() {
  std::unique_lock lock(mutex_);
  drain(lock);
  for (const auto& directory : std::exchange(directories_, {})) {
    queue_.push_back({Job::Kind::sync_directory, {}, directory, {}});
    start_thread();
  }
  drain(lock);
}

}  // namespace isobrick
