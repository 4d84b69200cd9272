#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/mesh.h>
#include <isobrick/store_reader.h>

namespace isobrick::inline v0 {

/// How volumes are sampled at points.
struct SampleOptions {
  /// Of the coordinates of points, as unit_name() has it. Where this and the volume's unit are
  /// known and differ, points are converted. Empty: that of the volume.
  std::string unit = {};
  std::string volume_unit = {};  ///< of volumes that have no unit themselves
  int threads = 0;  ///< that decode and interpolate, 0: all cores; never shows in the values
  /// Bytes that decoded bricks of one volume may take. At least eight bricks are held. It never
  /// shows in the values.
  std::uint64_t memory = std::uint64_t{64} << 20;
};

/// Samples level 0 of a store at points of world space, by trilinear interpolation. Keeps the
/// bricks that were used last, so points cost least where neighbours follow each other. For one
/// thread.
///
/// NaN outside of the volume, which ends at its first and last samples; a thousandth of a sample
/// beyond them counts as the border, for positions are rounded. Along an axis of one sample the
/// volume reaches half a sample to either side and does not vary. NaN also where one of the samples
/// that have a weight is NaN.
class ISOBRICK_API VolumeSampler {
 public:
  /// `store` must outlive it.
  explicit VolumeSampler(const StoreReader& store, const SampleOptions& options = {});
  ~VolumeSampler();
  /// Takes the bricks of another.
  VolumeSampler(VolumeSampler&&) noexcept;

  /// Writes the value at each position. Both must be of one length: throws UsageError otherwise.
  /// Throws as StoreReader::read_brick() does.
  void sample(std::span<const Vec3f> positions, std::span<float> values);
  /// Bytes that it holds at most, with what reading takes.
  std::uint64_t memory() const;
  /// Bricks read so far; more than there are where one was repeated.
  std::uint64_t bricks_read() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A vertex attribute that is sampled from a volume.
struct SampledAttribute {
  std::string name;                    ///< see check_attribute_names()
  const StoreReader* store = nullptr;  ///< what is sampled
};

/// Throws UsageError for names that no mesh file could hold: what is no identifier of ASCII
/// letters, digits and underscores, 64 at most, or is that of a vertex property of PLY or VTK (x,
/// nx, red, Normals, ...); two that differ in nothing but the case of letters; more than 32.
ISOBRICK_API void check_attribute_names(std::span<const std::string> names);

/// Scales of colours. `viridis` is even to the eye, also without red or green; `coolwarm` has its
/// light middle between blue and red, for values on both sides of a mean.
enum class ColourMap : std::uint8_t { viridis, coolwarm, grey };

/// How the values of an attribute become colours.
struct AttributeColours {
  std::string attribute;  ///< its name
  double low = 0;         ///< the value with the first colour, which smaller ones have, too
  double high = 1;        ///< the value with the last; not `low`, but it may be below it
  ColourMap map = ColourMap::viridis;  ///< of values in between

  /// The colour of a value; grey of NaN.
  ISOBRICK_API VertexColour colour_of(float value) const;
};

/// Passes a mesh with vertex attributes on to another sink, with the colours of one of them. It
/// goes behind an AttributeSink.
class ISOBRICK_API ColourSink final : public MeshSink {
 public:
  /// `sink` must outlive it. Throws UsageError where both ends of the scale are the same or one is
  /// not finite.
  ColourSink(MeshSink& sink, AttributeColours colours);

  Indexing indexing() const override { return sink_.indexing(); }
  bool takes_wide() const override { return sink_.takes_wide(); }
  /// Throws UsageError for a mesh without the attribute.
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override { sink_.finish(); }
  std::uint64_t bytes() const override { return sink_.bytes(); }
  std::uint64_t memory() const override { return sink_.memory(); }

 private:
  MeshSink& sink_;
  AttributeColours colours_;
  std::size_t attribute_ = 0;
  std::vector<VertexColour> of_chunk_;
};

/// Passes a mesh on to another sink, with vertex attributes that are samples of volumes at its
/// vertices: see VolumeSampler. It goes behind the filters, so that the values are those of the
/// vertices that leave. The values depend on nothing but the positions and the volumes.
class ISOBRICK_API AttributeSink final : public MeshSink {
 public:
  /// `sink` and the stores must outlive it. SampleOptions::unit is of meshes whose header has none;
  /// SampleOptions::memory is divided among the attributes. Throws as check_attribute_names() does.
  AttributeSink(MeshSink& sink, std::vector<SampledAttribute> attributes,
                const SampleOptions& options = {});
  ~AttributeSink() override;

  Indexing indexing() const override;
  bool takes_wide() const override;
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;
  std::uint64_t bytes() const override;
  std::uint64_t memory() const override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick
