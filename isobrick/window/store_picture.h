#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "isobrick/render/mesh_pool.h"
#include "isobrick/render/renderer.h"
#include "isobrick/viewer/scene.h"
#include "isobrick/window/device_meshes.h"
#include "isobrick/window/picture_setup.h"
#include "isobrick/window/shown_part.h"
#include "isobrick/window/view_settings.h"

namespace isobrick {

/// What a picture shows and what it still lacks.
struct PictureState {
  bool complete = false;  ///< nothing finer, nothing else is on its way
  /// Of each surface that is drawn, by its number: at first, and while the one that was asked
  /// for does not cover the view, not the settings'. NaN: nothing of it is drawn.
  std::vector<double> isovalues;
  bool covers = false;  ///< every surface at its isovalue, without holes, however coarse
  std::uint64_t triangles = 0, nodes = 0;
  bool plain = false;               ///< drawn without occlusion and multisampling to be quick
  std::uint64_t device_bytes = 0;   ///< taken for meshes and slices
  bool imports = false;             ///< the next draw() takes more of a device's memory over
  bool limited_by_budget = false;   ///< with more memory it would be finer
  std::vector<std::string> damage;  ///< messages, one for each node that cannot be shown
};

/// How a picture may be simpler than its settings say.
struct PictureWay {
  double coarser = 1;  ///< factor on settings.pixel_error
  /// Without occlusion and multisampling; `until_complete`: unless nothing finer is to come. In
  /// software, which draws slowly, that is one picture later: first a plain one of all.
  enum class Plain : std::uint8_t { no, until_complete, yes } plain = Plain::no;
};

/// Seconds that the steps of a picture took this thread; where none was made, from `turn` to
/// `finish` are 0.
struct PictureTimes {
  double device = 0;    ///< taking over a device, or a part of its memory
  Scene::Times scene;   ///< choosing nodes
  double drawable = 0;  ///< asking what can be drawn
  double upload = 0;    ///< taking meshes to the device
  double slices = 0;
  double turn = 0;    ///< waiting for a device that makes meshes as well
  double draw = 0;    ///< telling OpenGL what to draw, memory imported for it included
  double finish = 0;  ///< waiting until OpenGL has drawn it
  double tidy = 0;    ///< dropping meshes
};

/// Draws a store: chooses nodes for a view, takes their meshes from the scene to the
/// device, and makes the picture. The same for windows and off-screen. One thread, with
/// the context current that it was made in.
class StorePicture {
 public:
  /// Reads the ranges. `on_change` is called from worker threads when a new
  /// picture would show more. `setup`: of the current context, for as long as this picture is
  /// drawn; null: one of its own. Throws what Scene, PictureSetup and DeviceMeshes::use() do.
  StorePicture(std::shared_ptr<const StoreReader> store, const PictureBudgets& budgets,
               std::function<void()> on_change, std::shared_ptr<PictureSetup> setup = nullptr);
  ~StorePicture();

  const StoreReader& store() const { return *store_; }
  Scene& scene() { return *scene_; }
  Renderer& renderer() { return setup_->renderer(); }
  DeviceMeshes& device() { return *device_; }

  /// The box around the volume, axis by axis of world space.
  WorldBox bounds() const;

  /// Makes the picture in the renderer, of what is there by now; leaves the one before where that
  /// would show the same.
  void draw(const Camera& camera, int width, int height, const ViewSettings& settings,
            const PictureWay& way = {});
  const PictureState& state() const { return state_; }
  /// Whether the last draw() made a picture, rather than to leave the one before.
  bool drew() const { return times_.draw > 0; }
  /// Of the last draw().
  const PictureTimes& times() const { return times_; }

  /// Draws again and again until the picture is complete. Calls `wait` between, at
  /// least ten times a second, which may throw.
  void draw_complete(const Camera& camera, int width, int height, const ViewSettings& settings,
                     const std::function<void()>& wait);

 private:
  /// A mesh on the device. It may outlive the one in host memory, which made again
  /// would be the same.
  struct Upload {
    bool there = false;
    PooledMesh place;
    std::uint64_t used = 0;
  };

  /// What may be taken to the device in a picture while others wait: copies that a driver puts
  /// off take their time later.
  struct UploadShare {
    std::uint64_t bytes = 0;
    std::chrono::steady_clock::time_point begin = std::chrono::steady_clock::now();

    bool spent() const {
      return bytes > (16u << 20) || std::chrono::steady_clock::now() - begin > kMost;
    }
    static constexpr std::chrono::milliseconds kMost{6};
  };

  void update_scene(const Camera& camera, int width, int height, const ViewSettings& settings,
                    double coarser);
  /// Takes meshes of the newest drawable to the device; shows it once all are there.
  void upload(const std::shared_ptr<const Drawable>& newest);
  bool upload_all(const Drawable& drawable, UploadShare& share);
  bool can_wait(const Drawable& newest) const;
  bool may_be_plain(const PictureWay& way, const Drawable& newest, bool idle) const;
  std::uint64_t slice_bytes_there() const;
  std::uint64_t upload_memory() const;
  void drop_unused();
  void drop_uploads(std::uint64_t most);
  void draw_surfaces(const ViewSettings& settings);
  /// Takes new samples of slices. Whether there are any.
  bool update_slices(const ViewSettings& settings);
  void draw_slices(const ViewSettings& settings);
  void draw_marks(const ViewSettings& settings);
  PictureSettings picture_settings(const ViewSettings& settings) const;

  std::shared_ptr<const StoreReader> store_;
  PictureBudgets budgets_;
  std::future<std::unique_ptr<Scene>> reading_;  ///< beside the set-up
  std::shared_ptr<PictureSetup> setup_;
  MeshPool pool_;
  std::unique_ptr<Scene> scene_;
  std::unique_ptr<DeviceMeshes> device_;
  std::shared_ptr<const Drawable> shown_, next_;
  std::vector<std::size_t> shown_surfaces_;  ///< which surface each isovalue of the scene is
  std::unordered_map<MeshId, Upload, MeshIdHash> uploads_;
  /// What slices show, as the renderer takes it.
  struct ShownSlice {
    std::shared_ptr<const SliceSamples> from;
    std::vector<float> samples;
    bool asked = false;
  };
  std::array<ShownSlice, 3> slices_;
  std::string shows_;  ///< camera, size and settings of the picture in the renderer
  std::chrono::steady_clock::time_point drawn_;  ///< when that was
  double draw_seconds_ = 0;                      ///< how long it took
  std::uint64_t frame_ = 0;
  PictureState state_;
  PictureTimes times_;
};

}  // namespace isobrick
