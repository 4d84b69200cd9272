#pragma once

#include <isobrick/error.h>

namespace isobrick::inline v0 {

/// Something would take more memory than its part of the budget.
class BudgetError : public UsageError {
 public:
  using UsageError::UsageError;
};

}  // namespace isobrick
