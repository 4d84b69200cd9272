#pragma once

#include "isobrick/stream/resident_bricks.h"

namespace isobrick::test {

/// Work that is never abandoned.
class Always final : public Wanted {
 public:
  void check() const override {}
};

}  // namespace isobrick::test
