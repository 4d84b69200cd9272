#pragma once

#include "stream/resident_bricks.h"

namespace isobrick::test {

/// Work that is never abandoned.
class Always final : public CancellationToken {
 public:
  void check() const override {}
};

}  // namespace isobrick::test
