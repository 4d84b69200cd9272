#include "isobrick/bricks/publisher.h"

#include <utility>

namespace isobrick {
namespace {

// Each waiting file holds a descriptor.
constexpr std::size_t kMaxQueue = 64;
constexpr int kThreads = 8;

}  // namespace

Publisher::Publisher(std::filesystem::path root) : root_(std::move(root)) {
  for (int i = 0; i < kThreads; ++i) threads_.emplace_back([this] { run(); });
}

Publisher::~Publisher() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void Publisher::Job::run() {
  if (!file) {
    sync_directory(path);
    return;
  }
  try {
    publish_file(std::move(file), path);
  } catch (...) {
    std::error_code ignored;
    std::filesystem::remove(temporary_name(path), ignored);
    throw;
  }
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
      job.run();
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

void Publisher::drain(std::unique_lock<std::mutex>& lock) {
  changed_.wait(lock, [&] { return queue_.empty() && busy_ == 0; });
  rethrow_failure();
}

void Publisher::wait() {
  std::unique_lock lock(mutex_);
  drain(lock);
  for (const auto& directory : std::exchange(directories_, {})) queue_.push_back({{}, directory});
  changed_.notify_all();
  drain(lock);
}

}  // namespace isobrick
