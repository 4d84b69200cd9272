#include "isobrick/window/picture_setup.h"

#include <utility>

#include "isobrick/render/gl_context.h"

namespace isobrick {
namespace {

std::shared_ptr<DeviceOpening> begin_opening(const PictureBudgets& budgets,
                                             std::function<void()> on_change) {
  auto opening =
      std::make_shared<DeviceOpening>(budgets.device_mesh_memory(), std::move(on_change));
  if (budgets.backend != Backend::cpu) opening->begin();
  return opening;
}

}  // namespace

PictureSetup::PictureSetup(const PictureBudgets& budgets, std::function<void()> on_change,
                           std::optional<bool> software)
    : device_(begin_opening(budgets, std::move(on_change))),
      software_(software.value_or(current_gl_device().software)) {
  // Software compiles quickly and draws slowly.
  if (software_) return;
  PictureSettings settings;
  settings.picking = true;  // as StorePicture's pictures
  renderer_.prepare(settings);
  settings.occlusion = settings.multisample = false;  // as while something moves
  renderer_.prepare(settings);
}

}  // namespace isobrick
