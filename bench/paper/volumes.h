#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "bench/volume.h"

namespace isobrick::bench {

/// A row of Cirne and Pedrini's Table 1.
struct PaperVolume {
  std::string name;
  Int3 extent;
  double isovalue;
  std::uint64_t triangles;
  std::string file;  ///< how the real volume is called where it is to be had
};

inline const std::vector<PaperVolume> kPaperVolumes = {
    {"Fuel", {64, 64, 64}, 10, 11534, "fuel_64x64x64_uint8.raw"},
    {"Hydrogen atom", {128, 128, 128}, 20, 47864, "hydrogen_atom_128x128x128_uint8.raw"},
    {"Angiography", {256, 320, 128}, 80, 84974, ""},
    {"Engine", {256, 256, 128}, 155, 207592, "engine_vollib_crop_256x256x128_uint8.raw"},
    {"Lobster", {301, 324, 56}, 45, 317024, "lobster_301x324x56_uint8.raw"},
    {"Head", {128, 256, 256}, 50, 544588, "vis_male_128x256x256_uint8.raw"},
    {"Bonsai", {256, 256, 256}, 45, 858118, "bonsai_256x256x256_uint8.raw"},
    {"Knee", {379, 229, 205}, 60, 1027838, ""},
    {"Sheep heart", {352, 352, 256}, 80, 1397064, ""},
    {"Aneurism", {512, 512, 512}, 45, 835068, ""},
};

/// A volume to measure.
struct LoadedVolume : Volume {
  std::string name;
  double isovalue = 0;
  bool real = false;  ///< otherwise a procedural field of the same extents and triangles
};

/// The real volume when `folder` has it, otherwise a gyroid, and an isovalue at
/// which its surface has about as many triangles.
LoadedVolume load(const PaperVolume& paper, const std::string& folder);

/// A gyroid without noise, isovalue 127.5.
LoadedVolume gyroid(Int3 extent, double frequency);
/// A raw volume named as open_source takes it.
LoadedVolume load_raw(const std::string& path, double isovalue);

}  // namespace isobrick::bench
