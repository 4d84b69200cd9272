#pragma once

#include <cstdint>

#include <isobrick/mesh.h>

namespace isobrick::test {

/// Takes a mesh and keeps nothing of it.
class NoSink final : public MeshSink {
 public:
  Indexing indexing() const override { return Indexing::welded; }
  void begin(const MeshHeader&) override {}
  void write(const MeshChunk&) override {}
  void finish() override {}
  std::uint64_t bytes() const override { return 0; }
};

}  // namespace isobrick::test
