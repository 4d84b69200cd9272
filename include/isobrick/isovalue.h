#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/histogram.h>
#include <isobrick/scalar.h>
#include <isobrick/store_reader.h>

namespace isobrick::inline v0 {

/// An isovalue as people state it: a number, or one that the samples give.
struct IsovalueRequest {
  /// What `number` is.
  enum class Kind : std::uint8_t {
    value,             ///< the isovalue
    otsu,              ///< nothing: Otsu's threshold
    percentile,        ///< percent of the samples that lie below
    percent_of_range,  ///< percent of the way from the smallest to the largest sample
    hounsfield         ///< Hounsfield units
  };
  Kind kind = Kind::value;  ///< what is stated
  double number = 0;        ///< by this number
  friend bool operator==(const IsovalueRequest&, const IsovalueRequest&) = default;
};

/// The most isovalues that one text may state.
inline constexpr std::size_t kMaxIsovalues = 1000;

/// Reads "300", "otsu", "p99.5" (a percentile), "50%" (of the range), "300HU", a preset such as
/// "ct-bone", "100:500:50" (from, to, step), or several of them with commas between. Throws
/// UsageError.
ISOBRICK_API std::vector<IsovalueRequest> parse_isovalues(std::string_view text);

/// The presets that parse_isovalues() knows, with their values: "ct-skin (-300 HU), …".
ISOBRICK_API std::string isovalue_presets();

/// Whether the isovalue depends on the samples.
ISOBRICK_API bool needs_histogram(const IsovalueRequest& request);

/// The isovalue. For Otsu's threshold that is the upper bound of the bin that otsu() names, so that
/// no sample of whole numbers equals it. Throws UsageError where no sample is finite, where all are
/// equal and Otsu's is requested, and for Hounsfield units of samples without a sign.
ISOBRICK_API double resolve_isovalue(const IsovalueRequest& request, const Histogram& histogram,
                                     ScalarType type);

/// The isovalues of several requests, each once. Calls `samples` for the histogram if one of them
/// needs it.
ISOBRICK_API std::vector<double> resolve_isovalues(std::span<const IsovalueRequest> requests,
                                                   ScalarType type,
                                                   const std::function<Histogram()>& samples);

/// An isovalue for a volume of which nothing else is known.
struct SuggestedIsovalue {
  double value = 0;  ///< the isovalue
  std::string why;   ///< part of a sentence, such as "Otsu's threshold, which …"
};

/// Suggests 0 for a level set, the border of the lowest label for labels, else Otsu's threshold.
/// nullopt where all samples are equal or none is finite.
ISOBRICK_API std::optional<SuggestedIsovalue> suggest_isovalue(const StoreInfo& info,
                                                               const Histogram& histogram);
/// The same for samples of a type that are no level set.
ISOBRICK_API std::optional<SuggestedIsovalue> suggest_isovalue(ScalarType type,
                                                               const Histogram& histogram);

}  // namespace isobrick
