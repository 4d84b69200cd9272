#include <gtest/gtest.h>

#include <sys/resource.h>

#include <csignal>
#include <fstream>
#include <iterator>
#include <string>

#include <isobrick/error.h>
#include "io/bytes/writer_stream.h"
#include "tests/io/bytes/temp_dir.h"

namespace isobrick::inline v0 {
namespace {

TEST(WriterStream, AppendsAndReplacesWhatIsBehind) {
  const TempDir dir;
  OutputFile file(dir / "x", false);
  WriterStream stream(file.writer());
  stream << "0123456789" << 'a';
  EXPECT_EQ(stream.tellp(), 11);
  stream.seekp(4);
  stream.write("xy", 2);
  EXPECT_EQ(stream.tellp(), 6);
  stream.seekp(9);
  stream << "BCDE";  // half of it behind the end
  stream.seekp(0, std::ios::end);
  stream << 'f';
  file.publish();
  std::ifstream in(dir / "x");
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(in), {}), "0123xy678BCDEf");
}

TEST(WriterStream, ThrowsWhereNothingCanBe) {
  const TempDir dir;
  OutputFile file(dir / "x", false);
  WriterStream stream(file.writer());
  stream << "0123";
  EXPECT_THROW(stream.seekp(5), std::ios_base::failure);
}

TEST(WriterStream, ThrowsWhatTheFileThrows) {
  const TempDir dir;
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit small = before;
  small.rlim_cur = 1000;
  OutputFile file(dir / "x", false);
  WriterStream stream(file.writer());
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  try {
    stream.write(std::string(FileWriter::kBuffer + 1, 'x').data(), FileWriter::kBuffer + 1);
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("File too large"), std::string::npos) << error.what();
  }
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
}

}  // namespace
}  // namespace isobrick
