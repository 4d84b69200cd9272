#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>

#include <isobrick/vec.h>
#include <isobrick/volume_source.h>
#include "io/bytes/file.h"

namespace isobrick::inline v0 {

/// A raw array on disk, C order [z, y, x], of which boxes are written and read
/// in any order and by any thread.
class SlabFile {
 public:
  /// The array begins `begin` bytes into the file.
  SlabFile(File file, Int3 extent, std::size_t sample_bytes, std::uint64_t begin = 0);

  /// Takes the room on disk for all of it, so that a full disk shows at once.
  void reserve() const;
  void write(Box3 box, const std::byte* samples);
  void read(Box3 box, std::byte* samples) const;

  std::uint64_t bytes() const;

 private:
  File file_;
  Int3 extent_;
  std::size_t sample_bytes_;
  std::uint64_t begin_;
};

/// A level on its way into a store that does not fit in memory: a nameless file
/// that is gone when it is closed, whatever happens. It is filled box by box
/// and then read like any other source.
class SpooledVolume final : public VolumeSource {
 public:
  /// The file lies on the disk of `beside`.
  SpooledVolume(const std::filesystem::path& beside, VolumeInfo info);

  void write(Box3 box, const std::byte* samples) { file_.write(box, samples); }

  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return true; }
  void read(Box3 box, std::byte* out) override { file_.read(box, out); }

 private:
  VolumeInfo info_;
  SlabFile file_;
};

}  // namespace isobrick
