#include "io/volumes/open/volume_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

#include <isobrick/error.h>
#include "io/bytes/folder_walk.h"
#include "io/volumes/open/optional_formats.h"
#include "io/volumes/open/volume_format.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// The digits that `text` begins with, without zeros in front.
std::string_view leading_number(std::string_view text) {
  std::size_t end = 0;
  while (end < text.size() && is_digit(text[end])) ++end;
  const std::size_t zeros = text.substr(0, end).find_first_not_of('0');
  return text.substr(std::min(zeros, end), end - std::min(zeros, end));
}

/// Whether a comes before b: "slice9" before "slice10".
bool before(std::string_view a, std::string_view b) {
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (is_digit(a[i]) && is_digit(b[j])) {
      const std::string_view m = leading_number(a.substr(i)), n = leading_number(b.substr(j));
      if (m.size() != n.size()) return m.size() < n.size();
      if (m != n) return m < n;
      while (i < a.size() && is_digit(a[i])) ++i;
      while (j < b.size() && is_digit(b[j])) ++j;
    } else if (a[i] != b[j]) {
      return a[i] < b[j];
    } else {
      ++i;
      ++j;
    }
  }
  return a.size() - i != b.size() - j ? a.size() - i < b.size() - j : a < b;
}

}  // namespace

std::unique_ptr<VolumeSource> open_folder(const std::string& path, const VolumeRequest& request) {
  std::vector<std::string> tiff, dicom;
  for (const FolderEntry& entry : folder_entries(path)) {
    const std::string file = (fs::path(path) / entry.name).string();
    std::error_code failure;
    if (entry.name.starts_with('.') || !fs::is_regular_file(file, failure)) continue;
    const VolumeFormat format = recognise_format(file);
    if (format == VolumeFormat::tiff) tiff.push_back(file);
    if (format == VolumeFormat::dicom) dicom.push_back(file);
  }
  if (!tiff.empty() && !dicom.empty())
    throw UsageError(fmt::format("'{}' holds TIFF and DICOM files: which are meant?", path));
  if (tiff.empty() && dicom.empty())
    throw UsageError(fmt::format("'{}' is a directory without TIFF or DICOM files", path));
  std::sort(tiff.begin(), tiff.end(), before);
  std::sort(dicom.begin(), dicom.end(), before);
  return tiff.empty() ? open_dicom_if_built(path, dicom, request)
                      : open_tiff_if_built(path, tiff, request);
}

}  // namespace isobrick
