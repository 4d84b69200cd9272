#include "io/bytes/output_file.h"

#include <gtest/gtest.h>
#include <malloc.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "io/bytes/leftovers.h"
#include "io/meshes/glb_sink.h"
#include "io/meshes/obj_sink.h"
#include "io/meshes/ply_sink.h"
#include "io/meshes/stl_sink.h"
#include "io/meshes/vtp_sink.h"
#include "temp_dir.h"
#include "tests/io/meshes/test_meshes.h"

namespace isobrick::inline v0 {
namespace {

using Names = std::vector<std::string>;

TEST(OutputFile, AppearsOnlyWhenPublished) {
  const TempDir dir;
  {
    OutputFile out(dir / "a", false);
    out.writer().append("hello");
    EXPECT_EQ(dir.list().size(), 1u);
    EXPECT_NE(dir.list()[0], "a");
    out.publish();
    EXPECT_EQ(dir.list(), Names{"a"});
  }
  EXPECT_EQ(dir.read("a"), "hello");
}

TEST(OutputFile, LeavesNothingWhenGivenUp) {
  const TempDir dir;
  { OutputFile(dir / "a", false).writer().append(std::string(3 << 20, 'x')); }
  EXPECT_EQ(dir.list(), Names{});
}

TEST(OutputFile, KeepsWhatExistsUnlessForced) {
  const TempDir dir;
  dir.write("a", "old");
  EXPECT_TRUE(contains(message_of([&] { OutputFile(dir / "a", false); }), "exists"));
  {
    OutputFile out(dir / "a", true);
    out.writer().append("new");
    EXPECT_EQ(dir.read("a"), "old");
    out.publish();
  }
  EXPECT_EQ(dir.read("a"), "new");
  EXPECT_EQ(dir.list(), Names{"a"});
}

TEST(OutputFile, ReplacesALinkButNotWhatItNames) {
  const TempDir dir;
  dir.write("named", "old");
  std::filesystem::create_symlink("named", dir / "a");
  OutputFile out(dir / "a", true);
  out.writer().append("new");
  out.publish();
  EXPECT_EQ(dir.read("a"), "new");
  EXPECT_FALSE(std::filesystem::is_symlink(dir / "a"));
  EXPECT_EQ(dir.read("named"), "old");
  EXPECT_EQ(dir.list().size(), 2u);
}

TEST(OutputFile, LeavesAFolderThatAppearedInTheMeantime) {
  const TempDir dir;
  dir.write("a", "old");
  {
    OutputFile out(dir / "a", true);
    std::filesystem::remove(dir / "a");
    std::filesystem::create_directory(dir / "a");
    message_of<Error>([&] { out.publish(); });
  }
  EXPECT_TRUE(std::filesystem::is_directory(dir / "a"));
  EXPECT_EQ(dir.list(), Names{"a"});
}

TEST(OutputFile, KeepsWhatAppearedInTheMeantime) {
  const TempDir dir;
  {
    OutputFile out(dir / "a", false);
    dir.write("a", "somebody else's");
    EXPECT_TRUE(contains(message_of([&] { out.publish(); }), "exists"));
  }
  EXPECT_EQ(dir.read("a"), "somebody else's");
  EXPECT_EQ(dir.list(), Names{"a"});
}

TEST(OutputFile, RemovesWhatKilledProcessesLeftAndNothingElse) {
  const TempDir dir;
  Names others{"a.partial", "a.partial-1", "a.partial-1-0", "a.partial-1-0-12345678", "notes"};
  for (const std::string& name : others) dir.write(name, "mine");
  // Who made them has let go of them.
  const std::string left = create_temporary_file(dir / "a").path;
  others.push_back(std::filesystem::path(create_temporary_file(dir / "ab").path).filename());
  const std::string link = create_temporary_file(dir / "a").path;
  std::filesystem::remove(link);
  std::filesystem::create_symlink("notes", link);
  others.push_back(std::filesystem::path(link).filename());
  {
    OutputFile out(dir / "a", false);
    EXPECT_FALSE(std::filesystem::exists(left));
    // What is being written stays.
    OutputFile second(dir / "a", false);
    second.writer().append("second");
    out.publish();
    EXPECT_TRUE(contains(message_of([&] { second.publish(); }), "exists"));
  }
  Names expected = others;
  expected.emplace_back("a");
  std::sort(expected.begin(), expected.end());
  EXPECT_EQ(dir.list(), expected);
  EXPECT_EQ(dir.read("notes"), "mine");
}

TEST(OutputFile, RefusesLinksToWhatIsNoFile) {
  const TempDir dir;
  for (const char* target : {"/dev/null", "nothing", "."}) {
    std::filesystem::create_symlink(target, dir / "a");
    EXPECT_TRUE(contains(message_of([&] { OutputFile(dir / "a", true); }), "symbolic link to"));
    EXPECT_EQ(dir.list(), Names{"a"});
    std::filesystem::remove(dir / "a");
  }
  // Also what appears while the file is written.
  OutputFile out(dir / "a", true);
  std::filesystem::create_symlink("/dev/null", dir / "a");
  message_of([&] { out.publish(); });
  EXPECT_TRUE(std::filesystem::is_symlink(dir / "a"));
}

TEST(OutputFile, RefusesPlacesThatCannotBeWritten) {
  const TempDir dir;
  message_of<Error>([&] { OutputFile(dir / "missing/a", false); });
  message_of([&] { OutputFile(dir / ".", true); });
  message_of([] { OutputFile("/dev/null", true); });
  message_of([] { OutputFile("", false); });
  if (::geteuid() == 0) return;  // for whom permissions mean nothing
  ::chmod((dir / ".").c_str(), 0500);
  message_of<Error>([&] { OutputFile(dir / "a", false); });
  ::chmod((dir / ".").c_str(), 0700);
}

TEST(OutputFile, AppendsWhatWaitsInMemoryOrInAFile) {
  const TempDir dir;
  std::string bytes(std::size_t{10} << 20, 'x');
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i * i >> 7);
  for (const std::size_t memory : {0, 3, 16}) {
    FileWriter scratch = open_scratch_beside(dir / "a", memory << 20);
    OutputFile out(dir / "a", true);
    // Pieces below and above what is kept in memory.
    std::size_t at = 0;
    for (std::size_t piece = 1; at < bytes.size(); at += piece, piece = piece * 3 / 2 + 1)
      scratch.append(std::string_view(bytes).substr(at, piece));
    ASSERT_EQ(scratch.size(), bytes.size());
    out.writer().append("head");
    out.writer().append_file(scratch);
    out.writer().append_range(scratch, std::size_t{5} << 20, 1234);
    out.writer().append_range(scratch, bytes.size() - 10, 10);
    std::string end(1, ' ');
    scratch.read_back(bytes.size() - 1, std::as_writable_bytes(std::span(end)));
    EXPECT_EQ(end[0], bytes.back());
    out.publish();
    EXPECT_TRUE(dir.read("a") == "head" + bytes + bytes.substr(std::size_t{5} << 20, 1234) +
                                     bytes.substr(bytes.size() - 10))
        << memory;
  }
}

TEST(OutputFile, KeepsNoLargeBufferForWhatIsInTheFile) {
  // What is allocated, in bytes; a sanitizer's allocator returns 0 throughout.
  const auto allocated = [] {
    const struct mallinfo2 info = ::mallinfo2();
    return info.uordblks + info.hblkhd;
  };
  const TempDir dir;
  constexpr std::size_t memory = std::size_t{64} << 20;
  const std::string piece(std::size_t{1} << 20, 'x');
  const std::size_t before = allocated();
  FileWriter scratch = open_scratch_beside(dir / "a", memory);
  for (std::size_t bytes = 0; bytes < memory; bytes += piece.size()) scratch.append(piece);
  EXPECT_TRUE(allocated() == before || allocated() >= before + memory);
  scratch.append("y");
  EXPECT_LT(allocated(), before + 2 * FileWriter::kBuffer);
  std::string end(2, ' ');
  scratch.read_back(memory - 1, std::as_writable_bytes(std::span(end)));
  EXPECT_EQ(end, "xy");
}

TEST(OutputFile, AppendsAndPatches) {
  const TempDir dir;
  std::string expected;
  OutputFile out(dir / "a", false);
  FileWriter scratch = open_scratch_beside(out.path());
  for (int i = 0; i < 3000; ++i) {
    const std::string piece(static_cast<std::size_t>(i), static_cast<char>('a' + i % 26));
    (i % 2 ? scratch : out.writer()).append(piece);
    if (i % 2 == 0) expected += piece;
  }
  for (int i = 1; i < 3000; i += 2)
    expected += std::string(static_cast<std::size_t>(i), static_cast<char>('a' + i % 26));
  const std::string big(FileWriter::kBuffer + 1, 'z');
  out.writer().append_file(scratch);
  out.writer().append(big);
  out.writer().patch(10, "PATCH");
  out.writer().append("end");
  EXPECT_EQ(out.writer().size(), expected.size() + big.size() + 3);
  out.publish();
  expected.replace(10, 5, "PATCH");
  EXPECT_TRUE(dir.read("a") == expected + big + "end");
  EXPECT_EQ(dir.list(), Names{"a"});
}

/// Runs `f` in a child whose files may not grow beyond 2 MiB; its exit status.
template <class F>
int with_full_disk(F&& f) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{2 << 20, 2 << 20};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    ::_exit(f());
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

template <class Sink>
int write_until_full(const std::string& path, int chunks) {
  const TestMesh ball = make_ball({0, 0, 0}, 1, 50);
  try {
    Sink sink(path, false);
    sink.begin({true, {-1, -1, -1}, {1, 1, 1}});
    for (int i = 0; i < chunks; ++i)
      sink.write(ball.chunk(static_cast<std::uint64_t>(i) * ball.positions.size()));
    sink.finish();
  } catch (const Error& error) {
    const std::string message = error.what();
    return contains(message, path) && contains(message, "bytes") ? 0 : 1;
  }
  return 2;
}

TEST(OutputFile, AFullDiskIsReportedAndLeavesNothing) {
  const TempDir dir;
  EXPECT_EQ(with_full_disk([&] { return write_until_full<PlySink>(dir / "a.ply", 100); }), 0);
  EXPECT_EQ(with_full_disk([&] { return write_until_full<StlSink>(dir / "a.stl", 100); }), 0);
  // Vertices and faces fit, but not both: fails while they are joined.
  EXPECT_EQ(with_full_disk([&] { return write_until_full<PlySink>(dir / "b.ply", 9); }), 0);
  for (const int chunks : {4, 100}) {
    EXPECT_EQ(with_full_disk([&] { return write_until_full<ObjSink>(dir / "a.obj", chunks); }), 0);
    EXPECT_EQ(with_full_disk([&] { return write_until_full<GlbSink>(dir / "a.glb", 3 * chunks); }),
              0);
    EXPECT_EQ(with_full_disk([&] { return write_until_full<VtpSink>(dir / "a.vtp", 3 * chunks); }),
              0);
    EXPECT_EQ(
        with_full_disk([&] { return write_until_full<PvtpSink>(dir / "a.pvtp", 3 * chunks); }), 0);
  }
  EXPECT_EQ(dir.list(), Names{});
}

}  // namespace
}  // namespace isobrick
