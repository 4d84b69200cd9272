#include "isobrick/gpu/locked_pieces.h"

#include "isobrick/gpu/cuda_check.h"

namespace isobrick::gpu {
namespace {

std::vector<std::size_t> offsets_of(const std::vector<std::size_t>& pieces) {
  std::vector<std::size_t> offsets{0};
  for (const std::size_t bytes : pieces)
    offsets.push_back(offsets.back() + MappedPages::whole_pages(bytes));
  return offsets;
}

}  // namespace

LockedPieces::LockedPieces(int device, const std::vector<std::size_t>& pieces)
    : device_(device), offsets_(offsets_of(pieces)), pages_(offsets_.back()) {}

LockedPieces::~LockedPieces() {
  if (locked_ == 0) return;
  // Whoever gives memory back may work with another device.
  int current = device_;
  (void)cudaGetDevice(&current);
  (void)cudaSetDevice(device_);
  for (std::size_t piece = 0; piece < locked_; ++piece) (void)cudaHostUnregister(at(piece));
  (void)cudaSetDevice(current);
}

bool LockedPieces::are(int device, const std::vector<std::size_t>& pieces) const {
  return device_ == device && offsets_ == offsets_of(pieces);
}

void LockedPieces::lock_next() {
  check(cudaHostRegister(at(locked_), bytes(locked_), cudaHostRegisterMapped));
  ++locked_;
}

}  // namespace isobrick::gpu
