#include "io/volumes/raw/nifti_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

#include <isobrick/error.h>
#include "io/bytes/byte_order.h"
#include "io/volumes/raw/text_header.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::uint32_t kBytes1 = 348, kBytes2 = 540;

/// Fields by their offset, in native byte order.
class Fields {
 public:
  Fields(std::span<const std::byte> head, bool swap) : head_(head), swap_(swap) {}

  template <class T>
  T at(std::size_t offset) const {
    T value{};
    std::byte bytes[sizeof(T)];
    std::memcpy(bytes, head_.data() + offset, sizeof(T));
    if (swap_) swap_byte_order(bytes, 1, sizeof(T));
    std::memcpy(&value, bytes, sizeof(T));
    return value;
  }

 private:
  std::span<const std::byte> head_;
  bool swap_;
};

/// The fields of both versions that matter, as wide as they come.
struct Numbers {
  Index dim[8];
  double pixdim[8];
  int type = 0;
  double offset = 0, slope = 0, intercept = 0;
  int units = 0, qform = 0, sform = 0, intent = 0;
  double quaternion[3], qoffset[3], srow[12];
};

/// Where the fields lie, and of which types they are.
template <class Dim, class Real, class Code>
struct Offsets {
  std::size_t dim, pixdim, type, slope, intercept, qform, sform, quaternion, qoffset, srow;
};

template <class Dim, class Real, class Code>
Numbers read_numbers(const Fields& fields, const Offsets<Dim, Real, Code>& o) {
  Numbers n;
  const auto read = [&]<class T>(T, std::size_t offset, auto& to) {
    for (std::size_t i = 0; i < std::size(to); ++i)
      to[i] = fields.template at<T>(offset + i * sizeof(T));
  };
  read(Dim{}, o.dim, n.dim);
  read(Real{}, o.pixdim, n.pixdim);
  read(Real{}, o.quaternion, n.quaternion);
  read(Real{}, o.qoffset, n.qoffset);
  read(Real{}, o.srow, n.srow);
  n.type = fields.at<std::int16_t>(o.type);
  n.slope = fields.at<Real>(o.slope);
  n.intercept = fields.at<Real>(o.intercept);
  n.qform = static_cast<int>(fields.at<Code>(o.qform));
  n.sform = static_cast<int>(fields.at<Code>(o.sform));
  return n;
}

Numbers read_version_1(const Fields& fields) {
  Numbers n = read_numbers(fields, Offsets<std::int16_t, float, std::int16_t>{
                                       40, 76, 70, 112, 116, 252, 254, 256, 268, 280});
  n.offset = fields.at<float>(108);
  n.units = fields.at<std::uint8_t>(123);
  n.intent = fields.at<std::int16_t>(68);
  return n;
}

Numbers read_version_2(const Fields& fields) {
  Numbers n = read_numbers(fields, Offsets<std::int64_t, double, std::int32_t>{
                                       16, 104, 12, 176, 184, 344, 348, 352, 376, 400});
  n.offset = static_cast<double>(fields.at<std::int64_t>(168));
  n.units = fields.at<std::int32_t>(500);
  n.intent = fields.at<std::int32_t>(504);
  return n;
}

struct Version {
  int number = 0;  ///< 0: not NIfTI
  bool swap = false, detached = false, analyze = false;
};

Version find_version(std::span<const std::byte> head) {
  Version version;
  if (head.size() < kBytes1) return version;
  const auto text = [&](std::size_t at) {
    return std::string_view(reinterpret_cast<const char*>(head.data()) + at, 4);
  };
  for (const bool swap : {false, true}) {
    const auto bytes = Fields(head, swap).at<std::uint32_t>(0);
    const std::size_t magic = bytes == kBytes1 ? 344 : 4;
    const char digit = bytes == kBytes1 ? '1' : '2';
    if (bytes != kBytes1 && (bytes != kBytes2 || head.size() < kBytes2)) continue;
    const std::string_view word = text(magic);
    const bool single = word.starts_with("n+"), pair = word.starts_with("ni");
    if ((single || pair) && word[2] == digit && word[3] == '\0')
      return {digit - '0', swap, pair, false};
    version.analyze |= bytes == kBytes1;
  }
  return version;
}

ScalarType read_type(const std::string& path, int code) {
  constexpr std::pair<int, ScalarType> types[] = {{2, ScalarType::u8},     {4, ScalarType::i16},
                                                  {8, ScalarType::i32},    {16, ScalarType::f32},
                                                  {64, ScalarType::f64},   {256, ScalarType::i8},
                                                  {512, ScalarType::u16},  {768, ScalarType::u32},
                                                  {1024, ScalarType::i64}, {1280, ScalarType::u64}};
  constexpr std::pair<int, const char*> others[] = {{1, "bits"},
                                                    {32, "complex numbers"},
                                                    {128, "RGB colours"},
                                                    {1536, "128-bit floats"},
                                                    {1792, "complex numbers"},
                                                    {2048, "complex numbers"},
                                                    {2304, "RGBA colours"}};
  for (const auto& [known, type] : types)
    if (code == known) return type;
  for (const auto& [known, name] : others)
    if (code == known)
      header_error(path,
                   fmt::format("samples that are {} (datatype {}) are not supported", name, code));
  header_error(path, fmt::format("samples of the unknown datatype {}", code));
}

std::vector<ArrayAxis> read_axes(const std::string& path, const Numbers& n) {
  if (n.dim[0] < 1 || n.dim[0] > 7)
    header_error(path, fmt::format("{} dimensions, 1 to 7 are possible", n.dim[0]));
  std::vector<ArrayAxis> axes;
  for (Index i = 1; i <= std::max<Index>(n.dim[0], 3); ++i)
    axes.push_back({i <= n.dim[0] ? n.dim[i] : 1, i <= 3   ? AxisRole::space
                                                  : i == 4 ? AxisRole::time
                                                           : AxisRole::channel});
  return axes;
}

/// The world vectors of the axes by quaternion and spacing.
void set_by_qform(const std::string& path, const Numbers& n, Transform& transform) {
  const double b = n.quaternion[0], c = n.quaternion[1], d = n.quaternion[2];
  const double rest = 1 - (b * b + c * c + d * d);
  if (!(rest > -1e-5)) header_error(path, "qform: the quaternion is longer than 1");
  const double a = std::sqrt(std::max(rest, 0.0));
  const double handed = n.pixdim[0] < 0 ? -1 : 1;
  const Vec3d axes[3] = {
      Vec3d{a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c)} * n.pixdim[1],
      Vec3d{2 * (b * c - a * d), a * a + c * c - b * b - d * d, 2 * (c * d + a * b)} * n.pixdim[2],
      Vec3d{2 * (b * d + a * c), 2 * (c * d - a * b), a * a + d * d - b * b - c * c} *
          (n.pixdim[3] * handed)};
  set_axes(path, transform, axes);
  transform.origin = {n.qoffset[0], n.qoffset[1], n.qoffset[2]};
}

void set_by_sform(const std::string& path, const Numbers& n, Transform& transform) {
  const double* s = n.srow;
  const Vec3d axes[3] = {{s[0], s[4], s[8]}, {s[1], s[5], s[9]}, {s[2], s[6], s[10]}};
  set_axes(path, transform, axes);
  transform.origin = {s[3], s[7], s[11]};
}

Transform read_transform(const std::string& path, const Numbers& n) {
  constexpr std::string_view units[] = {"", "meter", "millimeter", "micrometer"};
  Transform transform;
  transform.unit = units[(n.units & 7) < 4 ? n.units & 7 : 0];
  if (n.sform > 0) {
    try {
      set_by_sform(path, n, transform);
      return transform;
    } catch (const UsageError&) {
      // Sheared: qform cannot be.
      if (n.qform <= 0) throw;
    }
  }
  if (n.qform > 0) {
    set_by_qform(path, n, transform);
    return transform;
  }
  for (int i = 0; i < 3; ++i) {
    const double spacing = std::abs(n.pixdim[i + 1]);
    transform.spacing[i] = spacing > 0 && std::isfinite(spacing) ? spacing : 1;
  }
  return transform;
}

ValueScale read_scale(const std::string& path, const Numbers& n) {
  if (n.slope == 0 || !std::isfinite(n.slope)) return {};  // not scaled
  if (!std::isfinite(n.intercept)) header_error(path, "scl_inter is not finite");
  return {n.slope, n.intercept};
}

std::uint64_t read_offset(const std::string& path, const Numbers& n, const Version& version) {
  if (!(n.offset >= 0 && n.offset < 0x1p62))
    header_error(path, fmt::format("vox_offset {} makes no sense", n.offset));
  const auto offset = static_cast<std::uint64_t>(n.offset);
  // Samples follow the header and four bytes that mark extensions.
  const std::uint64_t least =
      version.detached ? 0
                       : static_cast<std::uint64_t>(version.number == 1 ? kBytes1 : kBytes2) + 4;
  if (offset != 0 && offset < least)
    header_error(path, fmt::format("vox_offset {} lies within the header", offset));
  return std::max(offset, least);
}

}  // namespace

bool is_nifti(std::span<const std::byte> head) { return find_version(head).number != 0; }

bool is_analyze(std::span<const std::byte> head) {
  const Version version = find_version(head);
  return version.number == 0 && version.analyze;
}

bool is_nifti_pair(std::span<const std::byte> head) { return find_version(head).detached; }

NiftiHeader parse_nifti_header(const std::string& path, std::span<const std::byte> head,
                               const Selection& selection) {
  const Version version = find_version(head);
  if (version.number == 0)
    header_error(path, version.analyze ? kAnalyzeRefusal : "not a NIfTI header");
  const Fields fields(head, version.swap);
  const Numbers n = version.number == 1 ? read_version_1(fields) : read_version_2(fields);
  NiftiHeader header;
  header.view = select_volume(path, read_axes(path, n), selection);
  header.type = read_type(path, n.type);
  header.swap = version.swap;
  header.detached = version.detached;
  header.offset = read_offset(path, n, version);
  header.scale = read_scale(path, n);
  constexpr int kLabelIntent = 1002;
  header.is_label_image = n.intent == kLabelIntent;
  header.transform = read_transform(path, n);
  return header;
}

}  // namespace isobrick
