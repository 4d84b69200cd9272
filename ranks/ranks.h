#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

namespace isobrick::inline v0 {

/// A file that all ranks of a job write together.
class SharedFile {
 public:
  /// Destroyed unclosed, as after a failure, it leaves the other ranks alone.
  virtual ~SharedFile() = default;
  /// Writes bytes that no other rank writes. Throws Error where they cannot be written.
  virtual void write_at(std::uint64_t offset, std::span<const std::byte> bytes) = 0;
  /// Collective: returns once every rank has written what it writes. Throws as write_at().
  virtual void close() = 0;
};

/// The processes of one job, numbered from 0. Functions that are called collective are called by
/// all ranks in the same order, each on one thread at a time. Transport only: no rank sees another
/// one's memory.
class Ranks {
 public:
  using Bytes = std::vector<std::byte>;

  /// Collective, where the job ends well.
  virtual ~Ranks() = default;

  virtual int rank() const = 0;
  virtual int size() const = 0;
  /// How many of them run on this machine.
  virtual int node_size() const = 0;
  /// The number of this one among them, from 0.
  virtual int node_rank() const = 0;

  /// Collective: what each rank gives, by rank.
  virtual std::vector<Bytes> gather(std::span<const std::byte> own) = 0;
  /// Collective: to[i] goes to rank i. Returns what came, by rank.
  virtual std::vector<Bytes> exchange(const std::vector<Bytes>& to) = 0;
  /// Collective: returns once all ranks have called it.
  void wait_for_all() { gather({}); }
  /// Collective: a new count for next().
  std::uint32_t new_count() { return ++last_count_; }
  /// 0, 1, 2, …: each number goes to one caller, whichever rank asks next. Each count has numbers
  /// of its own; 0 is there from the beginning. Thread-safe, not collective.
  virtual std::uint64_t next(std::uint32_t count) = 0;
  /// Collective: opens a file that is there, at the same path for all ranks. Throws Error.
  virtual std::unique_ptr<SharedFile> open_file(const std::filesystem::path& path) = 0;

  /// Ends all ranks at once; the launcher hears the exit code.
  [[noreturn]] virtual void end_job(int exit_code) = 0;

  /// Bytes that this rank got from others so far.
  virtual std::uint64_t bytes_received() const = 0;

 private:
  std::uint32_t last_count_ = 0;
};

/// Collective: calls make(number) for 0 … count − 1, each on one rank. A rank gets the next one
/// when it asks, so that none waits for one with more work.
template <class F>
void deal(Ranks& ranks, std::uint64_t count, F&& make) {
  const std::uint32_t dealt = ranks.new_count();
  for (std::uint64_t i = ranks.next(dealt); i < count; i = ranks.next(dealt)) make(i);
}

/// Items as bytes, and bytes as items.
template <class T>
Ranks::Bytes to_bytes(std::span<const T> items) {
  static_assert(std::is_trivially_copyable_v<T>);
  const auto bytes = std::as_bytes(items);
  return {bytes.begin(), bytes.end()};
}
template <class T>
std::vector<T> to_items(const Ranks::Bytes& bytes) {
  static_assert(std::is_trivially_copyable_v<T>);
  std::vector<T> items(bytes.size() / sizeof(T));
  std::memcpy(items.data(), bytes.data(), items.size() * sizeof(T));
  return items;
}

/// Collective: what rank 0 gives.
inline Ranks::Bytes from_first(Ranks& ranks, std::span<const std::byte> own) {
  return ranks.gather(ranks.rank() == 0 ? own : std::span<const std::byte>{}).front();
}

/// What isobrick_mpi.so returns (io/bytes/module.h).
struct MpiModule {
  const char* version;
  /// Joins the job. Throws Error where MPI cannot be used as it is needed.
  std::unique_ptr<Ranks> (*join)();
};

/// How many ranks the launcher that started this process says there are, by its environment
/// variables; 0: no launcher of MPI did.
int launched_ranks();

/// Joins the job that this process was started for. Throws Error where this was built without MPI,
/// and what load_module() does.
std::unique_ptr<Ranks> join_ranks();

}  // namespace isobrick
