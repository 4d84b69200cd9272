#pragma once

#include <isobrick/progress.h>
#include "bricks/ranges/stored_histogram.h"
#include "pipeline/volume/volume_samples.h"
#include "pipeline/workers.h"

namespace isobrick::inline v0 {

/// Counts all samples of a volume, in bins as narrow as a store keeps them. Missing samples count
/// as NaN.
SampleCounts count_samples(const VolumeSamples& samples, Workers& workers, Progress& progress);

}  // namespace isobrick
