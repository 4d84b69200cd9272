#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>

#include "io/meshes/readers/mesh_file.h"
#include "io/meshes/vtp_sink.h"
#include "tests/io/bytes/base64_text.h"
#include "tests/io/bytes/packed.h"
#include "tests/io/bytes/temp_dir.h"
#include "tests/io/meshes/test_meshes.h"

namespace isobrick::inline v0 {
namespace {

template <class T>
std::string raw(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

/// How VTK may write an array.
enum class Form { ascii, base64, zlib, appended_raw, appended_base64, appended_zlib };

/// Two quads beside each other as VTK's writer lays them out.
class VtkWriter {
 public:
  explicit VtkWriter(Form form, bool wide_header = false) : form_(form), wide_(wide_header) {}

  std::string file() {
    const std::vector<float> points{0, 0, 7, 1, 0, 7, 1, 1, 7, 0, 1, 7, 2, 0, 7, 2, 1, 7};
    const std::vector<float> normals{0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1};
    const std::vector<std::int64_t> corners{0, 1, 2, 3, 1, 4, 5, 2}, ends{4, 8};
    const std::string unit = "millimeter";
    std::vector<std::uint8_t> codes(unit.begin(), unit.end());
    codes.push_back(0);
    const std::string body =
        "<PolyData><FieldData>" + array("Array", "String", "unit", 1, codes) +
        "</FieldData><Piece NumberOfPoints=\"6\" NumberOfVerts=\"0\" NumberOfLines=\"0\" "
        "NumberOfStrips=\"0\" NumberOfPolys=\"2\"><PointData Normals=\"n\">" +
        array("DataArray", "Float32", "n", 3, normals) + "</PointData><Points>" +
        array("DataArray", "Float32", "Points", 3, points) + "</Points><Verts></Verts><Polys>" +
        array("DataArray", "Int64", "connectivity", 1, corners) +
        array("DataArray", "Int64", "offsets", 1, ends) + "</Polys></Piece></PolyData>\n";
    return std::string(
               "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" "
               "byte_order=\"LittleEndian\" header_type=\"") +
           (wide_ ? "UInt64\"" : "UInt32\"") +
           (is_zlib() ? " compressor=\"vtkZLibDataCompressor\">" : ">") + body +
           (appended_.empty() ? ""
                              : "<AppendedData encoding=\"" + encoding() + "\">\n _" + appended_ +
                                    "\n</AppendedData>") +
           "</VTKFile>\n";
  }

 private:
  bool is_zlib() const { return form_ == Form::zlib || form_ == Form::appended_zlib; }
  bool is_appended() const { return form_ >= Form::appended_raw; }
  std::string encoding() const { return form_ == Form::appended_raw ? "raw" : "base64"; }

  std::string size(std::uint64_t n) const {
    return std::string(reinterpret_cast<const char*>(&n), wide_ ? 8 : 4);
  }

  template <class T>
  std::string text(const std::vector<T>& values) const {
    std::string words;
    for (const T value : values) words.append(" ").append(std::to_string(value));
    return words;
  }

  std::string packed(const std::string& bytes) const {
    if (form_ == Form::appended_raw) return size(bytes.size()) + bytes;
    if (!is_zlib()) return base64(size(bytes.size()) + bytes);
    // Blocks of 32 bytes; the last one may be shorter.
    constexpr std::size_t block = 32;
    std::string blocks, sizes;
    std::uint64_t count = 0;
    for (std::size_t at = 0; at < bytes.size(); at += block, ++count) {
      const std::string one = pack(bytes.substr(at, block), false);
      sizes += size(one.size());
      blocks += one;
    }
    return base64(size(count) + size(block) + size(bytes.size() % block) + sizes) + base64(blocks);
  }

  template <class T>
  std::string array(const std::string& element, const std::string& type, const std::string& name,
                    int components, const std::vector<T>& values) {
    std::string tag = "<" + element + " type=\"" + type + "\" Name=\"" + name +
                      "\" NumberOfComponents=\"" + std::to_string(components) + "\" format=\"";
    if (form_ == Form::ascii) return tag + "ascii\">" + text(values) + "</" + element + ">";
    if (!is_appended()) return tag + "binary\">\n  " + packed(raw(values)) + "\n</" + element + ">";
    tag += "appended\" offset=\"" + std::to_string(appended_.size()) + "\"/>";
    appended_ += packed(raw(values));
    return tag;
  }

  Form form_;
  bool wide_;
  std::string appended_;
};

void expect_two_quads(const std::string& path) {
  const std::unique_ptr<MeshFile> file = open_mesh_file(path);
  EXPECT_EQ(file->info().faces, 2U);
  EXPECT_EQ(file->info().unit, "millimeter");
  Vec3d lo, hi;
  file->bounds(lo, hi);
  EXPECT_EQ(lo, (Vec3d{0, 0, 7}));
  EXPECT_EQ(hi, (Vec3d{2, 1, 7}));
  std::vector<Vec3f> corners;
  file->read({}, [&](const MeshChunk& chunk, Vec3d) {
    ASSERT_EQ(chunk.normals.size(), chunk.positions.size());
    for (const Vec3f& n : chunk.normals) EXPECT_EQ(n, (Vec3f{0, 0, 1}));
    for (const Triangle& t : chunk.triangles)
      for (const std::uint32_t v : t) corners.push_back(chunk.positions[v]);
  });
  EXPECT_EQ(corners, (std::vector<Vec3f>{{0, 0, 7},
                                         {1, 0, 7},
                                         {1, 1, 7},
                                         {0, 0, 7},
                                         {1, 1, 7},
                                         {0, 1, 7},
                                         {1, 0, 7},
                                         {2, 0, 7},
                                         {2, 1, 7},
                                         {1, 0, 7},
                                         {2, 1, 7},
                                         {1, 1, 7}}));
}

TEST(VtpFile, ReadsWhatVtkWrites) {
  const TempDir dir;
  for (const Form form : {Form::ascii, Form::base64, Form::zlib, Form::appended_raw,
                          Form::appended_base64, Form::appended_zlib})
    for (const bool wide : {false, true}) {
      SCOPED_TRACE(static_cast<int>(form));
      expect_two_quads(dir.write("a.vtp", VtkWriter(form, wide).file()));
    }
}

/// Writes a ball, cut into parts where the sink does that.
void write(MeshSink&& sink, bool normals) {
  const TestMesh ball = make_ball({1, 2, 3}, 1, 20);
  sink.begin({normals, {0, 1, 2}, {2, 3, 4}, {}, "micrometer"});
  sink.write(ball.chunk(0, normals));
  sink.finish();
}

std::vector<Vec3f> corners_of(const std::string& path, bool normals) {
  std::vector<Vec3f> corners;
  open_mesh_file(path)->read({}, [&](const MeshChunk& chunk, Vec3d) {
    EXPECT_EQ(chunk.normals.size(), normals ? chunk.positions.size() : 0);
    for (const Triangle& t : chunk.triangles)
      for (const std::uint32_t v : t) corners.push_back(chunk.positions[v]);
  });
  return corners;
}

TEST(VtpFile, ReadsWhatTheSinksWrite) {
  const TestMesh ball = make_ball({1, 2, 3}, 1, 20);
  std::vector<Vec3f> expected;
  for (const Triangle& t : ball.triangles)
    for (const std::uint32_t v : t) expected.push_back(ball.positions[v]);
  for (const bool normals : {false, true}) {
    const TempDir dir;
    write(VtpSink(dir / "a.vtp", false), normals);
    write(PvtpSink(dir / "b & c.pvtp", false, 300), normals);
    for (const char* name : {"a.vtp", "b & c.pvtp"}) {
      EXPECT_EQ(corners_of(dir / name, normals), expected) << name;
      const MeshFileInfo info = open_mesh_file(dir / name)->info();
      EXPECT_EQ(info.faces, ball.triangles.size());
      EXPECT_EQ(info.unit, "micrometer");
    }
    // The index alone is no mesh.
    std::filesystem::remove(dir / "b & c.pvtp.parts/part_1.vtp");
    EXPECT_TRUE(contains(message_of<Error>([&] { open_mesh_file(dir / "b & c.pvtp"); }), "part_1"));
  }
}

/// Everything that reading takes.
void read_all(const std::string& path) {
  const std::unique_ptr<MeshFile> file = open_mesh_file(path);
  Vec3d lo, hi;
  file->bounds(lo, hi);
  file->read(lo, [](const MeshChunk&, Vec3d) {});
}

TEST(VtpFile, DamageIsSaid) {
  const TempDir dir;
  const std::vector<std::pair<std::string, std::string>> changes{
      {"type=\"PolyData\"", "type=\"ImageData\""},
      {"NumberOfPoints=\"6\"", "NumberOfPoints=\"7\""},
      {"NumberOfPoints=\"6\"", "NumberOfPoints=\"-1\""},
      {"NumberOfPoints=\"6\"", "NumberOfPoints=\"5\""},  // a corner beyond them
      {"NumberOfPolys=\"2\"", "NumberOfPolys=\"3\""},
      {"NumberOfStrips=\"0\"", "NumberOfStrips=\"1\""},
      {"Name=\"offsets\"", "Name=\"off\""},
      {"Name=\"connectivity\"", "Name=\"off\""},
      {"type=\"Int64\"", "type=\"String\""},
      {"type=\"Float32\" Name=\"Points\"", "type=\"Float64\" Name=\"Points\""},
      {"<Points>", "<Dots>"},
      {"<VTKFile", "<!DOCTYPE a><VTKFile"},
      {"header_type=\"UInt32\"", "header_type=\"UInt16\""},
      {"version=\"1.0\" byte_order", "version=\"" + std::string(2 << 20, '1') + "\" byte_order"},
  };
  for (const Form form : {Form::ascii, Form::base64, Form::appended_raw, Form::appended_zlib})
    for (const auto& [from, to] : changes) {
      std::string text = VtkWriter(form).file();
      text.replace(text.find(from), from.size(), to);
      if (form == Form::ascii && to.starts_with("type=\"Float64")) continue;  // as good as another
      const std::string path = dir.write("a.vtp", text);
      EXPECT_TRUE(contains(message_of<Error>([&] { read_all(path); }), "a.vtp")) << to;
    }
  std::string other = VtkWriter(Form::zlib).file();
  other.replace(other.find("vtkZLib"), 7, "vtkLZ4");
  EXPECT_TRUE(contains(message_of<Error>([&] { read_all(dir.write("a.vtp", other)); }), "LZ4"));
  for (const std::string source : {"/a.vtp", "../a.vtp", "gone.vtp"}) {
    const std::string index = "<VTKFile type=\"PPolyData\"><PPolyData><Piece Source=\"" + source +
                              "\"/></PPolyData></VTKFile>";
    EXPECT_TRUE(
        contains(message_of<Error>([&] { open_mesh_file(dir.write("b.pvtp", index)); }), source));
  }
}

TEST(VtpFile, HalfOfOneIsSaid) {
  const TempDir dir;
  for (const Form form : {Form::ascii, Form::base64, Form::zlib, Form::appended_raw,
                          Form::appended_base64, Form::appended_zlib}) {
    const std::string whole = VtkWriter(form).file();
    // Behind the arrays nothing is missed.
    const std::size_t end = whole.find(form >= Form::appended_raw ? "\n</AppendedData" : "</Polys");
    for (std::size_t left = 0; left + 8 < end; left += 7) {
      SCOPED_TRACE(left);
      message_of<Error>([&] { read_all(dir.write("a.vtp", whole.substr(0, left))); });
    }
  }
}

}  // namespace
}  // namespace isobrick
