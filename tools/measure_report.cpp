#include "tools/measure_report.h"

#include <fmt/format.h>

#include "tools/format.h"

namespace isobrick::tools {
namespace {

using nlohmann::ordered_json;

ordered_json vector_json(Vec3d v) { return {v.x, v.y, v.z}; }

/// " millimeter²", or nothing where the unit is not known.
std::string power_of(const std::string& unit, const char* power) {
  return unit.empty() ? "" : " " + unit + power;
}

std::string counted(std::uint64_t count, const char* what) {
  return fmt::format("{} {}{}", human_count(count), what, count == 1 ? "" : "s");
}

}  // namespace

ordered_json measure_json(const MeshMeasure& m) {
  ordered_json bounds;
  if (m.bounds) bounds = {{"lo", vector_json(m.bounds->lo)}, {"hi", vector_json(m.bounds->hi)}};
  return {{"area", m.area},
          {"volume", m.volume ? ordered_json(*m.volume) : ordered_json()},
          {"closed", m.is_closed()},
          {"open_sides", m.open_sides},
          {"components", m.components},
          {"euler_number", m.euler_number},
          {"bounds", bounds},
          {"unit", m.unit}};
}

std::string measure_text(const MeshMeasure& m) {
  std::string text = fmt::format("  area {:.6g}{}, ", m.area, power_of(m.unit, "²"));
  text += m.volume ? fmt::format("volume {:.6g}{}, closed\n", *m.volume, power_of(m.unit, "³"))
                   : fmt::format("open at {}, so it encloses no volume\n",
                                 counted(m.open_sides, "side"));
  text +=
      fmt::format("  {}, Euler number {}\n", counted(m.components, "component"), m.euler_number);
  if (!m.bounds) return text;
  const auto& [lo, hi] = *m.bounds;
  return text + fmt::format("  bounds {:.6g}:{:.6g}, {:.6g}:{:.6g}, {:.6g}:{:.6g}{}\n", lo.x, hi.x,
                            lo.y, hi.y, lo.z, hi.z, power_of(m.unit, ""));
}

}  // namespace isobrick::tools
