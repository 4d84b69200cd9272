#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <barrier>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <thread>
#include <vector>

#include <isobrick/error.h>
#include "ranks/ranks.h"

namespace isobrick::test {

/// What the ranks of a ThreadRanks share.
class ThreadJob {
 public:
  explicit ThreadJob(int size)
      : sent(static_cast<std::size_t>(size)), together(size), size_(size) {}
  int size() const { return size_; }

  std::vector<std::vector<Ranks::Bytes>> sent;  ///< by sender, by receiver
  std::barrier<> together;
  std::mutex mutex;
  std::map<std::uint32_t, std::uint64_t> counts;

 private:
  int size_;
};

/// A rank that is a thread of this process.
class ThreadRanks final : public Ranks {
 public:
  ThreadRanks(ThreadJob& job, int rank) : job_(job), rank_(rank) {}

  int rank() const override { return rank_; }
  int size() const override { return job_.size(); }
  int node_size() const override { return job_.size(); }

  std::vector<Bytes> gather(std::span<const std::byte> own) override {
    return exchange(
        std::vector<Bytes>(static_cast<std::size_t>(size()), Bytes(own.begin(), own.end())));
  }

  std::vector<Bytes> exchange(const std::vector<Bytes>& to) override {
    const auto own = static_cast<std::size_t>(rank_);
    job_.sent[own] = to;
    job_.together.arrive_and_wait();
    std::vector<Bytes> got;
    for (std::size_t i = 0; i < job_.sent.size(); ++i) {
      got.push_back(job_.sent[i].at(own));
      if (i != own) received_ += got.back().size();
    }
    job_.together.arrive_and_wait();
    return got;
  }

  std::uint64_t next(std::uint32_t count) override {
    const std::lock_guard lock(job_.mutex);
    return job_.counts[count]++;
  }

  std::unique_ptr<SharedFile> open_file(const std::filesystem::path& path) override {
    return std::make_unique<ThreadFile>(*this, path);
  }

  [[noreturn]] void end_job(int) override { std::terminate(); }
  std::uint64_t bytes_received() const override { return received_; }

 private:
  class ThreadFile final : public SharedFile {
   public:
    ThreadFile(Ranks& ranks, const std::filesystem::path& path)
        : ranks_(ranks), file_(::open(path.c_str(), O_WRONLY)) {
      if (file_ < 0) throw Error("cannot open " + path.string());
    }
    ~ThreadFile() override { ::close(file_); }
    void write_at(std::uint64_t offset, std::span<const std::byte> bytes) override {
      if (::pwrite(file_, bytes.data(), bytes.size(), static_cast<off_t>(offset)) !=
          static_cast<ssize_t>(bytes.size()))
        throw Error("cannot write");
    }
    void close() override { ranks_.wait_for_all(); }

   private:
    Ranks& ranks_;
    int file_;
  };

  ThreadJob& job_;
  int rank_;
  std::uint64_t received_ = 0;
};

/// Calls work(ranks) for each of so many ranks, at the same time. None may fail where there are
/// several: the others would wait.
inline void run_job(int size, const std::function<void(Ranks&)>& work) {
  ThreadJob job(size);
  std::exception_ptr failure;
  std::vector<std::jthread> threads;
  for (int rank = 0; rank < size; ++rank)
    threads.emplace_back([&job, &work, &failure, rank, size] {
      ThreadRanks ranks(job, rank);
      try {
        work(ranks);
      } catch (...) {
        if (size > 1) std::terminate();
        failure = std::current_exception();
      }
    });
  threads.clear();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace isobrick::test
