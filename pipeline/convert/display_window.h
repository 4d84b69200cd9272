#pragma once

#include <optional>

#include <isobrick/image_metadata.h>
#include <isobrick/store_reader.h>

namespace isobrick::inline v0 {

/// The values between which viewers show a store at first: the percentiles 0.5 and 99.5 of its
/// samples, within the range of level 0. They come from a level of few samples or, where there
/// is none, from bricks that are spread evenly over the coarsest one. Nothing where no sample is
/// finite.
std::optional<DisplayWindow> display_window(const StoreReader& store);

}  // namespace isobrick
