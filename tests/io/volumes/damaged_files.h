#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <iterator>
#include <random>
#include <string>

#include <isobrick/error.h>
#include <isobrick/open_source.h>
#include "test_samples.h"
#include "tests/io/bytes/temp_dir.h"

namespace isobrick::inline v0 {

/// Opens a damaged file and reads of it what fits a small budget. It may be
/// readable all the same; otherwise one line must have the reason and the file.
inline void expect_read_or_refused(const std::string& path, const std::string& name,
                                   const VolumeRequest& request = {}) {
  const std::clock_t start = std::clock();  // whatever else the machine does
  try {
    const auto source = open_source(path, request);
    const Int3 e = source->info().extent;
    constexpr Index kMax = 1 << 22;
    if (e.x > kMax / e.y || e.x * e.y > kMax / e.z) return;  // a promise that takes long to break
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
                                      const VolumeRequest& request = {}) {
  const auto write = [&](const std::string& damaged) {
    std::filesystem::remove(dir / name);  // quicker than to replace its bytes
    return dir.write(name, damaged);
  };
  for (std::size_t at = 0; at < bytes.size(); at += step) {
    expect_read_or_refused(write(bytes.substr(0, at)), name, request);
    for (const int change : {0x01, 0x80, 0xff}) {
      std::string changed = bytes;
      changed[at] = static_cast<char>(changed[at] ^ change);
      expect_read_or_refused(write(changed), name, request);
    }
    if (::testing::Test::HasFailure()) return;
  }
}

/// How many mutations of each file are tried: 150, or ISOBRICK_MUTATIONS, for a
/// long run under sanitizers.
inline int mutation_count() {
  const char* number = std::getenv("ISOBRICK_MUTATIONS");
  const int count = number != nullptr ? std::atoi(number) : 150;
  EXPECT_GT(count, 0) << "ISOBRICK_MUTATIONS";
  return count;
}

/// One to a few changes of `bytes`: bytes of other or of extreme values, runs that are
/// doubled, left out or zeroed, an end that is missing.
inline std::string mutate(std::string bytes, std::mt19937& random) {
  const auto below = [&](std::size_t n) { return n == 0 ? 0 : random() % n; };
  for (std::size_t changes = 1 + below(4); changes > 0 && !bytes.empty(); --changes) {
    // Half of the places are near the beginning, where headers are.
    const std::size_t at =
        below(2) == 0 ? below(std::min<std::size_t>(bytes.size(), 512)) : below(bytes.size());
    const std::size_t run = std::min(bytes.size() - at, 1 + below(16));
    constexpr char kExtremes[] = {'\0', '\x7f', '\x80', '\xff', '\n', ' ', '9', '-'};
    switch (below(6)) {
      case 0: bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8))); break;
      case 1: bytes[at] = static_cast<char>(random()); break;
      case 2: bytes.replace(at, run, run, kExtremes[below(std::size(kExtremes))]); break;
      case 3: bytes.insert(at, bytes.substr(at, run)); break;
      case 4: bytes.erase(at, run); break;
      default:
        if (below(4) == 0) bytes.resize(at);
    }
  }
  return bytes;
}

/// Mutations of a sound file, always the same ones, read or refused within a second each.
inline void expect_mutations_are_no_crash(const TempDir& dir, const std::string& name,
                                          const std::string& bytes) {
  std::mt19937 random(1);
  VolumeRequest request;
  request.memory = std::uint64_t{64} << 20;
  for (int i = 0; i < mutation_count() && !::testing::Test::HasFailure(); ++i) {
    SCOPED_TRACE(i);
    std::filesystem::remove(dir / name);
    // Some name another file in the folder.
    expect_read_or_refused(dir.write(name, mutate(bytes, random)), dir / "", request);
  }
}

}  // namespace isobrick
