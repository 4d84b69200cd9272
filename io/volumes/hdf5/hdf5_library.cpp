#include "io/volumes/hdf5/hdf5_library.h"

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/printable.h"

namespace isobrick::inline v0 {

std::mutex& hdf5_mutex() {
  static std::mutex mutex;
  return mutex;
}

void hdf5_fail(const std::string& path, const std::string& what) {
  std::string text;
  const auto keep = [](unsigned, const H5E_error2_t* error, void* to) -> herr_t {
    std::string& kept = *static_cast<std::string*>(to);
    if (kept.empty() && error->desc != nullptr) kept = error->desc;
    return 0;
  };
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, keep, &text);
  if (!text.empty()) text = fmt::format(" ({})", printable(text, kHdf5MaxShown));
  throw DamageError(fmt::format("'{}': {}{}", path, what, text));
}

Hdf5Handle hdf5_access(hid_t access_class) {
  const auto refuse = [](const char*, const char*, const char*, const char*, unsigned*, hid_t,
                         void*) -> herr_t { return -1; };
  Hdf5Handle access(H5Pcreate(access_class), H5Pclose);
  H5Pset_elink_cb(access, refuse, nullptr);
  return access;
}

}  // namespace isobrick
