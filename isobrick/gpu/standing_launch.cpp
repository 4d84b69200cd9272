#include "isobrick/gpu/standing_launch.h"

#include <algorithm>
#include <atomic>
#include <bit>

namespace isobrick::gpu {
namespace {

/// One isovalue that comes soon does not show yet that others will.
constexpr int kSoonInARow = 2;

/// After so many launches words on the device might be about one whose number comes round.
constexpr std::uint32_t kLaunchesToForget = 1u << 23;

/// Others that wait for the device have their turn.
constexpr std::uint64_t kMostNanoseconds = 1'000'000;

}  // namespace

StandingLaunch::StandingLaunch(std::chrono::nanoseconds patience, const Stream& stream)
    : patience_(patience), device_(patience.count() > 0 ? 1 : 0, stream) {
  if (device_.size() > 0) check(cudaMemsetAsync(device_.data(), 0, device_.bytes(), stream.get()));
}

bool StandingLaunch::should_stay(Clock::time_point now) const {
  return soon_ + 1 >= kSoonInARow && now - last_end_ < patience_;
}

void StandingLaunch::note_left() {
  ended_ -= blocks_;
  blocks_ = 0;
  --asked_;
  waits_ = false;
}

void StandingLaunch::note_end(Clock::time_point asked, Clock::time_point now) {
  waits_ = false;
  soon_ = asked - last_end_ < patience_ ? std::min(soon_ + 1, kSoonInARow) : 0;
  last_end_ = now;
}

StandBy StandingLaunch::prepare(std::uint32_t launch, const Stream& stream) {
  // Not what was asked of another one long ago, whose number may come round. One that still stands
  // by takes it as it is meant.
  write_leave(launch);
  OnDevice* const device = device_.data();
  if (launch + 1 - passed_ > kLaunchesToForget) {
    const int other = (launch + 1) % 256 == 0 ? 0xff : 0;  // no byte of the next launch's number
    check(cudaMemsetAsync(&device->passed_on, other, sizeof device->passed_on, stream.get()));
  }
  passed_ = launch + 1;
  return {request_.on_device(),
          &device->passed_on,
          &device->ended,
          ended_,
          static_cast<std::uint64_t>(patience_.count()),
          std::max(kMostNanoseconds, static_cast<std::uint64_t>(patience_.count()))};
}

void StandingLaunch::note_launch(std::uint32_t blocks) {
  blocks_ = blocks;
  ended_ += blocks;
}

void StandingLaunch::ask(std::uint32_t launch, std::uint32_t threshold, float crossing,
                         const FoundTiles& found) {
  ++asked_;
  waits_ = true;
  ended_ += blocks_;
  passed_ = launch + 1;
  write(LaunchRequest::kThreshold, threshold, launch);
  write(LaunchRequest::kCrossing, std::bit_cast<std::uint32_t>(crossing), launch);
  for (int i = 0; i < LaunchRequest::kLeave - LaunchRequest::kTiles; ++i)
    write(static_cast<LaunchRequest::Word>(LaunchRequest::kTiles + i), found.words[i], launch);
  write(LaunchRequest::kLeave, 0, launch);
}

bool StandingLaunch::has_left(LaunchReport& report, std::uint32_t launch) const {
  if (!waits_) return false;
  const std::uint64_t word =
      std::atomic_ref(report.words[LaunchReport::kLeft]).load(std::memory_order_relaxed);
  return word == LaunchWord::of(launch - 1, launch - 1);
}

void StandingLaunch::dismiss(std::uint32_t launch) {
  waits_ = false;
  if (blocks_ == 0) return;
  write_leave(launch);
  blocks_ = 0;
}

void StandingLaunch::write_leave(std::uint32_t launch) {
  for (int i = 0; i < LaunchRequest::kWords; ++i)
    write(static_cast<LaunchRequest::Word>(i), i == LaunchRequest::kLeave ? 1 : 0, launch);
}

void StandingLaunch::write(LaunchRequest::Word word, std::uint32_t value, std::uint32_t launch) {
  std::atomic_ref((*request_).words[word])
      .store(LaunchWord::of(value, launch), std::memory_order_relaxed);
}

}  // namespace isobrick::gpu
