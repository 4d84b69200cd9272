#pragma once

#include <string>
#include <vector>

#include "viewer/scene/device_mesher.h"

namespace isobrick::test {

/// Base of test devices: no shared memory, no failure.
class TestDevice : public DeviceMesher {
 public:
  std::string failure() const override { return {}; }
  const std::string& name() const override { return name_; }
  std::vector<DeviceBlock> shared_blocks() const override { return {}; }
  void share_only(std::size_t) override {}
  std::uint64_t bytes() const override { return 0; }
  TicketLock& kernel_lock() override { return kernel_lock_; }
  Times times() const override { return {}; }

 private:
  std::string name_ = "of a test";
  TicketLock kernel_lock_;
};

}  // namespace isobrick::test
