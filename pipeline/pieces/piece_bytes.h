#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// Where the bytes of a piece are.
class PieceBytes {
 public:
  virtual ~PieceBytes() = default;
  virtual std::uint64_t size() const = 0;
  virtual void read_at(std::uint64_t offset, std::span<std::byte> bytes) = 0;
  /// For messages.
  virtual std::string name() const = 0;
};

/// A file. Throws as open_input().
std::unique_ptr<PieceBytes> open_piece_file(const std::filesystem::path& path);

/// A piece that no other process needs. What its writer holds in memory stays there.
class BufferedPiece final : public PieceBytes {
 public:
  explicit BufferedPiece(FileWriter writer) : writer_(std::move(writer)) {}
  FileWriter& writer() { return writer_; }

  std::uint64_t size() const override { return writer_.size(); }
  void read_at(std::uint64_t offset, std::span<std::byte> bytes) override {
    writer_.read_back(offset, bytes);
  }
  std::string name() const override { return "a piece of this command"; }

 private:
  FileWriter writer_;
};

}  // namespace isobrick
