#pragma once

#include <gtest/gtest.h>

#include <optional>
#include <string>

#include <isobrick/error.h>
#include <isobrick/extract.h>
#include <isobrick/index_build.h>
#include <isobrick/verify.h>
#include "tests/pipeline/convert_store.h"

namespace isobrick::test {

/// All bytes of a mesh: its vertices, then its triangles.
class BytesSink final : public MeshSink {
 public:
  Indexing indexing() const override { return Indexing::welded; }
  void begin(const MeshHeader&) override {}
  void write(const MeshChunk& chunk) override {
    append(vertices_, std::as_bytes(chunk.positions));
    append(triangles_, std::as_bytes(chunk.triangles));
  }
  void finish() override {}
  std::uint64_t bytes() const override { return 0; }
  std::string mesh() const { return vertices_ + triangles_; }

 private:
  static void append(std::string& to, std::span<const std::byte> bytes) {
    to.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  }
  std::string vertices_, triangles_;
};

inline IndexChoice by(std::optional<IndexKind> kind) { return {.automatic = false, .kind = kind}; }

inline std::string mesh_of(const std::filesystem::path& path, ExtractOptions options,
                           std::optional<IndexKind> kind, ExtractReport* report = nullptr) {
  const StoreReader store(path);
  options.index = by(kind);
  options.threads = 2;
  BytesSink sink;
  NoProgress silent;
  const ExtractReport done = extract(store, options, sink, silent);
  EXPECT_EQ(done.index, kind);
  if (report) *report = done;
  return sink.mesh();
}

inline IndexReport add_index_quietly(const std::filesystem::path& store, IndexOptions options) {
  options.threads = 2;
  NoProgress silent;
  return add_index(store, options, silent);
}

inline VerifyReport verify_quietly(const std::filesystem::path& store) {
  NoProgress silent;
  return verify(store, {.threads = 2}, silent);
}

/// Throws at the n-th step of a stage.
class Stopping final : public Progress {
 public:
  Stopping(std::string stage, int steps) : stage_(std::move(stage)), left_(steps) {}
  void begin(std::string_view stage, std::uint64_t) override { counts_ = stage == stage_; }
  void advance(std::uint64_t) override {
    if (counts_ && left_-- == 0) throw Error("stopped");
  }
  void end() override {}

 private:
  std::string stage_;
  int left_;
  bool counts_ = false;
};

inline constexpr IndexKind kStoredKinds[] = {IndexKind::interval, IndexKind::kdtree,
                                             IndexKind::quadtree, IndexKind::octree};

/// The message of a DamageError or other Error; empty when there is none.
template <class F>
std::string message_of(F&& f) {
  try {
    f();
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

}  // namespace isobrick::test
