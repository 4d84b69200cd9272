#include "io/bytes/mapped_file.h"

#include "tests/io/bytes/temp_dir.h"

namespace isobrick::inline v0 {
namespace {

std::string text_of(const MappedFile& file) {
  return {reinterpret_cast<const char*>(file.bytes().data()), file.bytes().size()};
}

TEST(MappedFile, HoldsTheFile) {
  const TempDir dir;
  const std::string text = std::string(5000, 'a') + "end";
  EXPECT_EQ(text_of(MappedFile(dir.write("a", text))), text);
  EXPECT_EQ(MappedFile(dir.write("empty", "")).bytes().size(), 0u);
}

TEST(MappedFile, StaysWhenTheFileIsRemoved) {
  const TempDir dir;
  const MappedFile file(dir.write("a", "text"));
  std::filesystem::remove(dir / "a");
  EXPECT_EQ(text_of(file), "text");
}

TEST(MappedFile, NamesWhatIsNoFile) {
  const TempDir dir;
  for (const std::string& path : {dir / "gone", dir / "."}) {
    const std::string message = message_of<Error>([&] { MappedFile file(path); });
    EXPECT_NE(message.find(path), std::string::npos) << message;
  }
}

}  // namespace
}  // namespace isobrick
