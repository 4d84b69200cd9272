#include "ranks/mpi_ranks.h"

#include <mpi.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <limits>
#include <map>
#include <string>
#include <thread>

#include <fmt/format.h>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

/// Of requests to the dealer and of its answers.
constexpr int kAsk = 1, kAnswer = 2;
/// How often the dealer looks for requests: a part takes far longer.
constexpr std::chrono::microseconds kLook{100};

std::string text_of(int code) {
  char text[MPI_MAX_ERROR_STRING];
  int length = 0;
  MPI_Error_string(code, text, &length);
  return {text, static_cast<std::size_t>(length)};
}

void check(int code, const char* what) {
  if (code != MPI_SUCCESS) throw Error(fmt::format("MPI cannot {}: {}", what, text_of(code)));
}

int count_of(std::size_t bytes) {
  if (bytes > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    throw Error("the ranks would have to exchange more than 2 GiB at once: use fewer parts");
  return static_cast<int>(bytes);
}

class MpiFile final : public SharedFile {
 public:
  MpiFile(MPI_Comm ranks, const std::filesystem::path& path) : path_(path.string()) {
    const int code = MPI_File_open(ranks, path_.c_str(), MPI_MODE_WRONLY, MPI_INFO_NULL, &file_);
    if (code != MPI_SUCCESS) fail("open", code);
  }

  void write_at(std::uint64_t offset, std::span<const std::byte> bytes) override {
    constexpr std::size_t most = std::size_t{1} << 30;
    while (!bytes.empty()) {
      const std::span<const std::byte> now = bytes.first(std::min(most, bytes.size()));
      MPI_Status status;
      const int code = MPI_File_write_at(file_, static_cast<MPI_Offset>(offset), now.data(),
                                         count_of(now.size()), MPI_BYTE, &status);
      if (code != MPI_SUCCESS) fail("write to", code);
      int written = 0;
      MPI_Get_count(&status, MPI_BYTE, &written);
      if (written != static_cast<int>(now.size()))
        throw Error(fmt::format("cannot write to '{}': {} of {} bytes at {} were written", path_,
                                written, now.size(), offset));
      offset += now.size();
      bytes = bytes.subspan(now.size());
    }
  }

  void close() override {
    const int code = MPI_File_close(&file_);
    if (code != MPI_SUCCESS) fail("close", code);
  }

 private:
  [[noreturn]] void fail(const char* verb, int code) const {
    throw Error(fmt::format("cannot {} '{}': {}", verb, path_, text_of(code)));
  }

  std::string path_;
  MPI_File file_ = MPI_FILE_NULL;
};

/// Hands out the numbers of Ranks::next(): a thread of rank 0. Remote access to memory would need
/// no thread, but makes progress in many implementations only while its owner calls MPI.
class Dealer {
 public:
  Dealer(MPI_Comm ranks, bool is_here) : ranks_(ranks) {
    if (is_here) thread_ = std::thread([this] { serve(); });
  }
  ~Dealer() {
    ends_ = true;
    if (thread_.joinable()) thread_.join();
  }

  std::uint64_t next(std::uint32_t count) {
    if (thread_.joinable()) return take(count);
    std::uint64_t number = 0;
    check(MPI_Send(&count, 1, MPI_UINT32_T, 0, kAsk, ranks_), "ask for work");
    check(MPI_Recv(&number, 1, MPI_UINT64_T, 0, kAnswer, ranks_, MPI_STATUS_IGNORE), "get work");
    return number;
  }

 private:
  std::uint64_t take(std::uint32_t count) {
    const std::lock_guard lock(mutex_);
    return numbers_[count]++;
  }

  void serve() {
    while (!ends_) {
      int has_come = 0;
      MPI_Status status;
      if (MPI_Iprobe(MPI_ANY_SOURCE, kAsk, ranks_, &has_come, &status) != MPI_SUCCESS) return;
      if (has_come == 0) {
        std::this_thread::sleep_for(kLook);
        continue;
      }
      std::uint32_t count = 0;
      MPI_Recv(&count, 1, MPI_UINT32_T, status.MPI_SOURCE, kAsk, ranks_, MPI_STATUS_IGNORE);
      const std::uint64_t number = take(count);
      MPI_Send(&number, 1, MPI_UINT64_T, status.MPI_SOURCE, kAnswer, ranks_);
    }
  }

  MPI_Comm ranks_;
  std::mutex mutex_;  ///< of `numbers_`
  std::map<std::uint32_t, std::uint64_t> numbers_;
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

/// MPI from its beginning to its end.
class Session {
 public:
  Session() {
    // Of the ways to share a place in a file, which nothing here does, Open MPI tries one with a
    // file beside the output. A killed rank would leave it.
    ::setenv("OMPI_MCA_sharedfp", "^lockedfile", 0);
    int provided = 0;
    MPI_Init_thread(nullptr, nullptr, MPI_THREAD_MULTIPLE, &provided);
    if (provided < MPI_THREAD_MULTIPLE) {
      MPI_Finalize();
      throw Error("this MPI does not allow calls from several threads (MPI_THREAD_MULTIPLE)");
    }
    MPI_Comm_set_errhandler(MPI_COMM_WORLD, MPI_ERRORS_RETURN);
    MPI_File_set_errhandler(MPI_FILE_NULL, MPI_ERRORS_RETURN);
    // Calls of the dealer's thread must not meet those of the operation.
    MPI_Comm_dup(MPI_COMM_WORLD, &dealing);
    MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &node);
  }
  ~Session() {
    MPI_Comm_free(&node);
    MPI_Comm_free(&dealing);
    MPI_Finalize();
  }

  MPI_Comm dealing = MPI_COMM_NULL, node = MPI_COMM_NULL;
};

int size_of(MPI_Comm ranks) {
  int size = 0;
  MPI_Comm_size(ranks, &size);
  return size;
}

int rank_in(MPI_Comm ranks) {
  int rank = 0;
  MPI_Comm_rank(ranks, &rank);
  return rank;
}

class MpiRanks final : public Ranks {
 public:
  ~MpiRanks() override { MPI_Barrier(MPI_COMM_WORLD); }  // nobody asks the dealer any more

  int rank() const override { return rank_; }
  int size() const override { return size_; }
  int node_size() const override { return size_of(session_.node); }
  int node_rank() const override { return rank_in(session_.node); }

  std::vector<Bytes> gather(std::span<const std::byte> own) override {
    const int mine = count_of(own.size());
    std::vector<int> counts(static_cast<std::size_t>(size_));
    check(MPI_Allgather(&mine, 1, MPI_INT, counts.data(), 1, MPI_INT, MPI_COMM_WORLD), "gather");
    const std::vector<int> offsets = offsets_of(counts);
    Bytes all(static_cast<std::size_t>(offsets.back()));
    check(MPI_Allgatherv(own.data(), mine, MPI_BYTE, all.data(), counts.data(), offsets.data(),
                         MPI_BYTE, MPI_COMM_WORLD),
          "gather");
    return split(all, offsets);
  }

  std::vector<Bytes> exchange(const std::vector<Bytes>& to) override {
    std::vector<int> sent, received(static_cast<std::size_t>(size_));
    Bytes out;
    for (const Bytes& bytes : to) {
      sent.push_back(count_of(bytes.size()));
      out.insert(out.end(), bytes.begin(), bytes.end());
    }
    check(MPI_Alltoall(sent.data(), 1, MPI_INT, received.data(), 1, MPI_INT, MPI_COMM_WORLD),
          "exchange");
    const std::vector<int> from = offsets_of(sent), at = offsets_of(received);
    Bytes in(static_cast<std::size_t>(at.back()));
    check(MPI_Alltoallv(out.data(), sent.data(), from.data(), MPI_BYTE, in.data(), received.data(),
                        at.data(), MPI_BYTE, MPI_COMM_WORLD),
          "exchange");
    return split(in, at);
  }

  std::uint64_t next(std::uint32_t count) override { return dealer_.next(count); }

  std::unique_ptr<SharedFile> open_file(const std::filesystem::path& path) override {
    return std::make_unique<MpiFile>(MPI_COMM_WORLD, path);
  }

  [[noreturn]] void end_job(int exit_code) override {
    MPI_Abort(MPI_COMM_WORLD, exit_code);
    std::_Exit(exit_code);
  }

  std::uint64_t bytes_received() const override { return received_; }

 private:
  /// Where each begins, and behind them the sum.
  static std::vector<int> offsets_of(const std::vector<int>& counts) {
    std::vector<int> offsets{0};
    std::size_t sum = 0;
    for (const int count : counts)
      offsets.push_back(count_of(sum += static_cast<std::size_t>(count)));
    return offsets;
  }

  std::vector<Bytes> split(const Bytes& all, const std::vector<int>& offsets) {
    std::vector<Bytes> parts;
    for (int i = 0; i < size_; ++i) {
      const auto at = static_cast<std::size_t>(i);
      parts.emplace_back(all.begin() + offsets[at], all.begin() + offsets[at + 1]);
      if (i != rank_) received_ += parts.back().size();
    }
    return parts;
  }

  Session session_;
  int rank_ = rank_in(MPI_COMM_WORLD), size_ = size_of(MPI_COMM_WORLD);
  Dealer dealer_{session_.dealing, rank_ == 0};
  std::uint64_t received_ = 0;
};

}  // namespace

std::unique_ptr<Ranks> join_mpi() { return std::make_unique<MpiRanks>(); }

}  // namespace isobrick
