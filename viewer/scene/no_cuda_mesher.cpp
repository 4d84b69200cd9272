#include "viewer/scene/device_mesher.h"

namespace isobrick::inline v0 {

std::shared_ptr<DeviceMesher> open_device_mesher(const std::optional<DeviceId>&, std::uint64_t) {
  return nullptr;
}

}  // namespace isobrick
