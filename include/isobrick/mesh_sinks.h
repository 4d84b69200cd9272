#pragma once

#include <cstdint>
#include <functional>
#include <utility>

#include <isobrick/api.h>
#include <isobrick/mesh.h>

namespace isobrick::inline v0 {

/// Takes a welded mesh into memory.
class ISOBRICK_API MemorySink final : public MeshSink {
 public:
  /// Replaces what `mesh` holds, in its memory where that is enough. `mesh` must outlive it.
  explicit MemorySink(Mesh& mesh) : mesh_(mesh) {}

  Indexing indexing() const override { return Indexing::welded; }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override {}
  std::uint64_t bytes() const override;

 private:
  Mesh& mesh_;
};

/// Calls a function with every chunk of a mesh. The calls come from one thread at a time, which
/// need not be the caller's. What the function throws ends the operation.
class ISOBRICK_API FunctionSink final : public MeshSink {
 public:
  /// The chunk is valid until the function returns.
  using Function = std::function<void(const MeshChunk&)>;

  /// `indexing` is of the chunks that the function wants.
  explicit FunctionSink(Function function, Indexing indexing = Indexing::welded)
      : function_(std::move(function)), indexing_(indexing) {}

  Indexing indexing() const override { return indexing_; }
  void begin(const MeshHeader&) override {}
  void write(const MeshChunk& chunk) override;
  void finish() override {}
  std::uint64_t bytes() const override { return bytes_; }

 private:
  Function function_;
  Indexing indexing_;
  std::uint64_t bytes_ = 0;
};

}  // namespace isobrick
