#pragma once

#include <string>

#include <isobrick/store_reader.h>

namespace isobrick::tools {

/// Throws Error where `path` is neither a store nor Zarr of another program. The message names what
/// is there and ends in the command to type next.
void check_store(const std::string& path);

/// Throws Error where `path` is nothing that open_source() or a store's reader opens; as above.
void check_input(const std::string& path);

/// Throws Error where `path` is a folder in which Zarr lies: after it could not be opened.
void refuse_folder_of_zarr(const std::string& path);

/// Opens a store to read, after check_store().
StoreReader open_store(const std::string& path, const Selection& selection = {});

}  // namespace isobrick::tools
