#include "viewer/app/bookmarks.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include "tests/io/bytes/temp_dir.h"

namespace isobrick::inline v0 {
namespace {

Bookmark jaw() {
  Bookmark b{"jaw", Camera({1, 2, 3}, {0.5, 0, -1}, {0, 0, 1}), {}};
  b.camera.field_of_view = 42;
  b.camera.orthographic = true;
  b.settings.surfaces = {{127.25, {0.1f, 0.2f, 0.3f}, 0.5f, true}, {-3e-7, {1, 1, 1}, 1, false}};
  b.settings.axis_clips[1] = {true, 0.25f, false};
  b.settings.planes = {{true, {{1, -2, 0.5}, 12.5}}, {false, {{0, 0, 1}, -3}}};
  b.settings.slices[2] = {true, 0.75f};
  b.settings.region_on = true;
  b.settings.region_hi = {0.5f, 1, 0.75f};
  b.settings.edges = true;
  b.settings.pixel_error = 3;
  b.settings.finest_level = 2;
  return b;
}

TEST(Bookmarks, ComeBackAsTheyWere) {
  const TempDir dir;
  Bookmarks(dir / "deep/er/b.json", dir / "a.zarr").add(jaw());
  const Bookmarks again(dir / "deep/er/b.json", dir / "a.zarr");
  ASSERT_EQ(again.list().size(), 1u);
  EXPECT_EQ(again.list()[0].name, "jaw");
  EXPECT_EQ(to_json(again.list()[0].settings).dump(), to_json(jaw().settings).dump());
  EXPECT_EQ(to_json(again.list()[0].camera).dump(), to_json(jaw().camera).dump());
}

TEST(Bookmarks, HaveALevelThatAStoreMayHave) {
  nlohmann::ordered_json json = to_json(jaw().settings);
  EXPECT_EQ(view_settings_from(json).finest_level, 2);
  json["finest_level"] = -1;
  EXPECT_THROW(view_settings_from(json), Error);
}

TEST(Bookmarks, AreTheirStores) {
  const TempDir dir;
  Bookmarks a(dir / "b.json", dir / "a.zarr"), b(dir / "b.json", dir / "b.zarr");
  a.add(jaw());
  Bookmark other = jaw();
  other.name = "brow";
  b.add(other);
  a.add(jaw());  // in place of the first
  EXPECT_EQ(Bookmarks(dir / "b.json", dir / "a.zarr").list().size(), 1u);
  EXPECT_EQ(Bookmarks(dir / "b.json", dir / "b.zarr").list().at(0).name, "brow");
  b.remove(0);
  EXPECT_TRUE(Bookmarks(dir / "b.json", dir / "b.zarr").list().empty());
  EXPECT_EQ(Bookmarks(dir / "b.json", dir / "a.zarr").list().size(), 1u);
}

TEST(Bookmarks, RefuseWhatIsNone) {
  const TempDir dir;
  for (const char* text : {"", "[]", "{\"", "nonsense"}) {
    dir.write("b.json", text);
    EXPECT_THROW(Bookmarks(dir / "b.json", dir / "a.zarr"), Error) << text;
  }
  nlohmann::ordered_json json = to_json(jaw().settings);
  for (const char* field : {"surfaces", "cuts", "planes", "window", "region", "pixel_error"}) {
    nlohmann::ordered_json broken = json;
    broken[field] = "x";
    EXPECT_THROW(view_settings_from(broken), Error) << field;
    broken.erase(field);
    EXPECT_THROW(view_settings_from(broken), Error) << field;
  }
  const auto refuse = [&](const char* place, const char* value) {
    nlohmann::ordered_json broken = json;
    broken[nlohmann::ordered_json::json_pointer(place)] = nlohmann::ordered_json::parse(value);
    EXPECT_THROW(view_settings_from(broken), Error) << place << ' ' << value;
  };
  refuse("/surfaces/0/opacity", "1.5");
  refuse("/surfaces/0/colour", "[0, -1, 0]");
  refuse("/cuts/1/place", "2");
  refuse("/slices/2/place", "-0.5");
  refuse("/region/hi", "[1, 1, 1e30]");
  refuse("/pixel_error", "0");
  EXPECT_THROW(camera_from(nlohmann::ordered_json::object()), Error);
}

TEST(Bookmarks, StayAsTheyAreWhenTheyCannotBeWritten) {
  const TempDir dir;
  Bookmarks bookmarks(dir / "b.json", dir / "a.zarr");
  bookmarks.add(jaw());
  dir.write("b.json", "nonsense");
  Bookmark other = jaw();
  other.name = "brow";
  EXPECT_THROW(bookmarks.add(other), Error);
  EXPECT_THROW(bookmarks.remove(0), Error);
  ASSERT_EQ(bookmarks.list().size(), 1u);
  EXPECT_EQ(bookmarks.list()[0].name, "jaw");
  std::filesystem::remove(dir / "b.json");
  other.settings.surfaces[0].opacity = 1.5f;
  EXPECT_THROW(bookmarks.add(other), Error);
  EXPECT_EQ(bookmarks.list().size(), 1u);
  EXPECT_FALSE(std::filesystem::exists(dir / "b.json"));
}

}  // namespace
}  // namespace isobrick
