#pragma once

#include <cstdint>
#include <string_view>

#include <isobrick/api.h>

namespace isobrick::inline v0 {

/// Where long operations report to. Calls come from one thread at a time.
class ISOBRICK_API Progress {
 public:
  virtual ~Progress() = default;
  /// A stage of `total` bytes (or 0 when unknown) begins.
  virtual void begin(std::string_view stage, std::uint64_t total) = 0;
  /// `done` more bytes of the stage are finished.
  virtual void advance(std::uint64_t done) = 0;
  /// The stage is finished.
  virtual void end() = 0;
};

/// Swallows everything.
class ISOBRICK_API NoProgress final : public Progress {
 public:
  void begin(std::string_view, std::uint64_t) override {}
  void advance(std::uint64_t) override {}
  void end() override {}
};

/// One for all who want to hear nothing; any thread may use it.
inline Progress& no_progress() {
  static NoProgress none;
  return none;
}

}  // namespace isobrick
