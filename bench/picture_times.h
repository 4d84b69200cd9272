#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "bench/machine_pace.h"
#include "isobrick/window/store_picture.h"

namespace isobrick::bench {

/// Milliseconds of many events.
class Times {
 public:
  void add(double seconds) { ms_.push_back(seconds * 1e3); }
  /// Ascending.
  nlohmann::ordered_json summary() {
    std::sort(ms_.begin(), ms_.end());
    if (ms_.empty()) return {{"pictures", 0}};
    double sum = 0;
    for (const double ms : ms_) sum += ms;
    return {{"pictures", ms_.size()},
            {"median_ms", part(0.5)},
            {"p99_ms", part(0.99)},
            {"max_ms", ms_.back()},
            {"per_second_if_unpaced", 1e3 * static_cast<double>(ms_.size()) / sum}};
  }

 private:
  double part(double p) const {
    return ms_[std::min(ms_.size() - 1,
                        static_cast<std::size_t>(p * static_cast<double>(ms_.size())))];
  }

  std::vector<double> ms_;
};

/// How long pictures take, and what the slowest of them consist of.
class PicturesTimes {
 public:
  /// `total`: from the beginning to the end of glFinish, which took `finish`; seconds. Now it ends.
  void add(double total, const PictureTimes& steps, double finish) {
    total_.add(total);
    pictures_.push_back({pictures_.size(), total, steps, finish, MachinePace::Clock::now()});
  }

  /// "all" and "slowest": the means of steps, of all pictures and of the slowest hundredth, which
  /// ones these are, counted from 0, and how many times slower than usual the processor was then.
  /// "at_pace": those during which it was at most `kOffPace` times slower.
  nlohmann::ordered_json summary(const MachinePace& pace) {
    auto json = summary();
    if (pictures_.empty()) return json;
    Times at_pace;
    for (std::size_t i = 0; i < pictures_.size(); ++i) {
      const Picture& p = pictures_[i];
      const std::chrono::duration<double> total(p.total);
      const double slower = pace.slower(
          p.end - std::chrono::duration_cast<MachinePace::Clock::duration>(total), p.end);
      if (slower <= kOffPace) at_pace.add(p.total);
      if (i < slowest()) json["slowest"]["processor_slower"].push_back(slower);
    }
    json["at_pace"] = at_pace.summary();
    return json;
  }
  /// Without what depends on the processor's pace.
  nlohmann::ordered_json summary() {
    auto json = total_.summary();
    if (pictures_.empty()) return json;
    std::sort(pictures_.begin(), pictures_.end(),
              [](const Picture& a, const Picture& b) { return a.total > b.total; });
    json["all"] = mean(pictures_.size());
    json["slowest"] = mean(slowest());
    for (std::size_t i = 0; i < slowest(); ++i)
      json["slowest"]["numbers"].push_back(pictures_[i].number);
    return json;
  }

 private:
  struct Picture {
    std::size_t number;
    double total;
    PictureTimes steps;
    double finish;
    MachinePace::Clock::time_point end;
  };
  static constexpr double kOffPace = 3;

  std::size_t slowest() const { return (pictures_.size() + 99) / 100; }

  nlohmann::ordered_json mean(std::size_t count) const {
    nlohmann::ordered_json json;
    const auto put = [&](const char* name, auto&& of) {
      double sum = 0;
      for (std::size_t i = 0; i < count; ++i) sum += of(pictures_[i]);
      json[name] = sum / static_cast<double>(count) * 1e3;
    };
    json["pictures"] = count;
    put("total_ms", [](const Picture& p) { return p.total; });
    put("device_ms", [](const Picture& p) { return p.steps.device; });
    put("scene_ms", [](const Picture& p) { return p.steps.scene; });
    put("drawable_ms", [](const Picture& p) { return p.steps.drawable; });
    put("upload_ms", [](const Picture& p) { return p.steps.upload; });
    put("slices_ms", [](const Picture& p) { return p.steps.slices; });
    put("turn_ms", [](const Picture& p) { return p.steps.turn; });
    put("draw_ms", [](const Picture& p) { return p.steps.draw; });
    put("tidy_ms", [](const Picture& p) { return p.steps.tidy; });
    put("finish_ms", [](const Picture& p) { return p.steps.finish + p.finish; });
    return json;
  }

  Times total_;
  std::vector<Picture> pictures_;
};

}  // namespace isobrick::bench
