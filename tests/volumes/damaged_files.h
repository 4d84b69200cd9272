#pragma once

#include <gtest/gtest.h>

#include <ctime>
#include <filesystem>
#include <string>

#include "isobrick/core/error.h"
#include "isobrick/volumes/open_source.h"
#include "test_samples.h"
#include "tests/io/temp_dir.h"

namespace isobrick {

/// Opens a damaged file and reads of it what fits a small budget. It may be
/// readable all the same; otherwise one line must say why and name the file.
inline void expect_read_or_refused(const std::string& path, const std::string& name,
                                   const VolumeRequest& said = {}) {
  const std::clock_t start = std::clock();  // whatever else the machine does
  try {
    const auto source = open_source(path, said);
    const Int3 e = source->info().extent;
    constexpr Index kMost = 1 << 22;
    if (e.x > kMost / e.y || e.x * e.y > kMost / e.z) return;  // a promise that takes long to break
    read_box(*source, {{0, 0, 0}, e});
  } catch (const Error& error) {
    const std::string message = error.what();
    EXPECT_TRUE(contains(message, name)) << message;
    EXPECT_FALSE(contains(message, "\n")) << message;
  }
  EXPECT_LT(std::clock() - start, CLOCKS_PER_SEC) << path;
}

/// `bytes` cut at, and changed in, every `step`-th place.
inline void expect_damage_is_no_crash(const TempDir& dir, const std::string& name,
                                      const std::string& bytes, std::size_t step,
                                      const VolumeRequest& said = {}) {
  const auto write = [&](const std::string& damaged) {
    std::filesystem::remove(dir / name);  // quicker than to replace its bytes
    return dir.write(name, damaged);
  };
  for (std::size_t at = 0; at < bytes.size(); at += step) {
    expect_read_or_refused(write(bytes.substr(0, at)), name, said);
    for (const int change : {0x01, 0x80, 0xff}) {
      std::string changed = bytes;
      changed[at] = static_cast<char>(changed[at] ^ change);
      expect_read_or_refused(write(changed), name, said);
    }
    if (::testing::Test::HasFailure()) return;
  }
}

}  // namespace isobrick
