#pragma once

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <vector>

#include <isobrick/image_metadata.h>
#include "bricks/zarr/array_metadata.h"
#include "bricks/zarr/codec.h"
#include "tests/pipeline/convert_store.h"

namespace isobrick::test {

/// An image as another program writes it: one level, a file for each chunk of
/// odd extents, big endian; no word of ours in it.
template <class T>
void write_foreign(const std::filesystem::path& path, Int3 extent, Int3 chunk,
                   const std::vector<T>& samples) {
  ArrayMetadata array;
  array.shape = {extent.z, extent.y, extent.x};
  array.chunk = {chunk.z, chunk.y, chunk.x};
  array.type = scalar_type_of<T>;
  array.codecs.big_endian = sizeof(T) > 1;
  array.codecs.steps = {ByteCodec::zstd};
  array.codecs.zstd_level = 1;
  ImageMetadata image;
  image.name = "foreign";
  image.levels = {{"scale0/image", {}}};
  image.levels[0].transform.spacing = {0.5, 1, 2};
  image.ours = false;
  namespace fs = std::filesystem;
  const auto write = [&](const fs::path& file, std::string_view bytes) {
    fs::create_directories((path / file).parent_path());
    std::ofstream(path / file, std::ios::binary) << bytes;
  };
  write("zarr.json", to_json(image));
  write("scale0/image/zarr.json", to_json(array));
  for_each_point({{0, 0, 0}, ceil_div(extent, chunk)}, [&](Int3 c) {
    std::vector<T> full(static_cast<std::size_t>(volume(chunk)));
    bool empty = true;
    for_each_point(intersect({c * chunk, (c + Int3{1, 1, 1}) * chunk}, {{0, 0, 0}, extent}),
                   [&](Int3 p) {
                     const T v = samples[static_cast<std::size_t>(linear_index(p, extent))];
                     full[static_cast<std::size_t>(linear_index(p - c * chunk, chunk))] = v;
                     empty = empty && v == T{};
                   });
    if (empty) return;  // absent
    std::vector<std::byte> bytes = as_bytes(full);
    for (std::size_t i = 0; i < bytes.size(); i += sizeof(T))
      std::reverse(bytes.begin() + static_cast<std::ptrdiff_t>(i),
                   bytes.begin() + static_cast<std::ptrdiff_t>(i + sizeof(T)));
    const auto encoded = encode_bytes(array.codecs, bytes);
    write("scale0/image/" + array.chunk_key(std::array<Index, 3>{c.z, c.y, c.x}),
          {reinterpret_cast<const char*>(encoded.data()), encoded.size()});
  });
}

}  // namespace isobrick::test
