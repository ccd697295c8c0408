#include "proto/types.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
#include <utility>

#include "base/text.h"
#include "proto/samples.h"

namespace isomesh {
namespace {

template <class Enum>
struct Names;

// The enumerators of a table of rows, each with its name.
template <class Row, std::size_t kCount, class Enum>
constexpr auto names_from(const std::array<Row, kCount>& rows, Enum Row::*value) {
  std::array<std::pair<Enum, std::string_view>, kCount> names;
  for (std::size_t n = 0; n < kCount; ++n) names[n] = {rows[n].*value, rows[n].name};
  return names;
}

template <>
struct Names<SampleType> {
  static constexpr std::array kTable = {
      std::pair{SampleType::kUint8, "uint8"},     std::pair{SampleType::kInt8, "int8"},
      std::pair{SampleType::kUint16, "uint16"},   std::pair{SampleType::kInt16, "int16"},
      std::pair{SampleType::kUint32, "uint32"},   std::pair{SampleType::kInt32, "int32"},
      std::pair{SampleType::kFloat32, "float32"}, std::pair{SampleType::kFloat64, "float64"}};
};

template <>
struct Names<SaidModality> {
  static constexpr std::array kTable = {std::pair{SaidModality::kCt, "ct"}};
};

template <>
struct Names<NiftiForm> {
  static constexpr std::array kTable = {std::pair{NiftiForm::kSform, "sform"},
                                        std::pair{NiftiForm::kQform, "qform"}};
};

template <>
struct Names<SchemeName> {
  static constexpr std::array kTable = {
      std::pair{SchemeName::kFive, "5"}, std::pair{SchemeName::kSix, "6"},
      std::pair{SchemeName::kFcc, "fcc"}, std::pair{SchemeName::kKuhn, "kuhn"},
      std::pair{SchemeName::kBcc, "bcc"}};
};

template <>
struct Names<Inside> {
  static constexpr std::array kTable = {std::pair{Inside::kAbove, "above"},
                                        std::pair{Inside::kBelow, "below"}};
};

template <>
struct Names<Interpolation> {
  static constexpr std::array kTable = {std::pair{Interpolation::kLinear, "linear"},
                                        std::pair{Interpolation::kMidpoint, "midpoint"}};
};

template <>
struct Names<Smoothing> {
  static constexpr auto kTable = names_from(kSmoothings, &SmoothingRow::smoothing);
};

template <>
struct Names<MeshFormat> {
  static constexpr auto kTable = names_from(kFormatRows, &FormatRow::format);
};

template <>
struct Names<GlbCodec> {
  static constexpr std::array kTable = {
      std::pair{GlbCodec::kDraco, "draco"}, std::pair{GlbCodec::kNone, "none"},
      std::pair{GlbCodec::kMeshopt, "meshopt"}, std::pair{GlbCodec::kKhrMeshopt, "khr-meshopt"},
      std::pair{GlbCodec::kQuantized, "quantized"}};
};

template <>
struct Names<Space> {
  static constexpr std::array kTable = {std::pair{Space::kLps, "lps"},
                                        std::pair{Space::kRas, "ras"}};
};

template <>
struct Names<Priority> {
  static constexpr std::array kTable = {std::pair{Priority::kStat, "stat"},
                                        std::pair{Priority::kRoutine, "routine"},
                                        std::pair{Priority::kBulk, "bulk"}};
};

template <>
struct Names<JobState> {
  static constexpr std::array kTable = {
      std::pair{JobState::kQueued, "queued"}, std::pair{JobState::kRunning, "running"},
      std::pair{JobState::kSucceeded, "succeeded"}, std::pair{JobState::kFailed, "failed"},
      std::pair{JobState::kCancelled, "cancelled"}};
};

template <>
struct Names<Stage> {
  static constexpr auto kTable = names_from(kStages, &StageRow::stage);
};

template <>
struct Names<WaitingFor> {
  static constexpr std::array kTable = {std::pair{WaitingFor::kDisk, "disk"}};
};

template <>
struct Names<Simplification::Bound> {
  static constexpr std::array kTable = {std::pair{Simplification::Bound::kError, "error"},
                                        std::pair{Simplification::Bound::kTriangles, "triangles"},
                                        std::pair{Simplification::Bound::kTopology, "topology"}};
};

template <>
struct Names<MeshCertificate::Reference> {
  static constexpr std::array kTable = {
      std::pair{MeshCertificate::Reference::kExtracted, "extracted"},
      std::pair{MeshCertificate::Reference::kSmoothed, "smoothed"}};
};

template <class Enum>
std::string_view name_of(Enum value) {
  for (const auto& [known, name] : Names<Enum>::kTable) {
    if (known == value) return name;
  }
  return "";
}

}  // namespace

std::size_t bytes_per_sample(SampleType type) {
  return with_sample(type, [](auto sample) { return sizeof(sample); });
}

bool is_integer(SampleType type) {
  return with_sample(type, [](auto sample) { return std::is_integral_v<decltype(sample)>; });
}

bool is_id(std::string_view text) {
  constexpr std::size_t kLongest = 64;
  const auto is_of_id = [](char c) { return is_letter_or_digit(c) || c == '-'; };
  return !text.empty() && text.size() <= kLongest && text.front() != '-' &&
         std::ranges::all_of(text, is_of_id);
}

bool is_color(std::string_view text) {
  return text.size() == 7 && text[0] == '#' &&
         text.find_first_not_of("0123456789abcdef", 1) == std::string_view::npos;
}

bool is_final(JobState state) {
  return state == JobState::kSucceeded || state == JobState::kFailed ||
         state == JobState::kCancelled;
}

std::string mesh_path(const std::string& job, MeshFormat format,
                      std::optional<std::int64_t> label) {
  return "/v1/jobs/" + job + "/mesh." + std::string(to_string(format)) +
         (label ? "?label=" + std::to_string(*label) : "");
}

template <class Enum>
std::optional<Enum> from_string(std::string_view name) {
  for (const auto& [value, known] : Names<Enum>::kTable) {
    if (name == known) return value;
  }
  return std::nullopt;
}

template <class Enum>
std::vector<Enum> values_of() {
  std::vector<Enum> values;
  for (const auto& [value, unused] : Names<Enum>::kTable) values.push_back(value);
  return values;
}

template <class Enum>
std::string names_of() {
  const auto& table = Names<Enum>::kTable;
  std::string text;
  for (std::size_t row = 0; row < table.size(); ++row) {
    if (row > 0) text += row + 1 == table.size() ? " or " : ", ";
    const std::string name(table[row].second);
    text += is_digits(name) ? name : '"' + name + '"';
  }
  return text;
}

#define ISOMESH_NAMED(Enum)                                         \
  std::string_view to_string(Enum value) { return name_of(value); } \
  template std::optional<Enum> from_string<Enum>(std::string_view); \
  template std::vector<Enum> values_of<Enum>();                     \
  template std::string names_of<Enum>();

ISOMESH_NAMED(SampleType)
ISOMESH_NAMED(SaidModality)
ISOMESH_NAMED(NiftiForm)
ISOMESH_NAMED(SchemeName)
ISOMESH_NAMED(Inside)
ISOMESH_NAMED(Interpolation)
ISOMESH_NAMED(Smoothing)
ISOMESH_NAMED(MeshFormat)
ISOMESH_NAMED(GlbCodec)
ISOMESH_NAMED(Space)
ISOMESH_NAMED(Priority)
ISOMESH_NAMED(JobState)
ISOMESH_NAMED(Stage)
ISOMESH_NAMED(WaitingFor)
ISOMESH_NAMED(Simplification::Bound)
ISOMESH_NAMED(MeshCertificate::Reference)

#undef ISOMESH_NAMED

}  // namespace isomesh
