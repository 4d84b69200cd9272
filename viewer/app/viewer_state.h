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

namespace isobrick::inline v0 {

/// A picked point.
struct PickedPoint {
  Vec3d world, index;           ///< index: of level 0's samples
  std::uint32_t surface = 0;    ///< number of the surface from 1; 0: none
  std::optional<double> value;  ///< on the finest level that is resident there
  std::optional<Vec3d> normal;  ///< unit vector, towards smaller values
};

enum class FrameTarget : std::uint8_t { surface, volume };

/// Requests of the panels to the window.
struct Requests {
  bool close = false;
  std::optional<FrameTarget> fit;
  std::optional<Selection> volume;  ///< another volume of the image
  std::optional<Vec3d> look_along;  ///< world direction
  std::optional<std::filesystem::path> screenshot;
};

/// A message to the user, shown until a time.
struct Message {
  std::string text;
  std::chrono::steady_clock::time_point until;
};

/// The part of the window beside the panel, which shows the picture; in framebuffer pixels.
struct PictureArea {
  int left = 0, width = 1, height = 1;
  int window_width = 1;
};

struct TypedIsovalue {
  std::size_t surface = 0;
  std::string text;
};

/// The state of a window, which panels change. Not thread-safe.
struct ViewerState {
  std::filesystem::path path;                     ///< of the store; empty: none is open
  std::string name;                               ///< what people call it
  ImageVolumes volumes;                           ///< volumes of the store, and the chosen one
  std::unique_ptr<SceneRenderer> scene_renderer;  ///< of the store; null: none is open
  std::unique_ptr<IsovalueStats> isovalue_stats;  ///< of the store
  IndexKind index = IndexKind::linear;  ///< index over active nodes, also of the next store
  ViewSettings settings;
  std::size_t selected = 0;  ///< surface that slider and keys change
  Navigator navigator;
  FramePacer pacer;
  std::unique_ptr<Bookmarks> bookmarks;
  std::string new_bookmark;  ///< name in the text field
  std::unique_ptr<ImportJob> import;
  std::vector<Message> messages;                   ///< newest last
  std::chrono::milliseconds message_time{15'000};  ///< how long a message is shown
  std::size_t messages_shown = 0;                  ///< number of messages that the panel has shown
  std::optional<TypedIsovalue> typed;
  std::uint64_t missing_bricks = 0;  ///< last count
  double next_brick_count = 0;       ///< when to count next, Dear ImGui's time
  std::optional<PickedPoint> picked;
  bool measuring = false;
  std::vector<Vec3d> measured;  ///< world positions, at most two
  bool panels = true, help = false;
  float panel_width = 0;  ///< window coordinates
  Requests requests;
  double frame_seconds = 0, draw_seconds = 0;  ///< of the last frame
  std::array<float, 120> frame_times{};        ///< milliseconds; a ring buffer
  std::size_t frame_number = 0;                ///< number of frames so far

  /// Width that the panel takes from the picture in a window of width `width`; 0 if there is too
  /// little room.
  float panel_room(float width) const {
    return scene_renderer != nullptr && panels && width > 2 * panel_width ? panel_width : 0;
  }
  void show_message(std::string message) {
    messages.push_back({std::move(message), std::chrono::steady_clock::now() + message_time});
  }
  /// Removes messages whose time is over.
  void drop_old_messages() {
    const auto now = std::chrono::steady_clock::now();
    std::erase_if(messages, [&](const Message& message) { return message.until <= now; });
  }
};

}  // namespace isobrick
