#include "pipeline/pieces/piece_identity.h"

#include <fmt/format.h>

#include <isobrick/version.h>
#include "bricks/ranges/stored_ranges.h"

namespace isobrick::inline v0 {
namespace {

using nlohmann::json;

template <class T>
json list_of(Vec3<T> v) {
  return {v.x, v.y, v.z};
}

template <class T>
Vec3<T> vec_of(const json& list) {
  return {list.at(0).get<T>(), list.at(1).get<T>(), list.at(2).get<T>()};
}

}  // namespace

std::string version_text() {
  return fmt::format("{}.{}.{}", ISOBRICK_VERSION_MAJOR, ISOBRICK_VERSION_MINOR,
                     ISOBRICK_VERSION_PATCH);
}

json samples_json(const StoreReader& store, int level) {
  const StoreInfo& info = store.info();
  const LevelInfo& of_level = info.levels[static_cast<std::size_t>(level)];
  json object{{"level", level},
              {"extent", list_of(of_level.lattice.extent)},
              {"type", std::string(short_name(of_level.lattice.type))},
              {"block_range_crc32c", of_level.block_ranges_crc32c}};
  // Their checksums differ wherever a brick does.
  if (const auto stored = read_stored_ranges(*store.storage(), info.additions))
    object["brick_crc32c"] = stored->levels.at(static_cast<std::size_t>(level)).content;
  return object;
}

json box_json(Box3 box) { return {list_of(box.lo), list_of(box.hi)}; }

json transform_json(const Transform& transform) {
  return {list_of(transform.spacing), list_of(transform.origin), transform.direction,
          transform.unit};
}

Box3 box_of(const json& object) {
  return {vec_of<Index>(object.at(0)), vec_of<Index>(object.at(1))};
}

Transform transform_of(const json& object) {
  Transform transform;
  transform.spacing = vec_of<double>(object.at(0));
  transform.origin = vec_of<double>(object.at(1));
  transform.direction = object.at(2).get<decltype(transform.direction)>();
  transform.unit = object.at(3).get<std::string>();
  return transform;
}

}  // namespace isobrick
