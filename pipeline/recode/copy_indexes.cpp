#include "pipeline/recode/copy_indexes.h"

#include <algorithm>
#include <span>
#include <string>
#include <vector>

#include <isobrick/error.h>
#include "bricks/storage/storage_keys.h"
#include "bricks/stored_index.h"
#include "bricks/zarr/publisher.h"

namespace isobrick::inline v0 {
namespace {

/// Bytes that are copied at a time.
constexpr std::uint64_t kPiece = std::uint64_t{1} << 20;

class IndexCopy {
 public:
  IndexCopy(const StoreReader& store, const std::filesystem::path& folder, Progress& progress)
      : store_(store), folder_(folder), progress_(progress), publisher_(folder) {}

  void copy(int level, const std::string& kind);
  std::uint64_t finish() {
    publisher_.wait();
    return publisher_.bytes();
  }

 private:
  void check(const StoredIndex& index, Int3 chunk);
  void copy_object(const std::string& from, const std::string& to);

  const StoreReader& store_;
  std::filesystem::path folder_;
  Progress& progress_;
  Publisher publisher_;
  std::vector<std::byte> bytes_;
};

void IndexCopy::check(const StoredIndex& index, Int3 chunk) {
  const IndexChunk parts = index.open(chunk);
  for (std::size_t part = 0; part < index.layout().parts_of_chunk(chunk); ++part)
    parts.read(part, bytes_);
}

void IndexCopy::copy_object(const std::string& from, const std::string& to) {
  const auto object = store_.storage()->open(from);
  if (!object) throw DamageError(quoted(*store_.storage(), from) + " is missing");
  File file = publisher_.create_temporary(folder_ / to);
  for (std::uint64_t done = 0; done < object->size(); done += kPiece) {
    bytes_.resize(static_cast<std::size_t>(std::min(kPiece, object->size() - done)));
    object->read(done, bytes_);
    file.write_at(done, bytes_);
    publisher_.count(bytes_.size());
    progress_.advance(bytes_.size());
  }
  publisher_.publish(std::move(file), folder_ / to);
}

void IndexCopy::copy(int level, const std::string& kind) {
  const StoredIndex index(store_, level, kind);
  const std::string from = index_folder(store_.info().additions, level, kind);
  const std::string to = index_folder("", level, kind);
  progress_.begin("copy index", index.bytes());
  for_each_point({{0, 0, 0}, index.layout().chunks()}, [&](Int3 c) {
    check(index, c);
    copy_object(join_key(from, index_chunk_name(c)), join_key(to, index_chunk_name(c)));
  });
  // Last: what has no description is no index.
  publisher_.wait();
  copy_object(join_key(from, kIndexDescription), join_key(to, kIndexDescription));
  progress_.end();
}

}  // namespace

std::uint64_t copy_indexes(const StoreReader& store, const std::filesystem::path& folder,
                           Progress& progress) {
  IndexCopy copy(store, folder, progress);
  for (int level = 0; level < static_cast<int>(store.info().levels.size()); ++level)
    for (const std::string& kind : stored_index_kinds(store, level)) copy.copy(level, kind);
  return copy.finish();
}

}  // namespace isobrick
