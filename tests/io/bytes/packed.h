#pragma once

#include <zlib.h>

#include <stdexcept>
#include <string>
#include <string_view>

namespace isobrick::inline v0 {

/// `bytes`, compressed by zlib: one gzip member, or a zlib stream.
inline std::string pack(std::string_view bytes, bool gzip, int level = 6) {
  z_stream stream{};
  if (deflateInit2(&stream, level, Z_DEFLATED, gzip ? 31 : 15, 8, Z_DEFAULT_STRATEGY) != Z_OK)
    throw std::runtime_error("no deflate");
  std::string packed(deflateBound(&stream, static_cast<uLong>(bytes.size())), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  const int result = deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  if (result != Z_STREAM_END) throw std::runtime_error("deflate failed");
  return packed;
}

inline std::string gzip(std::string_view bytes, int level = 6) { return pack(bytes, true, level); }

}  // namespace isobrick
