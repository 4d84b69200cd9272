#include "viewer/app/view_settings.h"

#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

using Json = nlohmann::ordered_json;

template <class T>
Json list(Vec3<T> v) {
  return Json::array({v.x, v.y, v.z});
}

/// Reads fields of a JSON object. Throws Error, which names the field.
class Fields {
 public:
  explicit Fields(const Json& json) : json_(json) {}

  const Json& at(const char* name) const {
    if (!json_.is_object() || !json_.contains(name))
      throw Error(fmt::format("bookmark without \"{}\"", name));
    return json_.at(name);
  }
  double number(const char* name) const { return number(at(name), name); }
  float real(const char* name) const { return static_cast<float>(number(name)); }
  float real(const char* name, float min, float max) const {
    const float value = real(name);
    if (!(value >= min && value <= max)) wrong(name);
    return value;
  }
  bool flag(const char* name) const {
    if (!at(name).is_boolean()) wrong(name);
    return at(name).get<bool>();
  }
  Vec3d vector(const char* name) const {
    const Json& v = at(name);
    if (!v.is_array() || v.size() != 3) wrong(name);
    return {number(v[0], name), number(v[1], name), number(v[2], name)};
  }
  Vec3f vector_f(const char* name) const {
    const Vec3d v = vector(name);
    return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
  }
  /// A fraction or colour component for each axis.
  Vec3f parts(const char* name) const {
    const Vec3f v = vector_f(name);
    for (int axis = 0; axis < 3; ++axis)
      if (!(v[axis] >= 0 && v[axis] <= 1)) wrong(name);
    return v;
  }
  const Json& array(const char* name, std::size_t min, std::size_t max) const {
    const Json& v = at(name);
    if (!v.is_array() || v.size() < min || v.size() > max) wrong(name);
    return v;
  }

 private:
  [[noreturn]] static void wrong(const char* name) {
    throw Error(fmt::format("bookmark with an invalid \"{}\"", name));
  }
  static double number(const Json& v, const char* name) {
    if (!v.is_number()) wrong(name);
    return v.get<double>();
  }

  const Json& json_;
};

}  // namespace

nlohmann::ordered_json to_json(const ViewSettings& s) {
  Json surfaces = Json::array(), cuts = Json::array(), planes = Json::array(),
       slices = Json::array();
  for (const SurfaceSettings& surface : s.surfaces)
    surfaces.push_back({{"isovalue", surface.isovalue},
                        {"colour", list(surface.colour)},
                        {"opacity", surface.opacity},
                        {"shown", surface.shown}});
  for (const AxisClipSettings& clip : s.axis_clips)
    cuts.push_back({{"on", clip.on}, {"place", clip.position}, {"beyond", clip.above}});
  for (const ClipPlaneSettings& plane : s.planes)
    planes.push_back(
        {{"on", plane.on}, {"normal", list(plane.kept.normal)}, {"least", plane.kept.least}});
  for (const SliceSettings& slice : s.slices)
    slices.push_back({{"shown", slice.shown}, {"place", slice.position}});
  return {{"surfaces", surfaces},
          {"cuts", cuts},
          {"planes", planes},
          {"slices", slices},
          {"window", {s.window_lo, s.window_hi}},
          {"region", {{"on", s.region_on}, {"lo", list(s.region_lo)}, {"hi", list(s.region_hi)}}},
          {"occlusion", s.occlusion},
          {"edges", s.edges},
          {"multisample", s.multisample},
          {"box", s.box},
          {"axes", s.axes},
          {"scale_bar", s.scale_bar},
          {"pixel_error", s.pixel_error},
          {"finest_level", s.finest_level},
          {"background", {list(s.background_top), list(s.background_bottom)}}};
}

ViewSettings view_settings_from(const nlohmann::ordered_json& json) {
  const Fields in(json);
  ViewSettings s;
  for (const Json& item : in.array("surfaces", 0, kMaxSurfaces)) {
    const Fields f(item);
    s.surfaces.push_back(
        {f.number("isovalue"), f.parts("colour"), f.real("opacity", 0, 1), f.flag("shown")});
  }
  const Json& cuts = in.array("cuts", 3, 3);
  const Json& slices = in.array("slices", 3, 3);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Fields clip(cuts[axis]), slice(slices[axis]);
    s.axis_clips[axis] = {clip.flag("on"), clip.real("place", 0, 1), clip.flag("beyond")};
    s.slices[axis] = {slice.flag("shown"), slice.real("place", 0, 1)};
  }
  for (const Json& item : in.array("planes", 0, kMaxClipPlanes)) {
    const Fields plane(item);
    s.planes.push_back({plane.flag("on"), {plane.vector("normal"), plane.number("least")}});
    if (s.planes.back().kept.normal == Vec3d{})
      throw Error("bookmark with a plane without a direction");
  }
  const Json& window = in.array("window", 2, 2);
  const Json& background = in.array("background", 2, 2);
  const Json pairs{
      {"lo", window[0]}, {"hi", window[1]}, {"top", background[0]}, {"bottom", background[1]}};
  const Fields pair(pairs), region(in.at("region"));
  s.window_lo = pair.real("lo");
  s.window_hi = pair.real("hi");
  s.background_top = pair.parts("top");
  s.background_bottom = pair.parts("bottom");
  s.region_on = region.flag("on");
  s.region_lo = region.parts("lo");
  s.region_hi = region.parts("hi");
  s.occlusion = in.flag("occlusion");
  s.edges = in.flag("edges");
  s.multisample = in.flag("multisample");
  s.box = in.flag("box");
  s.axes = in.flag("axes");
  s.scale_bar = in.flag("scale_bar");
  s.pixel_error = in.real("pixel_error", kMinPixelError, kMaxPixelError);
  s.finest_level = static_cast<int>(in.real("finest_level", 0, 64));
  return s;
}

nlohmann::ordered_json to_json(const Camera& camera) {
  return {{"eye", list(camera.eye)},
          {"target", list(camera.target)},
          {"up", list(camera.up)},
          {"field_of_view", camera.field_of_view},
          {"orthographic", camera.orthographic}};
}

Camera camera_from(const nlohmann::ordered_json& json) {
  const Fields in(json);
  Camera camera(in.vector("eye"), in.vector("target"), in.vector("up"));
  camera.field_of_view = in.number("field_of_view");
  if (!(camera.field_of_view >= 1 && camera.field_of_view <= 170))
    throw Error("bookmark with a field of view that is not within 1 and 170 degrees");
  camera.orthographic = in.flag("orthographic");
  return camera;
}

}  // namespace isobrick
