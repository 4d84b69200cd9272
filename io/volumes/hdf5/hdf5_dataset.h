#pragma once

#include <memory>
#include <string>
#include <vector>

#include <isobrick/array_view.h>
#include <isobrick/scalar.h>

namespace isobrick::inline v0 {

/// An open dataset of an HDF5 file. The library is not made for threads: all
/// calls of all datasets take turns. Chunks whose filters are deflate, shuffle and
/// fletcher32 are decoded without it, on several threads.
class Hdf5Dataset {
 public:
  /// `name` empty: the only one of three or more dimensions. `threads` 0: all cores.
  /// Throws UsageError for none, several (which are listed), a name that is not there
  /// and what is not supported; DamageError where the file is damaged.
  Hdf5Dataset(const std::string& path, const std::string& name, int threads);
  ~Hdf5Dataset();

  ScalarType type() const;
  /// Fastest first, with roles and directions from the labels of the dimensions.
  const std::vector<ArrayAxis>& axes() const;
  /// Whether labels give all roles.
  bool labelled() const;
  /// The attribute `element_size_um` that Fiji and ilastik write, of the axes of space, fastest
  /// first; or zeros.
  Vec3d element_size() const;
  /// Bytes that reading takes: a few chunks, and a layer of them if that is not much.
  std::size_t memory() const;

  /// Copies a box of the array, whose first sample is `start` and which has
  /// `count` samples along each axis (fastest first), to `out` in C order. One
  /// thread at a time.
  void read(const std::vector<Index>& start, const std::vector<Index>& count, std::byte* out);

 private:
  struct Handles;
  std::unique_ptr<Handles> handles_;
};

}  // namespace isobrick
