#include "pipeline/recode/recode_journal.h"

#include <fcntl.h>
#include <fmt/format.h>

#include <span>

#include <isobrick/error.h>
#include "bricks/zarr/store_names.h"

namespace isobrick::inline v0 {

RecodeJournal::RecodeJournal(const std::filesystem::path& staging, const std::string& input,
                             bool resumed)
    : folder_(staging), path_(staging / kConvertJournal) {
  if (const File begun = resumed ? folder_.open_file(path_, O_RDONLY) : File()) {
    std::string text(input.size(), '\0');
    const bool same_size = begun.size() == text.size();
    if (same_size) begun.read_at(0, std::as_writable_bytes(std::span(text)));
    if (same_size && text == input) return;
    throw Error(
        fmt::format("the input is not the store that '{}' was begun with; --force starts anew",
                    staging.string()));
  }
  File file = folder_.create_file(temporary_name(path_));
  file.write_at(0, std::as_bytes(std::span(input)));
  folder_.rename_file(temporary_name(path_), path_);
}

void RecodeJournal::remove() { folder_.remove_file(path_); }

}  // namespace isobrick
