#include "isobrick/bricks/publisher.h"

#include <utility>

namespace isobrick {
namespace {

// Each waiting file holds a descriptor.
constexpr std::size_t kMaxQueue = 64;

}  // namespace

Publisher::Publisher(std::filesystem::path root)
    : root_(std::move(root)), thread_([this] { run(); }) {}

Publisher::~Publisher() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void Publisher::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] { return stop_ || !queue_.empty(); });
    if (queue_.empty()) return;
    Job job = std::move(queue_.front());
    queue_.pop_front();
    busy_ = true;
    lock.unlock();
    std::exception_ptr failure;
    try {
      publish_file(std::move(job.file), job.path);
    } catch (...) {
      failure = std::current_exception();
      std::error_code ignored;
      std::filesystem::remove(temporary_name(job.path), ignored);
    }
    lock.lock();
    busy_ = false;
    if (failure && !failure_) failure_ = failure;
    changed_.notify_all();
  }
}

void Publisher::rethrow_failure() {
  // Kept, so that after a failure nothing can pretend to be finished.
  if (failure_) std::rethrow_exception(failure_);
}

void Publisher::publish(StoreFile temporary, std::filesystem::path path) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return queue_.size() < kMaxQueue; });
  rethrow_failure();
  // The folders above may be new as well, so their own entries must be synced too.
  for (auto folder = path.parent_path(); directories_.insert(folder).second;
       folder = folder.parent_path())
    if (folder == root_ || !folder.has_relative_path()) break;
  queue_.push_back({std::move(temporary), std::move(path)});
  lock.unlock();
  changed_.notify_all();
}

void Publisher::write(const std::filesystem::path& path, std::span<const std::byte> content) {
  StoreFile file = StoreFile::create(temporary_name(path));
  file.write_at(0, content);
  count(content.size());
  publish(std::move(file), path);
}

void Publisher::write(const std::filesystem::path& path, std::string_view text) {
  write(path, std::as_bytes(std::span(text)));
}

void Publisher::wait() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return queue_.empty() && !busy_; });
  rethrow_failure();
  const auto directories = std::exchange(directories_, {});
  lock.unlock();
  for (const auto& directory : directories) sync_directory(directory);
}

}  // namespace isobrick
