#pragma once

#include <chrono>
#include <cstdint>

#include "isobrick/gpu/stream.h"
#include "isobrick/gpu/tile_params.h"

namespace isobrick::gpu {

/// The host's side of a launch that stays on the device for the next isovalue (stand_by.cuh).
/// Isovalues that come one upon the other, as of whoever looks for one by what its mesh is, so
/// spare a launch each. Not thread-safe; whoever owns it waits for the stream before it goes.
class StandingLaunch {
 public:
  using Clock = std::chrono::steady_clock;

  /// Launches stay for `patience` at most, and only where the last isovalues came within that
  /// time after each other; 0: never.
  StandingLaunch(std::chrono::nanoseconds patience, const Stream& stream);

  /// An isovalue has come: whether a launch that is made for it should stay.
  bool should_stay(Clock::time_point now) const;
  /// What it made is known.
  void note_end(Clock::time_point asked, Clock::time_point now);

  /// What the kernel of launch `launch` is to know, before it is launched on `stream`.
  StandBy prepare(std::uint32_t launch, const Stream& stream);
  /// So many blocks of it have been launched, and will stand by.
  void note_launch(std::uint32_t blocks);
  /// Blocks of the one that stands by, or did when last heard of; 0: none does.
  std::uint32_t blocks() const { return blocks_; }
  /// Asks it to be launch `launch`, the one after its last. It may have left, and then says so.
  void ask(std::uint32_t launch, std::uint32_t threshold, float crossing, const FoundTiles& found);
  /// Whether it has left without seeing that it should be launch `launch`.
  bool has_left(LaunchReport& report, std::uint32_t launch) const;
  void note_left();
  /// Lets it go. What is launched next is launch `launch`.
  void dismiss(std::uint32_t launch);

  /// Requests that were heard.
  std::uint64_t asked() const { return asked_; }
  std::uint64_t bytes() const { return device_.bytes(); }

 private:
  struct OnDevice {
    LaunchRequest passed_on;
    std::uint32_t ended;
  };
  void write(LaunchRequest::Word word, std::uint32_t value, std::uint32_t launch);
  void write_leave(std::uint32_t launch);

  std::chrono::nanoseconds patience_;
  MappedHost<LaunchRequest> request_;
  DeviceBuffer<OnDevice> device_;
  std::uint32_t blocks_ = 0;
  std::uint32_t ended_ = 0;   ///< OnDevice::ended after what has been launched and asked
  std::uint32_t passed_ = 0;  ///< the latest launch that OnDevice::passed_on may be about
  bool waits_ = false;        ///< for what has been asked
  Clock::time_point last_end_{};
  std::uint64_t asked_ = 0;
  int soon_ = 0;  ///< isovalues in a row that came soon
};

}  // namespace isobrick::gpu
