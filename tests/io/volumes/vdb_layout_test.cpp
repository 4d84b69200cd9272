#include <openvdb/io/Stream.h>

#include <sstream>

#include "damaged_files.h"
#include "vdb_grids.h"

// OpenVDB files of other versions, and streams.
namespace isobrick::inline v0 {
namespace {

using VdbLayouts = Vdb;

TEST_F(VdbLayouts, Version225IsLaidOutAs224) {
  const auto grid = make_grid<openvdb::FloatGrid>(-2.5F);
  write({grid});
  ::testing::internal::CaptureStderr();
  ::testing::internal::CaptureStdout();
  expect_same<float>(*grid, with_version(225));
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
}

/// A layout that we do not know is left to OpenVDB's own reader.
TEST_F(VdbLayouts, LaterVersionsAreReadByOpenVdb) {
  const auto grid = make_grid<openvdb::FloatGrid>(-2.5F);
  add_inactive_values(*grid);
  for (const std::uint32_t version : {226U, 300U}) {
    write({grid});
    ::testing::internal::CaptureStderr();
    ::testing::internal::CaptureStdout();
    expect_same<float>(*grid, with_version(version));
    EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
    EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
  }
  std::string bytes = dir.read("v.vdb");
  std::filesystem::remove(dir / "v.vdb");
  const std::string cut = dir.write("cut.vdb", bytes.substr(0, bytes.size() / 2));
  const std::string message = message_of<Error>([&] { open_source(cut, {}); });
  EXPECT_TRUE(contains(message, "cut.vdb' is an OpenVDB file of version 300")) << message;
  EXPECT_TRUE(contains(message, "it ends too early")) << message;
  write({grid});
  message_of<Error>([&] { open_source(with_version(150), {}); });
}

TEST_F(VdbLayouts, StreamsAreReadByOpenVdb) {
  const auto stream = [&](const openvdb::GridCPtrVec& grids) {
    std::ostringstream out;
    openvdb::io::Stream(out).write(grids);
    std::filesystem::remove(dir / "s.vdb");
    return dir.write("s.vdb", out.str());
  };
  const auto f = make_grid<openvdb::FloatGrid>(-2.5F);
  add_inactive_values(*f);
  expect_same<float>(*f, stream({f}));
  const auto half = make_grid<openvdb::FloatGrid>(0);
  half->setSaveFloatAsHalf(true);
  expect_same<float>(*half, stream({half}));
  const auto d = make_grid<openvdb::DoubleGrid>(0.1);
  expect_same<double>(*d, stream({d}));
  const auto l = make_grid<openvdb::Int64Grid>(0);
  expect_same<std::int32_t>(*l, stream({l}));
  const auto b = make_grid<openvdb::BoolGrid>(true);
  expect_same<std::uint8_t>(*b, stream({b}));
  const auto m = openvdb::MaskGrid::create();
  m->tree().topologyUnion(f->tree());
  expect_same<std::uint8_t>(*m, stream({m}));

  // Several, one of which shares the tree of another, with all that is known of them.
  f->setName("f");
  f->setGridClass(openvdb::GRID_LEVEL_SET);
  f->setTransform(openvdb::math::Transform::createLinearTransform(0.5));
  f->insertMeta("unit", openvdb::StringMetadata("millimeter"));
  d->setName("d");
  const auto shared = openvdb::gridPtrCast<openvdb::FloatGrid>(f->copyGrid());
  shared->setName("shared");
  const auto vectors = openvdb::Vec3SGrid::create();
  vectors->setName("v");
  const std::string path = stream({f, d, vectors, shared});
  EXPECT_TRUE(contains(message_of<UsageError>([&] { open_source(path, {}); }),
                       "f (float, level set); d (double); v (vec3s); shared (float"));
  VolumeRequest request;
  for (const char* name : {"f", "shared"}) {
    request.grid = name;
    expect_same<float>(*f, path, request);
  }
  request.grid = "f";
  const VolumeInfo info = open_source(path, request)->info();
  EXPECT_EQ(info.grid_class, "level set");
  EXPECT_EQ(info.grid_name, "f");
  EXPECT_EQ(info.transform.unit, "millimeter");
  EXPECT_EQ(info.transform.spacing, (Vec3d{0.5, 0.5, 0.5}));
}

/// The values of leaves are held, too.
TEST_F(VdbLayouts, WhatOpenVdbReadsCountsInTheBudget) {
  const auto grid = openvdb::DoubleGrid::create(0);
  for (int i = 0; i < 512; ++i) grid->getAccessor().setValue({8 * i, 0, 0}, i);
  write({grid});
  const std::string path = with_version(226);
  const auto source = open_source(path, {});
  EXPECT_GT(source->memory(), std::size_t{512} * 4096);
  EXPECT_GE(source->memory() * 11 / 10, grid->memUsage());
  VolumeRequest request;
  request.memory = source->memory() - 1;
  EXPECT_TRUE(contains(message_of<UsageError>([&] { open_source(path, request); }), "--memory"));
  request.memory = source->memory();
  EXPECT_EQ(open_source(path, request)->info().extent, (Int3{511 * 8 + 1, 1, 1}));
}

}  // namespace
}  // namespace isobrick
