#include "io/bytes/parted_output.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "io/bytes/leftovers.h"
#include "io/bytes/xml_text.h"
#include "io/meshes/gltf/glb_scene.h"
#include "io/meshes/vtp_sink.h"
#include "temp_dir.h"
#include "tests/io/meshes/test_meshes.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;
using Names = std::vector<std::string>;

void write_parts(PartedOutput& out, int parts, const std::string& text) {
  for (int i = 0; i < parts; ++i) {
    FileWriter part = out.create_part(part_name(static_cast<unsigned>(i), 0, ".x"));
    part.append(text + std::to_string(i));
    part.flush();
  }
  out.index().writer().append(text);
}

TEST(PartedOutput, AppearsOnlyWhenPublished) {
  const TempDir dir;
  {
    PartedOutput out(dir / "a", false);
    write_parts(out, 2, "p");
    for (const std::string& name : dir.list()) EXPECT_TRUE(contains(name, ".partial-")) << name;
    EXPECT_EQ(out.reference("part_1.x"), "a.parts/part_1.x");
    out.publish();
  }
  EXPECT_EQ(dir.list(), (Names{"a", "a.parts"}));
  EXPECT_EQ(dir.read("a.parts/part_1.x"), "p1");
  EXPECT_EQ(dir.read("a"), "p");
}

TEST(PartedOutput, LeavesNothingWhenGivenUp) {
  const TempDir dir;
  {
    PartedOutput out(dir / "a", false);
    write_parts(out, 2, "p");
  }
  EXPECT_EQ(dir.list(), Names{});
}

TEST(PartedOutput, ReplacesThePartsOfBefore) {
  const TempDir dir;
  const auto make = [&](int parts, const std::string& text) {
    PartedOutput out(dir / "a", true);
    write_parts(out, parts, text);
    out.publish();
  };
  make(3, "old");
  make(1, "new");
  // Never in the folder that the old file names.
  EXPECT_EQ(dir.list(), (Names{"a", "a.parts-2"}));
  EXPECT_EQ(dir.read("a.parts-2/part_0.x"), "new0");
  EXPECT_FALSE(fs::exists(dir / "a.parts-2/part_1.x"));
  make(2, "third");
  EXPECT_EQ(dir.list(), (Names{"a", "a.parts"}));
  make(0, "none");
  EXPECT_EQ(dir.list(), Names{"a"});
}

TEST(PartedOutput, KeepsWhatIsNotItsOwn) {
  const TempDir dir;
  fs::create_directory(dir / "a.parts");
  EXPECT_TRUE(contains(message_of([&] { PartedOutput(dir / "a", false); }), "exists"));
  for (const char* name :
       {"notes.txt", "part_.x", "part_1x", "part_1", "part_1_.x", "part__1.x", "part_1_2_3.x"}) {
    dir.write(std::string("a.parts/") + name, "mine");
    EXPECT_TRUE(contains(message_of([&] { PartedOutput(dir / "a", true); }), name));
    fs::remove(dir / (std::string("a.parts/") + name));
  }
  fs::create_directory(dir / "a.parts/part_1.x");
  message_of([&] { PartedOutput(dir / "a", true); });
  fs::create_symlink("/tmp", dir / "b.parts");
  message_of([&] { PartedOutput(dir / "b", true); });
  EXPECT_EQ(dir.list(), (Names{"a.parts", "b.parts"}));
}

TEST(PartedOutput, RemovesWhatAKilledProcessLeft) {
  const TempDir dir;
  fs::create_directory(dir / "a.parts");
  dir.write("a.parts/part_0.x", "left");
  message_of([&] { PartedOutput(dir / "a", false); });
  // The file under its temporary name shows that nobody finished this output.
  const std::string file = create_temporary_file(dir / "a").path;
  const std::string parts = create_temporary_folder(dir / "a.parts").path;
  const std::string mine = fs::path(create_temporary_folder(dir / "a.parts").path).filename();
  dir.write(fs::path(parts).filename().string() + "/part_0.x", "left");
  dir.write(mine + "/thesis.tex", "mine");
  PartedOutput out(dir / "a", false);
  write_parts(out, 1, "new");
  out.publish();
  EXPECT_EQ(dir.list(), (Names{"a", "a.parts", mine}));
  EXPECT_FALSE(fs::exists(file) || fs::exists(parts));
}

TEST(PartedOutput, WhatAppearedInTheMeantimeStays) {
  const TempDir dir;
  {
    PartedOutput out(dir / "a", false);
    write_parts(out, 1, "p");
    dir.write("a", "somebody else's");
    EXPECT_TRUE(contains(message_of([&] { out.publish(); }), "exists"));
  }
  EXPECT_EQ(dir.list(), Names{"a"});
  {
    PartedOutput out(dir / "b", false);
    write_parts(out, 1, "p");
    fs::create_directory(dir / "b.parts");
    message_of<Error>([&] { out.publish(); });
  }
  EXPECT_EQ(dir.list(), (Names{"a", "b.parts"}));
}

TEST(XmlText, TakesUtf8AndNothingElse) {
  for (const char* text : {"", "a b", "\xc3\xa4\xe2\x82\xac\xf0\x9f\xa7\xb1", "<&>\"'"})
    EXPECT_TRUE(is_xml_text(text)) << text;
  for (const char* text : {"a\nb", "\x01", "\x7f", "\xff", "\xc3", "\xc0\xaf", "\xed\xa0\x80",
                           "\xef\xbf\xbf", "\xf5\x80\x80\x80", "\xe2\x82", "\xc2\x80"})
    EXPECT_FALSE(is_xml_text(text)) << text;
  EXPECT_EQ(xml_escaped("<a&\"b'>"), "&lt;a&amp;&quot;b&apos;&gt;");
  EXPECT_EQ(percent_encoded("a b%/\xc3\xa4?#.bin"), "a%20b%25/%C3%A4%3F%23.bin");
}

TEST(PvtpSink, RefusesANameThatXmlCannotHold) {
  const TempDir dir;
  for (const char* name : {"a\nb.pvtp", "\xff.pvtp"})
    EXPECT_TRUE(contains(message_of([&] { PvtpSink(dir / name, false); }), "XML"));
  EXPECT_EQ(dir.list(), Names{});
}

}  // namespace
}  // namespace isobrick
