#include "viewer/app/slice_views.h"

#include <algorithm>
#include <cstring>

namespace isobrick::inline v0 {
namespace {

/// Maximum bytes of one slice's samples. There are as many floats besides, also on the device.
std::uint64_t slice_bytes(const PictureBudgets& budgets, ScalarType type) {
  const std::uint64_t sample = std::min<std::uint64_t>(size_of(type), sizeof(float));
  const std::uint64_t samples = std::min(SliceViews::memory(budgets) / 3 / (sample + sizeof(float)),
                                         budgets.device_memory / 8 / 3 / sizeof(float));
  return std::min(SliceRequest{}.bytes, samples * sample);
}

template <class T>
void append_floats(const std::vector<std::byte>& pixels, std::vector<float>& samples) {
  samples.resize(pixels.size() / sizeof(T));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    T value;
    std::memcpy(&value, pixels.data() + i * sizeof(T), sizeof(T));
    samples[i] = static_cast<float>(value);
  }
}

std::vector<float> floats_of(const SliceSamples& slice) {
  std::vector<float> samples;
  if (slice.type == ScalarType::u8)
    append_floats<std::uint8_t>(slice.pixels, samples);
  else if (slice.type == ScalarType::u16)
    append_floats<std::uint16_t>(slice.pixels, samples);
  else
    append_floats<float>(slice.pixels, samples);
  return samples;
}

}  // namespace

SliceViews::SliceViews(const PictureBudgets& budgets, Vec3d last, ScalarType type)
    : last_(last), max_bytes_(slice_bytes(budgets, type)) {}

void SliceViews::update(SceneStream& stream, const ViewSettings& settings) {
  for (int axis = 0; axis < 3; ++axis) {
    const auto slot = static_cast<std::size_t>(axis);
    Slice& shown = slices_[slot];
    if (!settings.slices[slot].shown) {
      if (shown.requested) stream.set_slice(axis, std::nullopt);
      shown = {};
      continue;
    }
    SliceRequest request;
    request.axis = axis;
    request.bytes = max_bytes_;
    request.position = settings.slices[slot].position * last_[axis];
    shown.requested = true;
    stream.set_slice(axis, request);
    const auto slice = stream.slice(axis);
    if (slice != nullptr && slice != shown.from) shown = {slice, floats_of(*slice), true};
  }
}

SliceViews::Samples SliceViews::samples() const {
  return {slices_[0].from, slices_[1].from, slices_[2].from};
}

void SliceViews::draw(Renderer& renderer, const ViewSettings& settings,
                      std::vector<std::string>& damage) const {
  for (const Slice& shown : slices_) {
    if (shown.from == nullptr) continue;
    const SliceSamples& from = *shown.from;
    if (!from.damage.empty()) damage.push_back(from.damage);
    SliceImage image;
    image.corner = from.corner;
    image.along_x = from.along_width;
    image.along_y = from.along_height;
    image.width = static_cast<int>(from.width);
    image.height = static_cast<int>(from.height);
    image.samples = shown.samples;
    image.window_lo = settings.window_lo;
    image.window_hi = settings.window_hi;
    renderer.draw(image);
  }
}

std::uint64_t SliceViews::bytes() const {
  std::uint64_t bytes = 0;
  for (const Slice& slice : slices_) bytes += slice.samples.size() * sizeof(float);
  return bytes;
}

}  // namespace isobrick
