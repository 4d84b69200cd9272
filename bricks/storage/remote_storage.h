#pragma once

#include <memory>
#include <string>
#include <vector>

#include <isobrick/storage.h>
#include "io/http/http_client.h"

namespace isobrick::inline v0 {

/// The storage of a URL, with a client of the caller's choice.
std::shared_ptr<const Storage> remote_storage(const std::string& url, const RemoteOptions& options,
                                              std::shared_ptr<HttpClient> client);

/// The storage of a store or of a zip of one that a URL names: open_storage(). Throws Error where
/// neither is there.
std::shared_ptr<const Storage> open_remote_storage(const std::string& url,
                                                   const RemoteOptions& options);

}  // namespace isobrick
