#include "mesh_reader.h"

#include <charconv>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>
#include <stdexcept>

namespace isobrick::inline v0 {
namespace {

template <class T>
T value_at(std::string_view bytes, std::size_t offset) {
  if (offset + sizeof(T) > bytes.size()) throw std::runtime_error("the file is too short");
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof(T));
  return value;
}

template <class T>
std::vector<T> values_at(std::string_view bytes, std::size_t offset, std::size_t count) {
  if (offset > bytes.size() || count > (bytes.size() - offset) / sizeof(T))
    throw std::runtime_error("the file is too short");
  std::vector<T> values(count);
  if (count > 0) std::memcpy(values.data(), bytes.data() + offset, count * sizeof(T));
  return values;
}

std::size_t number_after(const std::string& text, const std::string& what, std::size_t from = 0) {
  const std::size_t at = text.find(what, from);
  if (at == std::string::npos) throw std::runtime_error("no '" + what + "'");
  return std::stoull(text.substr(at + what.size(), 20));
}

void append(TestMesh& whole, const TestMesh& part) {
  const auto base = static_cast<std::uint32_t>(whole.positions.size());
  whole.positions.insert(whole.positions.end(), part.positions.begin(), part.positions.end());
  whole.normals.insert(whole.normals.end(), part.normals.begin(), part.normals.end());
  for (const Triangle& t : part.triangles)
    whole.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
}

/// Three numbers from a line of OBJ.
Vec3f vector_of(const std::string& line, std::size_t from) {
  Vec3f v;
  const char* at = line.data() + from;
  for (int axis = 0; axis < 3; ++axis) {
    while (*at == ' ') ++at;
    const auto result = std::from_chars(at, line.data() + line.size(), v[axis]);
    EXPECT_EQ(result.ec, std::errc()) << line;
    at = result.ptr;
  }
  EXPECT_EQ(at, line.data() + line.size()) << line;
  return v;
}

/// An array of a .vtp: where it lies and of what it is.
struct VtpArray {
  std::string type;
  std::size_t offset = 0, bytes = 0;
};

std::map<std::string, VtpArray> vtp_arrays(const std::string& bytes, std::size_t data) {
  std::map<std::string, VtpArray> arrays;
  const std::string xml = bytes.substr(0, data);
  const std::regex pattern(
      "<DataArray type=\"(\\w+)\"(?: IdType=\"1\")? Name=\"(\\w+)\" NumberOfComponents=\"\\d\" "
      "format=\"appended\" offset=\"(\\d+)\"/>");
  for (std::sregex_iterator it(xml.begin(), xml.end(), pattern), end; it != end; ++it) {
    const std::size_t at = data + std::stoull((*it)[3]);
    arrays[(*it)[2]] = {(*it)[1], at + 8, value_at<std::uint64_t>(bytes, at)};
  }
  return arrays;
}

std::vector<std::uint64_t> whole_numbers(const std::string& bytes, const VtpArray& array) {
  std::vector<std::uint64_t> numbers;
  if (array.type == "Int64") {
    for (const auto n : values_at<std::int64_t>(bytes, array.offset, array.bytes / 8))
      numbers.push_back(static_cast<std::uint64_t>(n));
  } else {
    EXPECT_EQ(array.type, "Int32");
    for (const auto n : values_at<std::int32_t>(bytes, array.offset, array.bytes / 4))
      numbers.push_back(static_cast<std::uint64_t>(n));
  }
  return numbers;
}

std::string percent_decoded(const std::string& text) {
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i)
    if (text[i] == '%') {
      decoded += static_cast<char>(std::stoi(text.substr(i + 1, 2), nullptr, 16));
      i += 2;
    } else {
      decoded += text[i];
    }
  return decoded;
}

std::string xml_unescaped(std::string text) {
  for (const auto& [from, to] :
       {std::pair{"&lt;", "<"}, {"&gt;", ">"}, {"&quot;", "\""}, {"&apos;", "'"}, {"&amp;", "&"}})
    for (auto at = text.find(from); at != std::string::npos; at = text.find(from, at + 1))
      text.replace(at, std::strlen(from), to);
  return text;
}

using nlohmann::json;

/// Reads accessors of a GLB.
class Accessors {
 public:
  Accessors(const json& scene, std::vector<std::string> buffers)
      : scene_(scene), buffers_(std::move(buffers)) {}

  std::vector<Vec3d> vectors(std::size_t index) const {
    const json& accessor = scene_["accessors"][index];
    const json& view = scene_["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    EXPECT_EQ(accessor["type"], "VEC3");
    std::vector<Vec3d> vectors;
    for (std::size_t i = 0; i < accessor["count"]; ++i) {
      const std::size_t at = offset(accessor, view) + i * view["byteStride"].get<std::size_t>();
      Vec3d v;
      for (int axis = 0; axis < 3; ++axis)
        v[axis] = component(accessor, buffer(view), at, static_cast<std::size_t>(axis));
      vectors.push_back(v);
    }
    return vectors;
  }
  std::vector<Triangle> triangles(std::size_t index) const {
    const json& accessor = scene_["accessors"][index];
    const json& view = scene_["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    EXPECT_EQ(accessor["componentType"], 5125);
    EXPECT_EQ(accessor["type"], "SCALAR");
    return values_at<Triangle>(buffer(view), offset(accessor, view),
                               accessor["count"].get<std::size_t>() / 3);
  }

 private:
  static std::size_t offset(const json& accessor, const json& view) {
    return view.value("byteOffset", std::size_t{0}) + accessor.value("byteOffset", std::size_t{0});
  }
  const std::string& buffer(const json& view) const { return buffers_.at(view["buffer"]); }
  static double component(const json& accessor, const std::string& bytes, std::size_t at,
                          std::size_t axis) {
    switch (accessor["componentType"].get<int>()) {
      case 5126: return double{value_at<float>(bytes, at + 4 * axis)};
      case 5123: return double(value_at<std::uint16_t>(bytes, at + 2 * axis));
      case 5122:
        EXPECT_TRUE(accessor["normalized"].get<bool>());
        return std::max(-1.0, value_at<std::int16_t>(bytes, at + 2 * axis) / 32767.0);
    }
    throw std::runtime_error("another type of component");
  }

  const json& scene_;
  std::vector<std::string> buffers_;
};

Vec3f to_float(Vec3d v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

}  // namespace

std::string read_bytes(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  EXPECT_TRUE(in) << path;
  return {std::istreambuf_iterator<char>(in), {}};
}

TestMesh read_ply(const std::string& bytes) {
  const std::string end = "end_header\n";
  const std::size_t body = bytes.find(end) + end.size();
  const std::string header = bytes.substr(0, body);
  const bool normals = contains(header, "property float nx");
  const std::size_t vertices = number_after(header, "element vertex ");
  TestMesh mesh;
  const auto rows = values_at<Vec3f>(bytes, body, vertices * (normals ? 2 : 1));
  for (std::size_t i = 0; i < rows.size(); ++i)
    (normals && i % 2 ? mesh.normals : mesh.positions).push_back(rows[i]);
  const std::size_t faces = body + rows.size() * sizeof(Vec3f);
  for (std::size_t i = 0; i < number_after(header, "element face "); ++i)
    mesh.triangles.push_back(value_at<Triangle>(bytes, faces + 13 * i + 1));
  return mesh;
}

TestMesh read_obj(const std::string& text) {
  TestMesh mesh;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("v "))
      mesh.positions.push_back(vector_of(line, 2));
    else if (line.starts_with("vn "))
      mesh.normals.push_back(vector_of(line, 3));
    else if (line.starts_with("f ")) {
      Triangle triangle{};
      std::istringstream words(line.substr(2));
      for (std::uint32_t& vertex : triangle) {
        std::string word;
        words >> word;
        const std::size_t slashes = word.find("//");
        EXPECT_EQ(slashes != std::string::npos, !mesh.normals.empty()) << line;
        if (slashes != std::string::npos) {
          EXPECT_EQ(word.substr(0, slashes), word.substr(slashes + 2)) << line;
        }
        vertex = static_cast<std::uint32_t>(std::stoull(word) - 1);
      }
      mesh.triangles.push_back(triangle);
    } else {
      EXPECT_TRUE(line.starts_with("#")) << line;
    }
  }
  return mesh;
}

TestMesh read_vtp(const std::string& bytes) {
  const std::string start = "<AppendedData encoding=\"raw\">\n   _";
  const std::size_t data = bytes.find(start) + start.size();
  const std::string header = bytes.substr(0, data);
  EXPECT_TRUE(contains(header, "header_type=\"UInt64\""));
  auto arrays = vtp_arrays(bytes, data);
  const std::size_t vertices = number_after(header, "NumberOfPoints=\"");
  const std::size_t triangles = number_after(header, "NumberOfPolys=\"");
  TestMesh mesh;
  EXPECT_EQ(arrays.at("Points").bytes, vertices * sizeof(Vec3f));
  mesh.positions = values_at<Vec3f>(bytes, arrays["Points"].offset, vertices);
  if (arrays.contains("Normals"))
    mesh.normals = values_at<Vec3f>(bytes, arrays["Normals"].offset, vertices);
  const auto numbers = whole_numbers(bytes, arrays.at("connectivity"));
  const auto offsets = whole_numbers(bytes, arrays.at("offsets"));
  EXPECT_EQ(numbers.size(), 3 * triangles);
  EXPECT_EQ(offsets.size(), triangles);
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    EXPECT_EQ(offsets[i], 3 * (i + 1));
    mesh.triangles.push_back({static_cast<std::uint32_t>(numbers[3 * i]),
                              static_cast<std::uint32_t>(numbers[3 * i + 1]),
                              static_cast<std::uint32_t>(numbers[3 * i + 2])});
  }
  EXPECT_TRUE(bytes.ends_with("\n  </AppendedData>\n</VTKFile>\n"));
  return mesh;
}

PvtpFile read_pvtp(const std::string& text, const std::string& folder) {
  PvtpFile file;
  const std::regex pattern("<Piece Source=\"([^\"]+)\"/>");
  for (std::sregex_iterator it(text.begin(), text.end(), pattern), end; it != end; ++it) {
    const std::string bytes = read_bytes(folder + "/" + xml_unescaped((*it)[1]));
    append(file.mesh, read_vtp(bytes));
    EXPECT_TRUE(contains(bytes, " GlobalIds=\"GlobalPointIds\">"));
    const std::string start = "<AppendedData encoding=\"raw\">\n   _";
    const auto arrays = vtp_arrays(bytes, bytes.find(start) + start.size());
    const auto ids = whole_numbers(bytes, arrays.at("GlobalPointIds"));
    file.ids.insert(file.ids.end(), ids.begin(), ids.end());
    ++file.parts;
  }
  return file;
}

GlbFile read_glb(const std::string& bytes, const std::string& uri_folder) {
  GlbFile file;
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(value_at<std::uint32_t>(bytes, 4), 2u);
  EXPECT_EQ(value_at<std::uint32_t>(bytes, 8), bytes.size());
  const std::size_t json_bytes = value_at<std::uint32_t>(bytes, 12);
  EXPECT_EQ(bytes.substr(16, 4), "JSON");
  file.json = bytes.substr(20, json_bytes);
  const json scene = json::parse(file.json);
  std::vector<std::string> buffers;
  for (const json& buffer : scene.value("buffers", json::array())) {
    if (buffer.contains("uri"))
      buffers.push_back(read_bytes(uri_folder + "/" + percent_decoded(buffer["uri"])));
    else
      buffers.push_back(bytes.substr(20 + json_bytes + 8));
    EXPECT_EQ(buffers.back().size(), buffer["byteLength"].get<std::size_t>());
  }
  if (!scene.contains("meshes")) return file;
  const json& node = scene["nodes"][0];
  const auto factor = [&](const char* name, int axis, double fallback) {
    return node.contains(name) ? node[name][static_cast<std::size_t>(axis)].get<double>()
                               : fallback;
  };
  if (node.contains("scale")) file.step = node["scale"][0];
  const Accessors accessors(scene, std::move(buffers));
  for (const json& primitive : scene["meshes"][0]["primitives"]) {
    TestMesh part;
    for (Vec3d v : accessors.vectors(primitive["attributes"]["POSITION"])) {
      for (int axis = 0; axis < 3; ++axis)
        v[axis] = v[axis] * factor("scale", axis, 1) + factor("translation", axis, 0);
      part.positions.push_back(to_float(v));
    }
    if (primitive["attributes"].contains("NORMAL"))
      for (const Vec3d& v : accessors.vectors(primitive["attributes"]["NORMAL"]))
        part.normals.push_back(to_float(v));
    part.triangles = accessors.triangles(primitive["indices"]);
    append(file.mesh, part);
    ++file.parts;
  }
  return file;
}

}  // namespace isobrick
