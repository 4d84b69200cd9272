#pragma once

#include <gtest/gtest.h>

#include <string>

#include <isobrick/open_source.h>
#include "tests/io/bytes/temp_dir.h"
#include "tests/io/volumes/test_samples.h"

namespace isobrick::inline v0 {

constexpr Int3 kExtent{7, 5, 4};
constexpr Box3 kWhole{{0, 0, 0}, kExtent};

inline std::string whole(ScalarType type, bool swapped = false) {
  return sample_bytes(type, kWhole, kExtent, swapped);
}

inline std::string nrrd(const std::string& more) {
  return "NRRD0004\ntype: short\ndimension: 3\nsizes: 7 5 4\n" + more;
}

/// All samples, read in two slabs as a stream must be.
inline std::string read_all(VolumeSource& source) {
  const Int3 e = source.info().extent;
  const Index half = e.z / 2;
  std::string bytes;
  if (half > 0) bytes = read_box(source, {{0, 0, 0}, {e.x, e.y, half}});
  return bytes + read_box(source, {{0, 0, half}, e});
}

class TextVolume : public ::testing::Test {
 protected:
  std::string open_and_read(const std::string& name, const VolumeRequest& request = {}) const {
    return read_all(*open_source(dir / name, request));
  }
  void expect_whole(const std::string& name) const {
    EXPECT_EQ(open_and_read(name), whole(ScalarType::i16)) << name;
  }

  TempDir dir;
};

}  // namespace isobrick
