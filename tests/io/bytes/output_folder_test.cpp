#include "io/bytes/output_folder.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "io/bytes/output_guard.h"
#include "temp_dir.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;
using Names = std::vector<std::string>;

void fill(const File& file, const std::string& text) {
  EXPECT_EQ(::write(file.fd(), text.data(), text.size()), static_cast<ssize_t>(text.size()));
}

TEST(OutputFolder, CreatesFilesAnew) {
  const TempDir dir;
  fs::create_directory(dir / "root");
  dir.write("precious", "mine");
  fs::create_symlink("../precious", dir / "root/link");
  fs::create_symlink("../made", dir / "root/dangling");
  fs::create_hard_link(dir / "precious", dir / "root/hard");
  ASSERT_EQ(::mkfifo((dir / "root/pipe").c_str(), 0600), 0);
  const OutputFolder folder(dir / "root");
  for (const std::string name :
       {"root/link", "root/dangling", "root/hard", "root/pipe", "root/a/b/new"}) {
    fill(folder.create_file(dir / name), "x");
    EXPECT_EQ(dir.read(name), "x");
    EXPECT_TRUE(fs::is_regular_file(fs::symlink_status(dir / name)));
  }
  EXPECT_EQ(dir.read("precious"), "mine");
  EXPECT_EQ(dir.list(), (Names{"precious", "root"}));
  fs::create_directory(dir / "root/folder");
  message_of<Error>([&] { folder.create_file(dir / "root/folder"); });
}

TEST(OutputFolder, LeadsThroughNoLink) {
  const TempDir dir;
  fs::create_directories(dir / "root/real");
  fs::create_directory(dir / "home");
  dir.write("home/a", "mine");
  fs::create_symlink("../home", dir / "root/link");
  fs::create_symlink("../home/a", dir / "root/file");
  const OutputFolder folder(dir / "root");
  const auto refused = [&](const auto& f) {
    EXPECT_TRUE(contains(message_of<Error>(f), "is a symbolic link"));
  };
  refused([&] { folder.create_file(dir / "root/link/a"); });
  refused([&] { folder.open_file(dir / "root/link/a", O_RDONLY); });
  refused([&] { folder.open_file(dir / "root/file", O_RDWR); });
  refused([&] { folder.make_folder(dir / "root/link"); });
  refused([&] { folder.make_folder(dir / "root/link/b"); });
  refused([&] { folder.remove_file(dir / "root/link/a"); });
  refused([&] { folder.remove_folder(dir / "root/link/a"); });
  refused([&] { folder.rename_file(dir / "root/real", dir / "root/link/b"); });
  for (const std::string outside : {"home/a", "root/../home/a", "roots/a"})
    message_of<Error>([&] { folder.remove_file(dir / outside); });
  folder.remove_folder(dir / "root/link");  // the link itself
  EXPECT_FALSE(fs::exists(fs::symlink_status(dir / "root/link")));
  fs::create_symlink("../../home", dir / "root/real/link");
  folder.remove_folder(dir / "root/real");
  EXPECT_FALSE(fs::exists(dir / "root/real"));
  EXPECT_EQ(dir.read("home/a"), "mine");
}

TEST(OutputFolder, MovesFoldersToTheirPlace) {
  const TempDir dir;
  const OutputFolder folder(dir / "");
  for (const std::string text : {"old", "new"}) {
    fill(folder.create_file(dir / "a.partial/below/x"), text);
    folder.replace_folder(dir / "a.partial", dir / "a");
    EXPECT_EQ(dir.read("a/below/x"), text);
    EXPECT_EQ(dir.list(), Names{"a"});
  }
  // It is still the same folder when it has another name.
  const OutputFolder moved(dir / "a");
  fs::rename(dir / "a", dir / "b");
  moved.remove_folder(dir / "a/below");
  moved.sync_folder(dir / "a");
  EXPECT_TRUE(fs::is_empty(dir / "b"));
}

TEST(OutputFolder, TakesAnyNameOfItsRoot) {
  const TempDir dir;
  const fs::path before = fs::current_path();
  fs::current_path(dir / "");
  fs::create_directory("root");
  for (const fs::path root : {"root", "root/", "./root", ".//root//", "."}) {
    const OutputFolder folder(root);
    fill(folder.create_file(root / "a/b"), "x");
    folder.sync_folder(root);
    folder.sync_folder(root / "a");
    folder.remove_folder(root / "a");
    EXPECT_TRUE(fs::is_empty("root")) << root;
  }
  OutputFolder(".").remove_folder("root");
  EXPECT_EQ(dir.list(), Names{});
  fs::current_path(before);
}

TEST(OutputGuard, KnowsInputsByAnyName) {
  const TempDir dir;
  fs::create_directories(dir / "store/0");
  dir.write("store/0/shard", "x");
  dir.write("mesh", "x");
  fs::create_symlink("store", dir / "link");
  const auto check = [&](const std::string& output, const std::string& input) {
    const std::vector<fs::path> inputs{dir / input};
    check_replaces_no_input(dir / output, inputs);
  };
  for (const auto& [output, input] :
       std::vector<std::pair<std::string, std::string>>{{"mesh", "mesh"},
                                                        {"mesh", "store/../mesh"},
                                                        {"store", "store"},
                                                        {"store", "link"},
                                                        {"store", "store/0"},
                                                        {"store", "link/0/shard"},
                                                        {"link/0/shard", "store"},
                                                        {"store/0/shard", "link"}})
    EXPECT_TRUE(contains(message_of([&] { check(output, input); }), "is not replaced"))
        << output << ' ' << input;
  check("mesh", "store");
  check("store", "mesh");
  check("store/0", "store");  // folders in a folder of inputs are checked by what they hold
  check("missing", "mesh");
  check("mesh", "missing");
}

}  // namespace
}  // namespace isobrick
