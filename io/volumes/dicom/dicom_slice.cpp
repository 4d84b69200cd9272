#include "io/volumes/dicom/dicom_slice.h"

#include <fmt/format.h>

#include <dcmtk/config/osconfig.h>
// Must come first.
#include <dcmtk/dcmdata/dcrledrg.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmjpeg/djdecode.h>
#include <dcmtk/dcmjpls/djdecode.h>
#include <dcmtk/oflog/oflog.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <mutex>
#include <numeric>
#include <type_traits>
#include <vector>

#include <isobrick/error.h>
#include "core/printable.h"

namespace isobrick::inline v0 {
namespace {

/// Longer elements stay in the file until they are needed.
constexpr Uint32 kMaxElement = 4096;

void prepare_library() {
  static std::once_flag once;
  std::call_once(once, [] {
    OFLog::configure(OFLogger::OFF_LOG_LEVEL);
    DJDecoderRegistration::registerCodecs();
    DJLSDecoderRegistration::registerCodecs();
    DcmRLEDecoderRegistration::registerCodecs();
  });
}

[[noreturn]] void refuse(const std::string& path, const std::string& what) {
  throw UsageError(fmt::format("'{}': {}", path, what));
}

[[noreturn]] void fail(const std::string& path, const char* what, const OFCondition& condition) {
  throw DamageError(fmt::format("'{}' {} ({})", path, what, printable(condition.text(), 200)));
}

/// Typed access to the attributes of a file.
class Attributes {
 public:
  Attributes(const std::string& path, DcmItem& item) : path_(path), item_(item) {}

  std::string text(const DcmTagKey& tag) const {
    OFString value;
    if (item_.findAndGetOFString(tag, value).bad()) return {};
    return printable(value.c_str(), 100);
  }
  int number(const DcmTagKey& tag, int fallback) const {
    Uint16 value = 0;
    return item_.findAndGetUint16(tag, value).good() ? value : fallback;
  }
  Index whole(const DcmTagKey& tag, Index fallback) const {
    Sint32 value = 0;
    return item_.findAndGetSint32(tag, value).good() ? value : fallback;
  }
  std::optional<double> real(const DcmTagKey& tag, unsigned long at = 0) const {
    Float64 value = 0;
    if (item_.findAndGetFloat64(tag, value, at).bad()) return std::nullopt;
    if (!std::isfinite(value)) refuse(path_, "a number is not finite");
    return value;
  }
  std::optional<Vec3d> vector(const DcmTagKey& tag, unsigned long from = 0) const {
    Vec3d v;
    for (int i = 0; i < 3; ++i) {
      const auto part = real(tag, from + static_cast<unsigned long>(i));
      if (!part) return std::nullopt;
      v[i] = *part;
    }
    return v;
  }
  bool has(const DcmTagKey& tag) const { return item_.tagExists(tag); }

 private:
  const std::string& path_;
  DcmItem& item_;
};

void check_syntax(const std::string& path, DcmFileFormat& file) {
  const Attributes meta(path, *file.getMetaInfo());
  const std::string syntax = meta.text(DCM_TransferSyntaxUID);
  // Inflated as a whole when it is loaded, however large.
  if (syntax == UID_DeflatedExplicitVRLittleEndianTransferSyntax)
    refuse(path, "the deflated transfer syntax is not supported");
  for (const char* known : {UID_JPEG2000TransferSyntax, UID_JPEG2000LosslessOnlyTransferSyntax})
    if (syntax == known)
      refuse(path,
             "JPEG 2000 is not supported; 'gdcmconv --raw' of Debian's libgdcm-tools unpacks it");
}

void load(const std::string& path, DcmFileFormat& file, bool samples) {
  prepare_library();
  OFCondition status =
      file.loadFile(path.c_str(), EXS_Unknown, EGL_noChange, kMaxElement, ERM_metaOnly);
  if (status.bad()) fail(path, "cannot be read as a DICOM file", status);
  check_syntax(path, file);
  status = samples ? file.loadFile(path.c_str(), EXS_Unknown, EGL_noChange, kMaxElement)
                   : file.loadFileUntilTag(path.c_str(), EXS_Unknown, EGL_noChange, kMaxElement,
                                           ERM_autoDetect, DCM_PixelData);
  if (status.bad()) fail(path, "cannot be read as a DICOM file", status);
}

ScalarType read_type(const std::string& path, const Attributes& a, int& bits) {
  const int allocated = a.number(DCM_BitsAllocated, 0);
  const bool is_signed = a.number(DCM_PixelRepresentation, 0) == 1;
  bits = a.number(DCM_BitsStored, allocated);
  if (bits < 1 || bits > allocated || a.number(DCM_HighBit, bits - 1) != bits - 1)
    refuse(path, fmt::format("{} of {} bits, the highest being {}, are not supported", bits,
                             allocated, a.number(DCM_HighBit, bits - 1)));
  if (allocated == 8) return is_signed ? ScalarType::i8 : ScalarType::u8;
  if (allocated == 16) return is_signed ? ScalarType::i16 : ScalarType::u16;
  if (allocated == 32) return is_signed ? ScalarType::i32 : ScalarType::u32;
  refuse(path, fmt::format("samples of {} bits are not supported", allocated));
}

/// From one frame of a dose to the next, along the normal; 0 where the file lacks it.
double read_frame_step(const std::string& path, const Attributes& a, Index frames) {
  std::vector<double> steps;
  auto before = a.real(DCM_GridFrameOffsetVector, 0);
  if (!before) return 0;
  for (Index i = 1; i < frames; ++i) {
    const auto offset = a.real(DCM_GridFrameOffsetVector, static_cast<unsigned long>(i));
    if (!offset)
      refuse(path, fmt::format("GridFrameOffsetVector has {} numbers for {} frames", i, frames));
    steps.push_back(*offset - *before);
    before = offset;
  }
  if (steps.empty()) return 0;
  const double usual = usual_step(steps);
  for (std::size_t i = 0; i < steps.size(); ++i)
    if (usual == 0 || std::abs(steps[i] - usual) > step_tolerance(usual))
      refuse(path, fmt::format("the frames are not evenly spaced: frame {} lies {:.4g} mm behind "
                               "the one before, elsewhere the step is {:.4g} mm",
                               i + 2, steps[i], usual));
  return std::accumulate(steps.begin(), steps.end(), 0.0) / static_cast<double>(steps.size());
}

void read_geometry(const std::string& path, const Attributes& a, DicomSlice& slice) {
  const DcmTagKey& tag = a.has(DCM_PixelSpacing) ? DCM_PixelSpacing : DCM_ImagerPixelSpacing;
  // First from row to row, then from column to column.
  slice.spacing.y = a.real(tag, 0).value_or(1);
  slice.spacing.x = a.real(tag, 1).value_or(slice.spacing.y);
  const double stated_step =
      a.real(DCM_SpacingBetweenSlices).value_or(a.real(DCM_SliceThickness).value_or(0));
  const double step = read_frame_step(path, a, slice.extent.z);
  const bool is_dose = a.has(DCM_DoseGridScaling) || a.text(DCM_Modality) == "RTDOSE";
  slice.has_frame_step = step != 0 || (stated_step > 0 && !is_dose);
  slice.spacing.z = step != 0 ? step : stated_step > 0 ? stated_step : 1;
  slice.position = a.vector(DCM_ImagePositionPatient);
  const auto row = a.vector(DCM_ImageOrientationPatient, 0),
             column = a.vector(DCM_ImageOrientationPatient, 3);
  if (row && column) {
    slice.row = *row;
    slice.column = *column;
  }
}

/// Clears the bits above those in use, or fills them with the sign.
template <class T>
void fill_high_bits(std::byte* samples, std::size_t count, int bits) {
  const int shift = static_cast<int>(8 * sizeof(T)) - bits;
  using U = std::make_unsigned_t<T>;
  for (std::size_t i = 0; i < count; ++i) {
    U v;
    std::memcpy(&v, samples + i * sizeof(T), sizeof(T));
    const T filled = static_cast<T>(static_cast<T>(static_cast<U>(v << shift)) >> shift);
    std::memcpy(samples + i * sizeof(T), &filled, sizeof(T));
  }
}

}  // namespace

double usual_step(std::vector<double> steps) {
  // The shorter one of two: a missing slice makes a step longer.
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>((steps.size() - 1) / 2);
  std::nth_element(steps.begin(), middle, steps.end(),
                   [](double a, double b) { return std::abs(a) < std::abs(b); });
  return *middle;
}

double step_tolerance(double step) { return 0.02 * std::abs(step) + 1e-3; }

std::optional<DicomSlice> read_dicom_slice(const std::string& path) {
  DcmFileFormat file;
  load(path, file, false);
  const Attributes a(path, *file.getDataset());
  if (!a.has(DCM_Rows) || !a.has(DCM_Columns)) return std::nullopt;
  DicomSlice slice;
  slice.path = path;
  slice.series = a.text(DCM_SeriesInstanceUID);
  slice.extent = {a.number(DCM_Columns, 0), a.number(DCM_Rows, 0), a.whole(DCM_NumberOfFrames, 1)};
  if (slice.extent.x < 1 || slice.extent.y < 1 || slice.extent.z < 1)
    refuse(path, fmt::format("an image of {} x {} samples and {} frames makes no sense",
                             slice.extent.x, slice.extent.y, slice.extent.z));
  if (a.number(DCM_SamplesPerPixel, 1) != 1 ||
      !a.text(DCM_PhotometricInterpretation).starts_with("MONOCHROME"))
    refuse(path,
           fmt::format("pixels of {} samples ({}) are not supported",
                       a.number(DCM_SamplesPerPixel, 1), a.text(DCM_PhotometricInterpretation)));
  if (a.has(DCM_PerFrameFunctionalGroupsSequence))
    refuse(path, "enhanced multi-frame images are not supported; 'emf2sf' of dcm4che unpacks them");
  slice.type = read_type(path, a, slice.bits);
  slice.scale = {a.real(DCM_RescaleSlope).value_or(1), a.real(DCM_RescaleIntercept).value_or(0)};
  slice.time = a.whole(DCM_TemporalPositionIdentifier, 0);
  slice.instance = a.whole(DCM_InstanceNumber, 0);
  if (const auto dose = a.real(DCM_DoseGridScaling)) slice.scale = {*dose, 0};
  read_geometry(path, a, slice);
  return slice;
}

void read_dicom_frame(const DicomSlice& slice, Index frame, std::byte* out) {
  DcmFileFormat file;
  load(slice.path, file, true);
  DcmItem& dataset = *file.getDataset();
  DcmElement* element = nullptr;
  OFCondition status = dataset.findAndGetElement(DCM_PixelData, element);
  auto* const pixels = dynamic_cast<DcmPixelData*>(element);
  if (status.bad() || pixels == nullptr) refuse(slice.path, "there are no samples (PixelData)");
  const auto count = static_cast<std::size_t>(slice.extent.x * slice.extent.y);
  const std::size_t bytes = count * size_of(slice.type);
  // Frames are handed out in even numbers of bytes.
  Uint32 size = 0, fragment = 0;
  status = pixels->getUncompressedFrameSize(&dataset, size);
  if (status.bad() || size != bytes)
    refuse(slice.path, fmt::format("a frame has {} bytes, but {} x {} samples make {}", size,
                                   slice.extent.x, slice.extent.y, bytes));
  OFString colours;
  const bool even = bytes % 2 == 0;
  const auto spare = even ? nullptr : std::make_unique<std::byte[]>(bytes + 1);
  status = pixels->getUncompressedFrame(&dataset, static_cast<Uint32>(frame), fragment,
                                        even ? out : spare.get(),
                                        static_cast<Uint32>(even ? bytes : bytes + 1), colours);
  if (status.bad()) fail(slice.path, "has samples that cannot be read", status);
  if (!even) std::memcpy(out, spare.get(), bytes);
  if (slice.bits == static_cast<int>(8 * size_of(slice.type))) return;
  visit_scalar(slice.type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    if constexpr (std::is_integral_v<T>) fill_high_bits<T>(out, count, slice.bits);
  });
}

}  // namespace isobrick
