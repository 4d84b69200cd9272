#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include <bit>
#include <cstring>
#include <filesystem>

#include "damaged_files.h"
#include "io/volumes/vdb/vdb_half_grid.h"
#include "io/volumes/vdb/vdb_writer.h"
#include "vdb_grids.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;

TEST_F(Vdb, AllTypes) {
  const auto f = make_grid<openvdb::FloatGrid>(-2.5F);
  expect_same<float>(*f, write({f}));
  const auto d = make_grid<openvdb::DoubleGrid>(0.1);
  expect_same<double>(*d, write({d}));
  const auto i = make_grid<openvdb::Int32Grid>(-7);
  expect_same<std::int32_t>(*i, write({i}));
  const auto b = make_grid<openvdb::BoolGrid>(true);
  expect_same<std::uint8_t>(*b, write({b}));
  const auto m = openvdb::MaskGrid::create();
  m->tree().topologyUnion(f->tree());
  expect_same<std::uint8_t>(*m, write({m}));
}

TEST_F(Vdb, GridsOfHalf) {
  namespace io = openvdb::io;
  register_vdb_half_grid();
  const auto grid = make_grid<VdbHalfGrid>(openvdb::math::half(-2.5F));
  add_inactive_values(*grid);
  for (const std::uint32_t values : {io::COMPRESS_NONE, io::COMPRESS_ZIP, io::COMPRESS_BLOSC})
    for (const std::uint32_t mask : {std::uint32_t{0}, std::uint32_t{io::COMPRESS_ACTIVE_MASK}}) {
      io::File file(dir / "v.vdb");
      file.setCompression(values | mask);
      file.write({grid});
      expect_same<float>(*grid, with_version(225));
    }
  EXPECT_EQ(open_source(dir / "v.vdb", {})->info().fill_value, -2.5);
}

TEST_F(Vdb, LongIntegersTakeTheTypeThatHoldsThem) {
  const auto grid = make_grid<openvdb::Int64Grid>(0);
  expect_same<std::int32_t>(*grid, write({grid}));
  auto accessor = grid->getAccessor();
  accessor.setValue({0, 0, 0}, std::int64_t{4000000000});
  expect_same<std::uint32_t>(*grid, write({grid}));
  accessor.setValue({0, 0, 1}, -(std::int64_t{1} << 50));
  expect_same<double>(*grid, write({grid}));
  accessor.setValue({0, 0, 2}, (std::int64_t{1} << 60) + 1);
  EXPECT_TRUE(contains(message_of<UsageError>([&] { open_source(write({grid}), {}); }),
                       "1152921504606846977"));
}

TEST_F(Vdb, ChoosesAmongSeveral) {
  const auto a = make_grid<openvdb::FloatGrid>(0), b = make_grid<openvdb::FloatGrid>(1);
  const auto c = openvdb::Vec3SGrid::create();
  a->setName("a");
  a->setGridClass(openvdb::GRID_LEVEL_SET);
  b->setName("b");
  c->setName("c");
  // The second one shares the tree of the first.
  const auto shared = openvdb::gridPtrCast<openvdb::FloatGrid>(a->copyGrid());
  shared->setName("shared");
  const std::string path = write({a, b, c, shared});
  const std::string list = message_of<UsageError>([&] { open_source(path, {}); });
  for (const char* part : {"a (float, level set)", "b (float", "c (vec3s", "--grid"})
    EXPECT_TRUE(contains(list, part)) << list;
  VolumeRequest request;
  request.grid = "a";
  expect_same<float>(*a, path, request);
  EXPECT_EQ(open_source(path, request)->info().grid_class, "level set");
  request.grid = "b";
  expect_same<float>(*b, path, request);
  EXPECT_EQ(open_source(path, request)->info().fill_value, 1);
  request.grid = "shared";
  expect_same<float>(*a, path, request);
  request.grid = "c";
  EXPECT_TRUE(contains(message_of<UsageError>([&] { open_source(path, request); }), "vec3s"));
  request.grid = "d";
  EXPECT_TRUE(contains(message_of<UsageError>([&] { open_source(path, request); }), "'d'"));
  EXPECT_TRUE(contains(
      message_of<UsageError>([&] { open_source(dir.write("r_1x1x1_uint8.raw", "x"), request); }),
      "--grid"));
  EXPECT_EQ(open_source(write({a, c}), {})->info().grid_class, "level set");
}

TEST_F(Vdb, KnowsWhereNothingIs) {
  const auto grid = openvdb::FloatGrid::create(2);
  auto accessor = grid->getAccessor();
  accessor.setValue({0, 0, 0}, 1);
  accessor.setValue({40000, 50000, 60000}, 1);
  grid->tree().fill(openvdb::CoordBBox({8192, 8192, 8192}, {8319, 8319, 8319}), 5);
  const auto source = open_source(write({grid}), {});
  EXPECT_TRUE(source->sparse());
  EXPECT_FALSE(source->is_fill({{0, 0, 0}, source->info().extent}));
  EXPECT_TRUE(source->is_fill({{8, 0, 0}, {40000, 8192, 8192}}));
  EXPECT_FALSE(source->is_fill({{8300, 8300, 8300}, {8400, 8400, 8400}}));
  EXPECT_TRUE(source->is_fill({{8320, 0, 0}, {40000, 50000, 60000}}));
  EXPECT_FALSE(source->is_fill({{0, 0, 0}, {1, 1, 1}}));
}

TEST_F(Vdb, KnowsWhatIsOfOneValue) {
  const auto grid = openvdb::FloatGrid::create(2);
  auto accessor = grid->getAccessor();
  accessor.setValue({0, 0, 0}, 1);
  accessor.setValue({40000, 50000, 60000}, 1);
  grid->tree().fill(openvdb::CoordBBox({8192, 8192, 8192}, {8447, 8447, 8319}), 5);
  const auto source = open_source(write({grid}), {});
  const auto value = [&](Int3 lo, Index edge) {
    const auto bits = source->constant({lo, lo + Int3{edge, edge, edge}});
    return bits ? std::optional(std::bit_cast<float>(static_cast<std::uint32_t>(*bits)))
                : std::nullopt;
  };
  EXPECT_EQ(value({8192, 8192, 8192}, 128), 5);
  EXPECT_EQ(value({8200, 8300, 8250}, 64), 5);  // across a border of nodes
  EXPECT_EQ(value({8191, 8192, 8192}, 64), std::nullopt);
  EXPECT_EQ(value({8192, 8192, 8300}, 64), std::nullopt);
  EXPECT_EQ(value({8, 0, 0}, 64), 2);
  EXPECT_EQ(value({12000, 12000, 12000}, 4096), 2);  // across a border of the root's children
  EXPECT_EQ(value({0, 0, 0}, 4), std::nullopt);      // a leaf
  EXPECT_EQ(value({8, 8, 8}, 39000), std::nullopt);
}

TEST_F(Vdb, ReadsEveryWayOfStoringLeaves) {
  namespace io = openvdb::io;
  const auto round_trip = [&](const openvdb::GridBase::Ptr& grid, std::uint32_t compression) {
    io::File file(dir / "v.vdb");
    file.setCompression(compression);
    file.write({grid});
    return std::string(dir / "v.vdb");
  };
  for (const bool as_half : {false, true})
    for (const std::uint32_t values : {io::COMPRESS_NONE, io::COMPRESS_ZIP, io::COMPRESS_BLOSC})
      for (const std::uint32_t mask : {std::uint32_t{0}, std::uint32_t{io::COMPRESS_ACTIVE_MASK}}) {
        const auto f = make_grid<openvdb::FloatGrid>(-2.5F);
        f->setSaveFloatAsHalf(as_half);
        add_inactive_values(*f);
        expect_same<float>(*f, round_trip(f, values | mask));
        const auto i = make_grid<openvdb::Int32Grid>(-7);
        add_inactive_values(*i);
        expect_same<std::int32_t>(*i, round_trip(i, values | mask));
      }
}

TEST_F(Vdb, ValuesOfLeavesStayInTheFile) {
  const auto grid = openvdb::DoubleGrid::create(0);
  auto accessor = grid->getAccessor();
  for (int z = 0; z < 128; z += 4)
    for (int y = 0; y < 128; y += 4)
      for (int x = 0; x < 128; x += 4) accessor.setValue({x, y, z}, x + 0.5 * y - z);
  const auto source = open_source(write({grid}), {});
  // Of 4096 leaves with 4 KiB of values each, the masks and the nodes above.
  EXPECT_GT(grid->memUsage(), std::size_t{16} << 20);
  EXPECT_LT(source->memory(), std::size_t{3} << 20);
  EXPECT_GT(source->memory(), std::size_t{4096} * 64);
}

TEST_F(Vdb, DamagedValuesAreNamedWhenTheyAreRead) {
  const auto grid = openvdb::FloatGrid::create(0);
  for (int i = 0; i < 512; ++i)
    grid->getAccessor().setValue({i >> 6, i >> 3 & 7, i & 7}, static_cast<float>(i % 7));
  const std::string path = write({grid});
  std::string bytes = dir.read("v.vdb");
  for (std::size_t at = bytes.size() - 40; at < bytes.size(); ++at) bytes[at] = '\xff';
  std::filesystem::remove(path);
  const auto source = open_source(dir.write("v.vdb", bytes), {});
  const Box3 all{{0, 0, 0}, source->info().extent};
  const std::string message = message_of<Error>([&] { read_box(*source, all); });
  EXPECT_TRUE(contains(message, "v.vdb': grid ")) << message;
}

TEST_F(Vdb, RefusesWhatDoesNotFit) {
  const std::string path = write({make_grid<openvdb::FloatGrid>(0)});
  VolumeRequest request;
  request.memory = 1000;
  EXPECT_TRUE(contains(message_of<UsageError>([&] { open_source(path, request); }), "--memory"));
}

TEST_F(Vdb, WritesWhatItReads) {
  const auto round_trip = [&]<class T>(T fill) {
    VolumeInfo info;
    info.extent = {37, 29, 33};
    info.type = scalar_type_of<T>;
    info.fill_value = static_cast<double>(fill);
    info.transform.spacing = {0.5, 2, 3};
    info.transform.origin = {1, -2, 3};
    info.transform.direction = {0, -1, 0, 1, 0, 0, 0, 0, 1};
    info.transform.unit = "millimeter";
    info.grid_class = "unknown";
    const auto value = [&](Int3 p) {
      if (p.x >= 8 && p.x < 24 && p.y < 16 && p.z < 8) return static_cast<T>(7);
      return p.z > 20 || p.y < 3 ? fill : sample_at<T>(p, info.extent);
    };
    const auto writer = make_vdb_writer_if_built(info, "density", 16 * kMiB);
    // Boxes that do not begin where leaves do, and what is never put.
    for (Index z = 0; z < 21; z += 7) {
      const Box3 box{{0, 0, z}, {37, 29, z + 7}};
      std::vector<T> samples;
      for_each_point(box, [&](Int3 p) { samples.push_back(value(p)); });
      writer->put(box, reinterpret_cast<const std::byte*>(samples.data()));
    }
    OutputFile file(dir / "out.vdb", true);
    writer->write(file);
    file.publish();
    const auto source = open_source(dir / "out.vdb", {});
    EXPECT_EQ(source->info().extent, info.extent);
    EXPECT_EQ(source->info().grid_class, "unknown");
    EXPECT_EQ(source->info().grid_name, "density");
    EXPECT_EQ(source->info().transform.unit, "millimeter");
    EXPECT_EQ(source->info().fill_value, info.fill_value);
    for (const Vec3d p : {Vec3d{0, 0, 0}, Vec3d{1, 0, 0}, Vec3d{0, 10, 20}}) {
      const Vec3d a = source->info().transform.apply(p), b = info.transform.apply(p);
      for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(a[axis], b[axis], 1e-12);
    }
    const std::string bytes = read_box(*source, {{0, 0, 0}, info.extent});
    std::size_t at = 0, different = 0;
    const ScalarType type = source->info().type;
    for_each_point({{0, 0, 0}, info.extent}, [&](Int3 p) {
      visit_scalar(type, [&](auto tag) {
        typename decltype(tag)::type got;
        std::memcpy(&got, bytes.data() + at, sizeof(got));
        at += sizeof(got);
        different += static_cast<double>(got) != static_cast<double>(value(p)) ? 1 : 0;
      });
    });
    EXPECT_EQ(different, 0U);
    return type;
  };
  EXPECT_EQ(round_trip(0.25F), ScalarType::f32);
  EXPECT_EQ(round_trip(-1e300), ScalarType::f64);
  EXPECT_EQ(round_trip(std::int32_t{-5}), ScalarType::i32);
  EXPECT_EQ(round_trip(std::uint8_t{0}), ScalarType::i32);
  EXPECT_EQ(round_trip(std::int16_t{3}), ScalarType::i32);
  round_trip(std::uint32_t{9});
}

TEST_F(Vdb, CountsTheNodesThatItMakes) {
  VolumeInfo info;
  info.extent = {5000, 16, 16};  // two of the largest nodes
  info.type = ScalarType::f32;
  const std::vector<float> ones(512, 1);
  /// The smallest budget within which constant leaves can be put at these places.
  const auto least = [&](const std::vector<Index>& places) {
    std::uint64_t lo = 0, hi = 16 * kMiB;
    while (hi - lo > 1) {
      const std::uint64_t budget = (lo + hi) / 2;
      try {
        const auto writer = make_vdb_writer_if_built(info, "v", budget);
        for (const Index x : places)
          writer->put({{x, 0, 0}, {x + 8, 8, 8}}, reinterpret_cast<const std::byte*>(ones.data()));
        hi = budget;
      } catch (const UsageError&) {
        lo = budget;
      }
    }
    return hi;
  };
  const std::uint64_t empty = least({}), tile = least({2048});
  EXPECT_GT(empty, 2 * 32 * 32 * 32 * sizeof(void*));
  EXPECT_LT(empty, 4 * kMiB);
  // A constant leaf is a tile, which needs the node that it is in.
  EXPECT_GE(tile - empty, 16 * 16 * 16 * sizeof(void*));
  EXPECT_EQ(least({2048, 2056}), tile);
}

TEST_F(Vdb, DamagedFiles) {
  const auto grid = openvdb::FloatGrid::create(0);
  for (int i = 0; i < 20; ++i)
    grid->getAccessor().setValue({i * 9, i, 3 * i}, 1.0F + static_cast<float>(i));
  const std::string bytes = [&] {
    write({grid});
    return dir.read("v.vdb");
  }();
  for (std::size_t size = 0; size < bytes.size(); size += 1 + bytes.size() / 300) {
    std::filesystem::remove(dir / "v.vdb");
    const std::string path = dir.write("v.vdb", bytes.substr(0, size));
    EXPECT_TRUE(contains(message_of<Error>([&] { open_source(path, {}); }), "v.vdb")) << size;
  }
}

TEST_F(Vdb, Mutations) {
  const auto small = openvdb::FloatGrid::create(2);
  for (int i = 0; i < 60; ++i)
    small->getAccessor().setValue({i, i / 2, i % 9}, static_cast<float>(i) / 3);
  const auto mask = openvdb::MaskGrid::create();
  mask->tree().topologyUnion(small->tree());
  const auto expect_no_crash = [&](const openvdb::GridBase::Ptr& grid, std::uint32_t compression) {
    openvdb::io::File file(dir / "v.vdb");
    file.setCompression(compression);
    file.write({grid});
    const std::string bytes = dir.read("v.vdb");
    std::filesystem::remove(dir / "v.vdb");
    expect_mutations_are_no_crash(dir, "m.vdb", bytes);
  };
  expect_no_crash(small, openvdb::io::COMPRESS_NONE);
  expect_no_crash(small, openvdb::io::COMPRESS_ZIP | openvdb::io::COMPRESS_ACTIVE_MASK);
  expect_no_crash(small, openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
  expect_no_crash(mask, openvdb::io::COMPRESS_NONE);
}

}  // namespace
}  // namespace isobrick
