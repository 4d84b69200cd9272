#include "io/bytes/inflate.h"

#include <isa-l/igzip_lib.h>

#include <cstdint>

namespace isobrick::inline v0 {
namespace {

InflateResult::Status status_of(int code) {
  switch (code) {
    case ISAL_DECOMP_OK: return InflateResult::Status::complete;
    case ISAL_OUT_OVERFLOW: return InflateResult::Status::no_room;
    case ISAL_END_INPUT: return InflateResult::Status::cut_off;
    default: return InflateResult::Status::invalid;
  }
}

}  // namespace

InflateResult inflate(Wrapper wrapper, std::span<const std::byte> packed,
                      std::span<std::byte> out) {
  inflate_state state;
  isal_inflate_init(&state);
  state.crc_flag = wrapper == Wrapper::gzip ? ISAL_GZIP : ISAL_ZLIB;
  state.next_in = const_cast<std::uint8_t*>(reinterpret_cast<const std::uint8_t*>(packed.data()));
  state.avail_in = static_cast<std::uint32_t>(packed.size());
  state.next_out = reinterpret_cast<std::uint8_t*>(out.data());
  state.avail_out = static_cast<std::uint32_t>(out.size());
  const int code = isal_inflate_stateless(&state);
  return {status_of(code), out.size() - state.avail_out, code};
}

}  // namespace isobrick
