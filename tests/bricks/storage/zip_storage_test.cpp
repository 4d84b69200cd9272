#include <gtest/gtest.h>

#include <cstdlib>
#include <random>

#include "tests/bricks/storage/storages.h"
#include "tests/bricks/store_fixture.h"
#include "tests/io/bytes/temp_dir.h"
#include "tests/io/volumes/damaged_files.h"

namespace isobrick::test {
namespace {

std::string refusal(const std::string& zip) {
  const std::string message = message_of<Error>([&] { zip_in_memory(zip); });
  EXPECT_TRUE(contains(message, "'memory:/x.zip'")) << message;
  EXPECT_FALSE(contains(message, "\n")) << message;
  return message;
}

TEST(ZipStorage, CompressedAndEncryptedEntriesAreNamed) {
  ZipWriter zip;
  zip.add("zarr.json", "x", {.method = 8});
  zip.add("0/zarr.json", "x", {.flags = 1});
  zip.add("0/c/0", "x");
  const auto storage = zip_in_memory(zip.finish());
  EXPECT_TRUE(storage->open("0/c/0"));
  const std::string compressed = message_of<Error>([&] { storage->open("zarr.json"); });
  EXPECT_TRUE(contains(compressed, "'memory:/x.zip:/zarr.json' is compressed")) << compressed;
  EXPECT_TRUE(contains(compressed, "zip -0 -r")) << compressed;
  EXPECT_TRUE(contains(message_of<Error>([&] { storage->open("0/zarr.json"); }), "is encrypted"));
}

TEST(ZipStorage, FoldersAndACommentAreNoEntries) {
  ZipWriter zip;
  zip.add("0/", "");
  zip.add("0/zarr.json", "x");
  zip.add("zarr.json", "x");
  for (const std::string& comment : {std::string("a comment"), std::string(65535, 'P')}) {
    const auto storage = zip_in_memory(zip.finish(comment));
    EXPECT_FALSE(storage->open("0/"));
    EXPECT_EQ(storage->list("0"), std::vector<std::string>{"zarr.json"});
  }
}

TEST(ZipStorage, AStoreLiesAtTheRootOrInATopFolder) {
  const auto list = [](std::initializer_list<const char*> names) {
    ZipWriter zip;
    for (const char* name : names) zip.add(name, "x");
    return zip.finish();
  };
  const auto top = zip_in_memory(list({"README", "__MACOSX/a.zarr/x", "a.zarr/.zattrs"}));
  EXPECT_TRUE(top->open(".zattrs"));
  EXPECT_FALSE(top->open("README"));
  EXPECT_EQ(top->name_of("0/.zarray"), "memory:/x.zip:/a.zarr/0/.zarray");
  EXPECT_EQ(top->list(""), std::vector<std::string>{".zattrs"});
  EXPECT_TRUE(
      zip_in_memory(list({"zarr.json", "a/zarr.json", "b/zarr.json"}))->open("a/zarr.json"));
  const std::string two = refusal(list({"a/zarr.json", "b/zarr.json"}));
  EXPECT_TRUE(contains(two, "several stores, 'a/' and 'b/'")) << two;
}

TEST(ZipStorage, NamesThatLeadOutAreRefused) {
  for (const std::string& name :
       {std::string("/zarr.json"), std::string("../zarr.json"), std::string("a/../../b"),
        std::string("a/.."), std::string(""), std::string("a\0b", 3), std::string(5000, 'a'),
        std::string("..\n")}) {
    ZipWriter zip;
    zip.add("zarr.json", "x");
    zip.add(name, "x");
    if (name == "..\n")
      EXPECT_TRUE(zip_in_memory(zip.finish()));
    else
      EXPECT_TRUE(contains(refusal(zip.finish()), "is no relative path")) << name;
  }
}

TEST(ZipStorage, NamesThatAreNoKeysAreRefused) {
  for (const char* name : {"./zarr.json", "0/./zarr.json", "0//zarr.json", "0/."}) {
    ZipWriter zip;
    zip.add("zarr.json", "x");
    zip.add(name, "x");
    EXPECT_TRUE(contains(refusal(zip.finish()), "has an empty part or '.'")) << name;
  }
  ZipWriter folders;
  for (const char* name : {"./", "0/", "zarr.json"}) folders.add(name, "");
  EXPECT_TRUE(zip_in_memory(folders.finish())) << "entries of folders hold nothing";
}

TEST(ZipStorage, TwoEntriesOfOneNameAreRefused) {
  ZipWriter zip;
  for (const char* name : {"zarr.json", "0/zarr.json", "zarr.json"}) zip.add(name, "x");
  EXPECT_TRUE(contains(refusal(zip.finish()), "the entry 'zarr.json' twice"));
}

TEST(ZipStorage, ClaimsOfItsDirectoryAreChecked) {
  for (const bool zip64 : {false, true}) {
    ZipWriter zip({.zip64 = zip64});
    zip.add("zarr.json", "x");
    zip.add("0/c/0", std::string(500, 'x'));
    const ZipEnd sound = zip.end();
    EXPECT_TRUE(zip_in_memory(zip.finish(sound))->open("0/c/0"));
    const std::uint64_t huge = zip64 ? ~std::uint64_t{0} : 0xfffffff0;
    for (const ZipEnd& lie :
         {ZipEnd{sound.entries + 1, sound.size, sound.begin},
          ZipEnd{sound.entries - 1, sound.size, sound.begin}, ZipEnd{0, sound.size, sound.begin},
          ZipEnd{60'000, sound.size, sound.begin},
          ZipEnd{zip64 ? huge : 0, sound.size, sound.begin},
          ZipEnd{sound.entries, sound.size - 1, sound.begin},
          ZipEnd{sound.entries, sound.size + 1, sound.begin},
          ZipEnd{sound.entries, huge, sound.begin}, ZipEnd{sound.entries, sound.size, huge},
          ZipEnd{sound.entries, 0, sound.begin}, ZipEnd{sound.entries, sound.size, 0},
          ZipEnd{sound.entries, sound.size, sound.begin + 1}, ZipEnd{sound.entries, huge, huge}})
      EXPECT_TRUE(contains(refusal(zip.finish(lie)), "damaged zip"))
          << lie.entries << ' ' << lie.size << ' ' << lie.begin;
  }
}

TEST(ZipStorage, ClaimsOfItsEntriesAreChecked) {
  for (const bool zip64 : {false, true})
    for (const ZipEntryForm& lie :
         {ZipEntryForm{.more = 1000}, ZipEntryForm{.further = 1000},
          ZipEntryForm{.more = 0xfffffff0 - 10}, ZipEntryForm{.further = 0xffffff00},
          ZipEntryForm{.more = zip64 ? ~std::uint64_t{0} - 10 : 1000},
          ZipEntryForm{.further = zip64 ? ~std::uint64_t{0} - 100 : 1000}}) {
      ZipWriter zip({.zip64 = zip64});
      zip.add("zarr.json", "x");
      zip.add("0/c/0", "0123456789", lie);
      EXPECT_TRUE(contains(refusal(zip.finish()), "'0/c/0'"));
    }
  // What only the entry's own header shows.
  ZipWriter zip;
  zip.add("zarr.json", "x");
  zip.add("0/c/0", "0123456789", {.further = 2});
  zip.add("last", std::string(100, 'x'));
  const auto storage = zip_in_memory(zip.finish());
  EXPECT_TRUE(storage->open("last"));
  EXPECT_TRUE(contains(message_of<DamageError>([&] { storage->open("0/c/0"); }), "'0/c/0'"));
}

TEST(ZipStorage, EveryTruncationIsRefused) {
  for (const bool zip64 : {false, true}) {
    ZipWriter zip({.zip64 = zip64});
    zip.add("zarr.json", "x");
    zip.add("0/c/0", "0123456789");
    const std::string whole = zip.finish();
    for (std::size_t size = 0; size < whole.size(); ++size)
      EXPECT_TRUE(contains(refusal(whole.substr(0, size)), "damaged zip")) << size;
  }
}

/// Reads all of a store in a damaged zip. Whatever is read is right, for the store has checksums.
void read_or_refuse(const std::string& zip, const std::vector<std::byte>& samples) {
  try {
    const StoreReader store(zip_in_memory(zip));
    EXPECT_TRUE(read_level(store, 0) == samples);
  } catch (const Error& error) {
    const std::string message = error.what();
    EXPECT_TRUE(contains(message, "'memory:/x.zip")) << message;
    EXPECT_FALSE(contains(message, "\n")) << message;
  }
}

TEST(ZipStorage, DamageEndsInOneMessage) {
  const TemporaryFolder folder;
  const Level level = make_level(ScalarType::u8, {20, 18, 17}, 16, 32, 0, true);
  write_store(folder / "a.zarr", {level}, 3, 0);
  const Contents contents = contents_of(folder / "a.zarr");
  for (const ZipForm& form : {ZipForm{}, ZipForm{.zip64 = true}, ZipForm{.descriptors = true}}) {
    const std::string whole = zip_of(contents, form);
    // Every byte of the directory and of what follows it.
    const std::size_t directory = whole.find("PK\x01\x02");
    for (std::size_t at = directory; at < whole.size(); ++at)
      for (const int change : {0x01, 0x80, 0xff}) {
        std::string changed = whole;
        changed[at] = static_cast<char>(changed[at] ^ change);
        read_or_refuse(changed, level.samples);
      }
    std::mt19937 random(1);
    for (int i = 0; i < mutation_count(); ++i) {
      SCOPED_TRACE(i);
      std::string end = whole.substr(directory);
      read_or_refuse(whole.substr(0, directory) + mutate(std::move(end), random), level.samples);
      read_or_refuse(mutate(whole, random), level.samples);
      if (HasFailure()) return;
    }
  }
}

}  // namespace
}  // namespace isobrick::test
