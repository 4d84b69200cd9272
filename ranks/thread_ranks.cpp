#include "ranks/thread_ranks.h"

#include <fcntl.h>

#include <cerrno>
#include <condition_variable>
#include <exception>
#include <map>
#include <mutex>
#include <thread>
#include <utility>

#include <isobrick/error.h>
#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {
namespace {

/// What the ranks of a job share.
class ThreadJob {
 public:
  explicit ThreadJob(int size) : sent(static_cast<std::size_t>(size)), size_(size) {}

  int size() const { return size_; }

  /// Returns once all ranks have come here as often.
  void wait_for_all() {
    std::unique_lock lock(mutex_);
    throw_if_failed();
    const std::uint64_t turn = turn_;
    if (++waiting_ == size_) {
      waiting_ = 0;
      ++turn_;
      changed_.notify_all();
      return;
    }
    changed_.wait(lock, [&] { return turn_ != turn || failure_; });
    if (turn_ == turn) throw_if_failed();
  }

  std::uint64_t next(std::uint32_t count) {
    const std::lock_guard lock(mutex_);
    throw_if_failed();
    return counts_[count]++;
  }

  /// The first failure is what is thrown in the end.
  void fail(std::exception_ptr what) {
    {
      const std::lock_guard lock(mutex_);
      if (!failure_) failure_ = std::move(what);
    }
    changed_.notify_all();
  }
  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }

  std::vector<std::vector<Ranks::Bytes>> sent;  ///< by sender, by receiver

 private:
  void throw_if_failed() const {
    if (failure_) throw Error("another thread of the job failed");
  }

  int size_, waiting_ = 0;
  std::uint64_t turn_ = 0;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::uint32_t, std::uint64_t> counts_;
  std::exception_ptr failure_;
};

class ThreadFile final : public SharedFile {
 public:
  ThreadFile(ThreadJob& job, const std::filesystem::path& path)
      : job_(job), file_(UniqueFd(::open(path.c_str(), O_WRONLY | O_CLOEXEC)), path) {
    if (!file_) throw system_error("open", path.string(), errno);
  }

  void write_at(std::uint64_t offset, std::span<const std::byte> bytes) override {
    file_.write_at(offset, bytes);
  }
  void close() override {
    FileWriter(std::move(file_)).finish();  // what is told only when a file is closed
    job_.wait_for_all();
  }

 private:
  ThreadJob& job_;
  File file_;
};

class ThreadRanks final : public Ranks {
 public:
  ThreadRanks(ThreadJob& job, int rank) : job_(job), rank_(rank) {}

  int rank() const override { return rank_; }
  int size() const override { return job_.size(); }
  int node_size() const override { return job_.size(); }
  int node_rank() const override { return rank_; }

  std::vector<Bytes> gather(std::span<const std::byte> own) override {
    return exchange(
        std::vector<Bytes>(static_cast<std::size_t>(size()), Bytes(own.begin(), own.end())));
  }

  std::vector<Bytes> exchange(const std::vector<Bytes>& to) override {
    const auto own = static_cast<std::size_t>(rank_);
    job_.sent[own] = to;
    job_.wait_for_all();
    std::vector<Bytes> got;
    for (std::size_t i = 0; i < job_.sent.size(); ++i) {
      got.push_back(job_.sent[i].at(own));
      if (i != own) received_ += got.back().size();
    }
    job_.wait_for_all();
    return got;
  }

  std::uint64_t next(std::uint32_t count) override { return job_.next(count); }

  std::unique_ptr<SharedFile> open_file(const std::filesystem::path& path) override {
    return std::make_unique<ThreadFile>(job_, path);
  }

  [[noreturn]] void end_job(int) override { std::terminate(); }
  std::uint64_t bytes_received() const override { return received_; }

 private:
  ThreadJob& job_;
  int rank_;
  std::uint64_t received_ = 0;
};

}  // namespace

void run_on_threads(int size, const std::function<void(Ranks&)>& work) {
  ThreadJob job(size);
  const auto run = [&](int rank) {
    ThreadRanks ranks(job, rank);
    try {
      work(ranks);
    } catch (...) {
      job.fail(std::current_exception());
    }
  };
  {
    std::vector<std::jthread> threads;
    for (int rank = 1; rank < size; ++rank) threads.emplace_back(run, rank);
    run(0);
  }
  job.rethrow();
}

}  // namespace isobrick
