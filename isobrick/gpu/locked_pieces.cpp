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
  // Whoever gives memory back may work with another device, and goes on to. A thread that has
  // chosen none cannot be told from one that works with the first, which is set up for it then.
  int current = device_;
  (void)cudaGetDevice(&current);
  if (current != device_) (void)cudaSetDevice(device_);
  for (std::size_t piece = 0; piece < locked_; ++piece) (void)cudaHostUnregister(at(piece));
  if (current != device_) (void)cudaSetDevice(current);
}

bool LockedPieces::are(int device, const std::vector<std::size_t>& pieces) const {
  if (device_ != device || count() != pieces.size()) return false;
  for (std::size_t piece = 0; piece < count(); ++piece)
    if (bytes(piece) != MappedPages::whole_pages(pieces[piece])) return false;
  return true;
}

void LockedPieces::lock_next() {
  check(cudaHostRegister(at(locked_), bytes(locked_), cudaHostRegisterMapped));
  ++locked_;
}

}  // namespace isobrick::gpu
