#pragma once

// What the files that call libhdf5 share.

#include <hdf5.h>

#include <cstddef>
#include <mutex>
#include <string>
#include <utility>

namespace isobrick::inline v0 {

/// To be held while any function of the library is called, closing included.
std::mutex& hdf5_mutex();

/// Throws DamageError that names the file and adds what the library complains of.
[[noreturn]] void hdf5_fail(const std::string& path, const std::string& what);

/// Messages show so many characters of a file's own text.
inline constexpr std::size_t kHdf5MaxShown = 200;

/// Owns a handle of any kind.
class Hdf5Handle {
 public:
  Hdf5Handle() = default;
  Hdf5Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  Hdf5Handle(Hdf5Handle&& other) noexcept
      : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Hdf5Handle& operator=(Hdf5Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
    return *this;
  }
  ~Hdf5Handle() {
    if (id_ >= 0) close_(id_);
  }
  operator hid_t() const { return id_; }
  bool valid() const { return id_ >= 0; }

 private:
  hid_t id_ = -1;
  herr_t (*close_)(hid_t) = nullptr;
};

/// Properties of a class of access by which no link leads into another file.
Hdf5Handle hdf5_access(hid_t access_class);

}  // namespace isobrick
