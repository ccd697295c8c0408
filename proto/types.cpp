#include "proto/types.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <optional>
#include <string_view>
#include <utility>

#include "proto/orders.h"
#include "proto/samples.h"
#include "proto/stages.h"

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
struct Names<NiftiForm> {
  static constexpr std::array kTable = {std::pair{NiftiForm::kSform, "sform"},
                                        std::pair{NiftiForm::kQform, "qform"}};
};

template <>
struct Names<Scheme> {
  static constexpr std::array kTable = {
      std::pair{Scheme::kFive, "5"}, std::pair{Scheme::kSix, "6"}, std::pair{Scheme::kFcc, "fcc"},
      std::pair{Scheme::kKuhn, "kuhn"}, std::pair{Scheme::kBcc, "bcc"}};
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

const FormatRow& row_of(MeshFormat format) {
  return *std::ranges::find(kFormatRows, format, &FormatRow::format);
}

template <>
struct Names<MeshFormat> {
  static constexpr auto kTable = names_from(kFormatRows, &FormatRow::format);
};

template <>
struct Names<GlbCodec> {
  static constexpr std::array kTable = {std::pair{GlbCodec::kDraco, "draco"},
                                        std::pair{GlbCodec::kMeshopt, "meshopt"}};
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
struct Names<OrderState> {
  static constexpr std::array kTable = {
      std::pair{OrderState::kWaiting, "waiting"},     std::pair{OrderState::kFetching, "fetching"},
      std::pair{OrderState::kMeshing, "meshing"},     std::pair{OrderState::kSending, "sending"},
      std::pair{OrderState::kSucceeded, "succeeded"}, std::pair{OrderState::kFailed, "failed"},
      std::pair{OrderState::kCancelled, "cancelled"}};
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

bool is_color(std::string_view text) {
  return text.size() == 7 && text[0] == '#' &&
         text.find_first_not_of("0123456789abcdef", 1) == std::string_view::npos;
}

bool is_final(JobState state) {
  return state == JobState::kSucceeded || state == JobState::kFailed ||
         state == JobState::kCancelled;
}

Scheme numbered(Scheme scheme) {
  switch (scheme) {
    case Scheme::kFcc:
      return Scheme::kFive;
    case Scheme::kKuhn:
      return Scheme::kSix;
    default:
      return scheme;
  }
}

double default_lambda(const MeshParameters& parameters) {
  const SmoothingRow& row = row_of(parameters.smoothing);
  const double usual = row.lambda.value_or(1);
  return parameters.labels ? row.lambda_by_labels.value_or(usual) : usual;
}

JobParameters label_parameters(LabelChoice labels) {
  constexpr int kPasses = 10;
  JobParameters parameters;
  parameters.labels = std::move(labels);
  parameters.interpolation = Interpolation::kMidpoint;
  parameters.passes = kPasses;
  parameters.smoothing = Smoothing::kLabels;
  return parameters;
}

Space space_of(MeshFormat format, const MeshParameters& parameters) {
  return row_of(format).own_space.value_or(parameters.space);
}

bool holds_all_labels(MeshFormat format) { return row_of(format).holds_all_labels; }

std::vector<MeshFormat> files_of(const MeshParameters& parameters) {
  if (!parameters.labels) return parameters.formats;
  std::vector<MeshFormat> files;
  std::ranges::copy_if(parameters.formats, std::back_inserter(files), holds_all_labels);
  if (!zipped_formats(parameters).empty()) files.push_back(MeshFormat::kZip);
  return files;
}

std::vector<MeshFormat> zipped_formats(const MeshParameters& parameters) {
  std::vector<MeshFormat> zipped;
  for (const MeshFormat format : parameters.formats) {
    if (row_of(format).is_zipped) zipped.push_back(format);
  }
  const bool is_asked =
      std::ranges::find(parameters.formats, MeshFormat::kZip) != parameters.formats.end();
  if (zipped.empty() && is_asked) zipped.push_back(MeshFormat::kStl);
  return zipped;
}

std::string mesh_path(const std::string& job, MeshFormat format,
                      std::optional<std::int64_t> label) {
  return "/v1/jobs/" + job + "/mesh." + std::string(to_string(format)) +
         (label ? "?label=" + std::to_string(*label) : "");
}

std::string_view to_string(SampleType value) { return name_of(value); }
std::string_view to_string(NiftiForm value) { return name_of(value); }
std::string_view to_string(Scheme value) { return name_of(value); }
std::string_view to_string(Interpolation value) { return name_of(value); }
std::string_view to_string(Smoothing value) { return name_of(value); }
std::string_view to_string(MeshFormat value) { return name_of(value); }
std::string_view to_string(GlbCodec value) { return name_of(value); }
std::string_view to_string(Space value) { return name_of(value); }
std::string_view to_string(Priority value) { return name_of(value); }
std::string_view to_string(JobState value) { return name_of(value); }
std::string_view to_string(OrderState value) { return name_of(value); }
std::string_view to_string(Stage value) { return name_of(value); }
std::string_view to_string(WaitingFor value) { return name_of(value); }
std::string_view to_string(Simplification::Bound value) { return name_of(value); }

template <class Enum>
std::optional<Enum> from_string(std::string_view name) {
  for (const auto& [value, known] : Names<Enum>::kTable) {
    if (name == known) return value;
  }
  return std::nullopt;
}

template std::optional<SampleType> from_string(std::string_view);
template std::optional<NiftiForm> from_string(std::string_view);
template std::optional<Scheme> from_string(std::string_view);
template std::optional<Interpolation> from_string(std::string_view);
template std::optional<Smoothing> from_string(std::string_view);
template std::optional<MeshFormat> from_string(std::string_view);
template std::optional<GlbCodec> from_string(std::string_view);
template std::optional<Space> from_string(std::string_view);
template std::optional<Priority> from_string(std::string_view);
template std::optional<JobState> from_string(std::string_view);
template std::optional<OrderState> from_string(std::string_view);
template std::optional<Stage> from_string(std::string_view);
template std::optional<WaitingFor> from_string(std::string_view);
template std::optional<Simplification::Bound> from_string(std::string_view);

template <class Enum>
std::vector<Enum> values_of() {
  std::vector<Enum> values;
  for (const auto& [value, unused] : Names<Enum>::kTable) values.push_back(value);
  return values;
}

template std::vector<NiftiForm> values_of();
template std::vector<Scheme> values_of();
template std::vector<Interpolation> values_of();
template std::vector<Smoothing> values_of();
template std::vector<MeshFormat> values_of();
template std::vector<GlbCodec> values_of();
template std::vector<Space> values_of();
template std::vector<Priority> values_of();
template std::vector<JobState> values_of();
template std::vector<SampleType> values_of();

// Written as a number in JSON.
bool is_number(std::string_view name) { return name.find_first_not_of("0123456789") == name.npos; }

template <class Enum>
std::string names_of() {
  const auto& table = Names<Enum>::kTable;
  std::string text;
  for (std::size_t row = 0; row < table.size(); ++row) {
    if (row > 0) text += row + 1 == table.size() ? " or " : ", ";
    const std::string name(table[row].second);
    text += is_number(name) ? name : '"' + name + '"';
  }
  return text;
}

template std::string names_of<SampleType>();
template std::string names_of<NiftiForm>();
template std::string names_of<Scheme>();
template std::string names_of<Interpolation>();
template std::string names_of<Smoothing>();
template std::string names_of<MeshFormat>();
template std::string names_of<GlbCodec>();
template std::string names_of<Space>();
template std::string names_of<Priority>();
template std::string names_of<JobState>();
template std::string names_of<WaitingFor>();

}  // namespace isomesh
