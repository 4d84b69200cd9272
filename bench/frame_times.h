#pragma once

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "viewer/app/scene_renderer.h"

namespace isobrick::bench {

/// Statistics of the durations of many events.
class Times {
 public:
  void add(double seconds) { ms_.push_back(seconds * 1e3); }
  /// Sorts the durations and summarises them.
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

/// Statistics of frame times, with the steps of the slowest frames.
class FrameTimings {
 public:
  /// `total`: seconds to the end of glFinish, which took `finish`.
  void add(double total, const FrameTimes& steps, double finish) {
    total_.add(total);
    pictures_.push_back({pictures_.size(), total, steps, finish});
  }

  /// "all" and "slowest": means of the steps of all frames, and of the slowest hundredth.
  /// "numbers": the indices of these, from 0.
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
    FrameTimes steps;
    double finish;
  };

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
    put("lock_ms", [](const Picture& p) { return p.steps.lock; });
    put("draw_ms", [](const Picture& p) { return p.steps.draw; });
    put("tidy_ms", [](const Picture& p) { return p.steps.tidy; });
    put("finish_ms", [](const Picture& p) { return p.steps.finish + p.finish; });
    return json;
  }

  Times total_;
  std::vector<Picture> pictures_;
};

}  // namespace isobrick::bench
