#include <algorithm>
#include <utility>

#include <isobrick/error.h>
#include <isobrick/storage.h>
#include "bricks/storage/storage_keys.h"

namespace isobrick::inline v0 {
namespace {

using Objects = std::map<std::string, std::vector<std::byte>>;

class MemoryObject final : public StoredObject {
 public:
  MemoryObject(std::string name, std::shared_ptr<const Objects> objects,
               const std::vector<std::byte>& bytes)
      : name_(std::move(name)), objects_(std::move(objects)), bytes_(bytes) {}

  std::string name() const override { return name_; }
  std::uint64_t size() const override { return bytes_.size(); }
  void read(std::uint64_t offset, std::span<std::byte> bytes) const override {
    check_range(*this, offset, bytes.size());
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(offset), bytes.size(), bytes.begin());
  }

 private:
  std::string name_;
  std::shared_ptr<const Objects> objects_;
  const std::vector<std::byte>& bytes_;  ///< of `objects_`
};

class MemoryStorage final : public Storage {
 public:
  MemoryStorage(Objects objects, std::string name)
      : objects_(std::make_shared<const Objects>(std::move(objects))), name_(std::move(name)) {}

  std::string name() const override { return name_; }
  std::shared_ptr<const StoredObject> open(const std::string& key) const override {
    const auto found = objects_->find(key);
    if (found == objects_->end()) return nullptr;
    return std::make_shared<const MemoryObject>(name_of(key), objects_, found->second);
  }
  std::vector<std::string> list(const std::string& folder) const override {
    return list_keys(folder, [&](const std::string& text) {
      const auto found = objects_->lower_bound(text);
      return found == objects_->end() ? nullptr : &found->first;
    });
  }

 private:
  std::shared_ptr<const Objects> objects_;
  std::string name_;
};

using Functions = std::shared_ptr<const StorageFunctions>;

class FunctionObject final : public StoredObject {
 public:
  FunctionObject(Functions functions, std::string name, std::string key, std::uint64_t size)
      : functions_(std::move(functions)),
        name_(std::move(name)),
        key_(std::move(key)),
        size_(size) {}

  std::string name() const override { return name_; }
  std::uint64_t size() const override { return size_; }
  void read(std::uint64_t offset, std::span<std::byte> bytes) const override {
    check_range(*this, offset, bytes.size());
    functions_->read(key_, offset, bytes);
  }

 private:
  Functions functions_;
  std::string name_, key_;
  std::uint64_t size_;
};

class FunctionStorage final : public Storage {
 public:
  FunctionStorage(StorageFunctions functions, std::string name)
      : functions_(std::make_shared<const StorageFunctions>(std::move(functions))),
        name_(std::move(name)) {}

  std::string name() const override { return name_; }
  std::shared_ptr<const StoredObject> open(const std::string& key) const override {
    const auto size = functions_->size(key);
    if (!size) return nullptr;
    return std::make_shared<const FunctionObject>(functions_, name_of(key), key, *size);
  }
  std::vector<std::string> list(const std::string& folder) const override {
    return functions_->list ? functions_->list(folder) : std::vector<std::string>();
  }

 private:
  Functions functions_;
  std::string name_;
};

}  // namespace

std::shared_ptr<const Storage> memory_storage(Objects objects, std::string name) {
  return std::make_shared<const MemoryStorage>(std::move(objects), std::move(name));
}

std::shared_ptr<const Storage> function_storage(StorageFunctions functions, std::string name) {
  if (!functions.size || !functions.read)
    throw UsageError("a storage of functions needs those for size and read");
  return std::make_shared<const FunctionStorage>(std::move(functions), std::move(name));
}

}  // namespace isobrick
