#include "io/volumes/vdb/vdb_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <utility>

#include <isobrick/error.h>
#include "core/length_unit.h"
#include "core/printable.h"
#include "io/bytes/file.h"

namespace isobrick::inline v0 {
namespace {

static_assert(std::endian::native == std::endian::little, "OpenVDB's files are little endian");

constexpr std::string_view kMagic{" BDV\0\0\0\0", 8};
constexpr std::string_view kHalfSuffix = "_HalfFloat";
/// Between a name and the number of its repetition.
constexpr char kSeparator = '\x1e';
constexpr std::size_t kUuidBytes = 36;
/// A name, a type or a piece of metadata that is longer is damage.
constexpr std::uint32_t kMaxText = 1 << 20;
constexpr std::uint32_t kMaxItems = 1 << 16;

/// A type and the bytes of a value, by name.
using Metadata = std::map<std::string, std::pair<std::string, std::string>>;

std::string text_of(const Metadata& metadata, const std::string& name) {
  const auto found = metadata.find(name);
  return found != metadata.end() && found->second.first == "string" ? found->second.second : "";
}

/// Walks through the fields of a file.
class Fields {
 public:
  explicit Fields(const std::string& path)
      : path_(path), file_(open_input(path)), size_(file_.size()) {}

  std::uint64_t size() const { return size_; }
  std::uint64_t at() const { return at_; }
  void seek(std::uint64_t at) { at_ = at; }

  [[noreturn]] void damaged(const std::string& what) const {
    throw Error(fmt::format("'{}': no sound OpenVDB file: {} at byte {}", path_, what, at_));
  }

  std::string bytes(std::size_t count) {
    if (at_ > size() || count > size() - at_) damaged("it ends within its header");
    std::string text(count, '\0');
    file_.read_at(at_, std::as_writable_bytes(std::span(text)));
    at_ += count;
    return text;
  }
  template <class T>
  T number() {
    const std::string raw = bytes(sizeof(T));
    T value;
    std::memcpy(&value, raw.data(), sizeof(T));
    return value;
  }
  std::string text() {
    const auto length = number<std::uint32_t>();
    if (length > kMaxText) damaged(fmt::format("a text of {} bytes", length));
    return bytes(length);
  }
  std::uint64_t position() {
    const auto value = number<std::int64_t>();
    if (value < 0 || static_cast<std::uint64_t>(value) > size())
      damaged(fmt::format("the position {}", value));
    return static_cast<std::uint64_t>(value);
  }
  Metadata metadata() {
    const auto count = number<std::uint32_t>();
    if (count > kMaxItems) damaged(fmt::format("{} items of metadata", count));
    Metadata items;
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::string name = text(), type = text();
      items[name] = {type, text()};
    }
    return items;
  }

 private:
  const std::string& path_;
  File file_;
  std::uint64_t size_;
  std::uint64_t at_ = 0;
};

/// Messages show so many characters of a file's own text.
constexpr std::size_t kMaxShown = 100;
/// Of the name that a store keeps.
constexpr std::size_t kMaxKept = 1000;
std::string shown(std::string_view text) { return printable(text, kMaxShown); }

std::string shown_name(const std::string& unique, bool repeated) {
  const std::size_t separator = unique.find(kSeparator);
  const std::string name = shown(unique.substr(0, separator));
  if (separator == std::string::npos) return name;
  return repeated ? fmt::format("{}[{}]", name, shown(unique.substr(separator + 1))) : name;
}

void read_own_header(Fields& in, VdbGrid& grid) {
  const std::uint64_t next = in.at();
  in.seek(grid.begin);
  in.number<std::uint32_t>();  // how it is compressed
  const Metadata metadata = in.metadata();
  grid.transform = in.at();
  describe_vdb_texts(grid, text_of(metadata, "name"), text_of(metadata, "unit"),
                     text_of(metadata, "class"), in.text());
  in.seek(next);
}

VdbGrid read_grid(Fields& in) {
  VdbGrid grid;
  grid.unique_name = in.text();
  grid.type = shown(in.text());
  grid.half = grid.type.ends_with(kHalfSuffix);
  if (grid.half) grid.type.resize(grid.type.size() - kHalfSuffix.size());
  grid.parent = in.text();
  const std::uint64_t fields = in.at() + 3 * sizeof(std::int64_t);
  grid.begin = in.position();
  in.position();  // of its blocks
  grid.end = in.position();
  if (grid.begin < fields || grid.end < grid.begin) in.damaged("a grid outside of its place");
  read_own_header(in, grid);
  in.seek(grid.end);
  return grid;
}

VdbLayout read_layout(Fields& in) {
  if (in.bytes(kMagic.size()) != kMagic) in.damaged("not what such files begin with");
  VdbLayout layout;
  layout.version = in.number<std::uint32_t>();
  in.bytes(2 * sizeof(std::uint32_t));  // the library's own version
  layout.has_offsets = in.number<char>() != 0;
  return layout;
}

std::string list(const std::vector<VdbGrid>& grids) {
  std::vector<std::string> lines;
  for (const VdbGrid& grid : grids)
    lines.push_back(fmt::format("{} ({}{}{})", grid.name, grid.value_type(),
                                grid.grid_class.empty() ? "" : ", ", grid.grid_class));
  return fmt::format("{}", fmt::join(lines, "; "));
}

}  // namespace

std::string VdbGrid::value_type() const {
  if (!type.starts_with("Tree_")) return type;
  const std::string rest = type.substr(5);
  return rest.substr(0, rest.find('_'));
}

VdbLayout read_vdb_layout(const std::string& path) {
  Fields in(path);
  return read_layout(in);
}

std::vector<VdbGrid> read_vdb_header(const std::string& path) {
  Fields in(path);
  if (!read_layout(in).known()) return {};
  in.bytes(kUuidBytes);
  in.metadata();
  const auto count = in.number<std::uint32_t>();
  if (count > kMaxItems) in.damaged(fmt::format("{} grids", count));
  std::vector<VdbGrid> grids;
  for (std::uint32_t i = 0; i < count; ++i) grids.push_back(read_grid(in));
  name_vdb_grids(grids);
  return grids;
}

void name_vdb_grids(std::vector<VdbGrid>& grids) {
  std::map<std::string, int> times;
  for (const VdbGrid& grid : grids) ++times[shown_name(grid.unique_name, false)];
  for (VdbGrid& grid : grids)
    grid.name = shown_name(grid.unique_name, times[shown_name(grid.unique_name, false)] > 1);
}

void describe_vdb_texts(VdbGrid& grid, const std::string& name, const std::string& unit,
                        const std::string& grid_class, const std::string& map) {
  grid.own_name = printable(name, kMaxKept);
  grid.unit = unit_name(unit);
  grid.grid_class = shown(grid_class);
  grid.map = shown(map);
}

void check_vdb_memory(const std::string& path, const VdbGrid& grid, std::uint64_t needed,
                      const std::optional<std::uint64_t>& room) {
  constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;
  if (room && needed > *room)
    throw UsageError(fmt::format(
        "'{}': grid '{}' takes {} MiB in memory, more than the budget of {} MiB leaves: add "
        "--memory {}M",
        path, grid.name, needed / kMiB + 1, *room / kMiB, needed / kMiB * 5 / 4 + 256));
}

bool is_readable(const VdbGrid& grid) {
  static constexpr std::array<std::string_view, 7> kTypes{
      "Tree_half_5_4_3",  "Tree_float_5_4_3", "Tree_double_5_4_3", "Tree_int32_5_4_3",
      "Tree_int64_5_4_3", "Tree_bool_5_4_3",  "Tree_mask_5_4_3"};
  return std::find(kTypes.begin(), kTypes.end(), grid.type) != kTypes.end();
}

const VdbGrid& choose_vdb_grid(const std::string& path, const std::vector<VdbGrid>& grids,
                               const std::optional<std::string>& name) {
  const auto fits = [&](const VdbGrid& grid) {
    return name ? grid.name == shown(*name) : is_readable(grid);
  };
  if (grids.empty()) throw UsageError(fmt::format("'{}' holds no grids", path));
  const auto chosen = std::find_if(grids.begin(), grids.end(), fits);
  const auto count = std::count_if(grids.begin(), grids.end(), fits);
  if (count == 0 && name)
    throw UsageError(
        fmt::format("'{}' has no grid '{}'; it has {}", path, shown(*name), list(grids)));
  if (count == 0 || !is_readable(*chosen))
    throw UsageError(fmt::format(
        "'{}': only grids of half, float, double, int32, int64, bool and mask can be read, "
        "not {}",
        path, name ? chosen->value_type() : list(grids)));
  if (count > 1)
    throw UsageError(fmt::format("'{}' holds several grids: choose one with --grid NAME: {}", path,
                                 list(grids)));
  return *chosen;
}

}  // namespace isobrick
