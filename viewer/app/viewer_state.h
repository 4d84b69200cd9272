#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bricks/image_volumes.h"
#include "viewer/app/bookmarks.h"
#include "viewer/app/frame_pacer.h"
#include "viewer/app/import_job.h"
#include "viewer/app/isovalue_stats.h"
#include "viewer/app/navigation.h"
#include "viewer/app/scene_renderer.h"
#include "viewer/app/view_settings.h"

namespace isobrick {

/// A place that somebody pointed at.
struct PickedPoint {
  Vec3d world, index;           ///< index: of level 0's samples
  std::uint32_t surface = 0;    ///< its number from 1; 0: none
  std::optional<double> value;  ///< on the finest level that is decoded there
  std::optional<Vec3d> normal;  ///< of unit length, towards smaller samples
};

/// What the camera is to frame.
enum class FrameTarget : std::uint8_t { surface, volume };

/// What panels may ask of the window.
struct Requests {
  bool close = false;
  std::optional<FrameTarget> fit;
  std::optional<Selection> volume;  ///< another one of the image
  std::optional<Vec3d> look_along;  ///< world direction
  std::optional<std::filesystem::path> screenshot;
};

/// A message to the user, for a while.
struct Message {
  std::string text;
  std::chrono::steady_clock::time_point until;
};

/// The part of the window that shows the picture, all that the panel leaves: pixels of the
/// framebuffer.
struct PictureArea {
  int left = 0, width = 1, height = 1;
  int window_width = 1;
};

/// An isovalue that is being typed.
struct TypedIsovalue {
  std::size_t surface = 0;
  std::string text;
};

/// What a window shows and how; panels change it. Not thread-safe.
struct ViewerState {
  std::filesystem::path path;                     ///< of the store; empty: none is open
  ImageVolumes volumes;                           ///< of the store, and the one that is shown
  std::unique_ptr<SceneRenderer> scene_renderer;  ///< of the store; null: none is open
  std::unique_ptr<IsovalueStats> isovalue_stats;  ///< of the store
  IndexKind index = IndexKind::linear;  ///< what finds active nodes, of the next store too
  ViewSettings settings;
  std::size_t selected = 0;  ///< the surface that slider and keys move
  Navigator navigator;
  FramePacer pacer;
  std::unique_ptr<Bookmarks> bookmarks;
  std::string new_bookmark;  ///< the name that is being typed
  std::unique_ptr<ImportJob> import;
  std::vector<Message> messages;                   ///< the latest last
  std::chrono::milliseconds message_time{15'000};  ///< for which a message is shown
  std::size_t messages_shown = 0;                  ///< so many of them the panel has shown
  std::optional<TypedIsovalue> typed;
  std::uint64_t missing_bricks = 0;  ///< as counted last
  double next_brick_count = 0;       ///< when next: time of Dear ImGui
  std::optional<PickedPoint> picked;
  bool measuring = false;
  std::vector<Vec3d> measured;  ///< world positions, two at most
  bool panels = true, help = false;
  float panel_width = 0;  ///< coordinates of the window
  Requests requests;
  double frame_seconds = 0, draw_seconds = 0;  ///< of the last picture
  std::array<float, 120> frame_times{};        ///< milliseconds, a ring
  std::size_t frame_number = 0;                ///< of those shown so far

  /// How much of the left of a window of this width the panel takes from what it shows beside it:
  /// nothing where there is too little room.
  float panel_room(float width) const {
    return scene_renderer != nullptr && panels && width > 2 * panel_width ? panel_width : 0;
  }
  void show_message(std::string message) {
    messages.push_back({std::move(message), std::chrono::steady_clock::now() + message_time});
  }
  /// Drops messages that have been shown long enough.
  void drop_old_messages() {
    const auto now = std::chrono::steady_clock::now();
    std::erase_if(messages, [&](const Message& message) { return message.until <= now; });
  }
};

}  // namespace isobrick
