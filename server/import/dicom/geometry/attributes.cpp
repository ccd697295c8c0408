#include "server/import/dicom/geometry/attributes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "base/text.h"
#include "server/import/dicom/elements/private_elements.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/elements/text.h"
#include "server/import/dicom/geometry/vectors.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

// For direction cosines, often written with only four decimals.
constexpr double kCosineTolerance = 1e-3;
// Cosines that are farther away from perpendicular unit vectors are damaged.
constexpr double kMostSkew = 5;  // degrees
constexpr double kMostStretch = 0.05;

enum class Kind { kText, kReal, kWord };

// The group of rows that are set from elsewhere: no tag of a sequence.
constexpr Tag kNoGroup = 0xFFFFFFFF;

enum class Role {
  kVolume,  // scanners give each volume one value
  kStep,    // a step of a protocol
  kTaken    // a slice that was taken twice differs from its copy, too
};

struct PhaseRow {
  std::string_view name;
  Tag group;  // 0: the object itself
  Tag tag;
  Kind kind;
  Role role = Role::kVolume;
};

constexpr std::array kPhaseRows = {
    PhaseRow{"TemporalPositionIdentifier", 0, kTemporalPositionIdentifier, Kind::kText},
    PhaseRow{"TemporalPositionIndex", kFrameContentSequence, kTemporalPositionIndex, Kind::kWord},
    PhaseRow{"TemporalPositionTimeOffset", kTemporalPositionSequence, kTemporalPositionTimeOffset,
             Kind::kReal},
    PhaseRow{"DataType", kUsImageDescriptionSequence, kDataType, Kind::kText},
    // Frames of nuclear medicine have no groups (kinds/placed_frames.h).
    PhaseRow{"EnergyWindowVector", kNoGroup, kEnergyWindowVector, Kind::kWord},
    PhaseRow{"RRIntervalVector", kNoGroup, kRrIntervalVector, Kind::kWord},
    PhaseRow{"TimeSlotVector", kNoGroup, kTimeSlotVector, Kind::kWord},
    PhaseRow{"EchoTime", 0, kEchoTime, Kind::kText},
    PhaseRow{"EffectiveEchoTime", kMrEchoSequence, kEffectiveEchoTime, Kind::kReal},
    PhaseRow{"EchoNumbers", 0, kEchoNumbers, Kind::kText},
    PhaseRow{"DiffusionBValue", kMrDiffusionSequence, kDiffusionBValue, Kind::kReal},
    PhaseRow{"DiffusionBValue", 0, kDiffusionBValue, Kind::kReal},
    PhaseRow{"B_value", 0, kSiemensBValue, Kind::kText},
    PhaseRow{"BActualValue", 0, kGridBValue, Kind::kReal},
    PhaseRow{"DiffusionGradientOrientation", kDiffusionGradientSequence, kDiffusionGradient,
             Kind::kReal, Role::kStep},
    PhaseRow{"InversionTime", 0, kInversionTime, Kind::kText, Role::kStep},
    PhaseRow{"FlipAngle", 0, kFlipAngle, Kind::kText, Role::kStep},
    PhaseRow{"ComplexImageComponent", kMrImageFrameTypeSequence, kComplexImageComponent,
             Kind::kText},
    PhaseRow{"FrameType", kMrImageFrameTypeSequence, kFrameType, Kind::kText, Role::kTaken},
    PhaseRow{"ImageType", 0, kImageType, Kind::kText, Role::kTaken},
    PhaseRow{"TriggerTime", 0, kTriggerTime, Kind::kText, Role::kStep},
    PhaseRow{"NominalCardiacTriggerDelayTime", kCardiacSequence, kNominalTriggerDelay, Kind::kReal,
             Role::kStep},
    PhaseRow{"StackID", kFrameContentSequence, kStackId, Kind::kText},
    PhaseRow{"AcquisitionNumber", 0, kAcquisitionNumber, Kind::kText, Role::kTaken},
    PhaseRow{"AcquisitionDateTime", 0, kAcquisitionDateTime, Kind::kText, Role::kTaken},
    PhaseRow{"AcquisitionTime", 0, kAcquisitionTime, Kind::kText, Role::kTaken},
    PhaseRow{"ContentTime", 0, kContentTime, Kind::kText, Role::kTaken},
};

bool all_finite(const std::vector<double>& numbers) {
  return std::ranges::all_of(numbers, [](double number) { return std::isfinite(number); });
}

// File texts that appear in messages.
constexpr std::size_t kLongestPhase = 64;

std::string value_of(const DataSet& data, const PhaseRow& row) {
  std::string value;
  switch (row.kind) {
    case Kind::kText:
      value = utf8(data, row.tag);
      break;
    case Kind::kReal:
      for (const double number : data.binary_reals(row.tag)) {
        value += (value.empty() ? "" : "\\") + to_text(number);
      }
      break;
    case Kind::kWord:
      if (const auto number = data.unsigned_number(row.tag)) value = std::to_string(*number);
      break;
  }
  return std::string(beginning(value, kLongestPhase));
}

constexpr auto kPhaseNames = [] {
  std::array<std::string_view, kPhaseRows.size()> names;
  std::ranges::transform(kPhaseRows, names.begin(), &PhaseRow::name);
  return names;
}();

// The row's group among functional groups, or null.
const DataSet* group_of(const PhaseRow& row, const DataSet& groups) {
  if (row.group != kDiffusionGradientSequence) return groups.item(row.group);
  // The gradient's direction is in a sequence within its group.
  const DataSet* diffusion = groups.item(kMrDiffusionSequence);
  return diffusion == nullptr ? nullptr : diffusion->item(row.group);
}

// The rows with a value in `groups`, which may be null, and, with `object`, the rows without a
// group that have one there.
std::vector<Phase> phases_in(const DataSet* groups, const DataSet* object) {
  std::vector<Phase> phases;
  for (std::size_t at = 0; at < kPhaseRows.size(); ++at) {
    const PhaseRow& row = kPhaseRows[at];
    const DataSet* place = row.group == 0      ? object
                           : groups == nullptr ? nullptr
                                               : group_of(row, *groups);
    std::string value = place == nullptr ? std::string() : value_of(*place, row);
    if (!value.empty()) phases.push_back({at, std::move(value)});
  }
  return phases;
}

std::optional<double> factor(const DataSet& data, Tag tag) {
  const std::string_view text = data.text(tag);
  if (text.empty()) return std::nullopt;
  const auto numbers = data.numbers(tag);
  if (numbers.size() == 1 && !(tag == kRescaleSlope && numbers[0] == 0)) return numbers[0];
  throw_unusable("The DICOM image's rescale slope " + in_quotes(data.text(kRescaleSlope)) +
                 " and intercept " + in_quotes(data.text(kRescaleIntercept)) +
                 " do not define the values of its samples.");
}

Vector3 unit_vector(const double* parts, double tolerance) {
  Vector3 vector = {parts[0], parts[1], parts[2]};
  const double size = std::sqrt(dot(vector, vector));
  if (!(std::abs(size - 1) <= tolerance)) {
    throw_unusable("The DICOM image's orientation " + tag_name(kImageOrientation) +
                   " does not consist of unit vectors.");
  }
  for (double& part : vector) part /= size;
  return vector;
}

// Turns both directions by the same angle. The sum and the difference of two unit vectors are
// always perpendicular.
void make_perpendicular(Plane& plane) {
  const double cosine = dot(plane.along_row, plane.along_column);
  if (std::abs(cosine) <= kCosineTolerance) return;
  const double angle = std::asin(std::min(std::abs(cosine), 1.0)) * 180 / std::numbers::pi;
  if (angle > kMostSkew) {
    throw_unusable("The DICOM image's rows and columns are not perpendicular: their directions " +
                   tag_name(kImageOrientation) + " are " + to_text(std::round(angle * 10) / 10) +
                   " degrees away from it.");
  }
  plane.skew = angle;
  Vector3 sum = moved(plane.along_row, plane.along_column, 1);
  Vector3 rest = difference(plane.along_row, plane.along_column);
  const double sum_size = length(sum) * std::numbers::sqrt2;
  const double rest_size = length(rest) * std::numbers::sqrt2;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double half = sum[axis] / sum_size;
    const double other = rest[axis] / rest_size;
    plane.along_row[axis] = half + other;
    plane.along_column[axis] = half - other;
  }
}

// Ultrasound volumes are placed in their own space (PS3.3, C.7.6.16.2.21), with binary numbers.
std::vector<double> volume_numbers(const Attributes& attributes, Tag group, Tag tag) {
  const DataSet* place = attributes.group(group);
  return place == nullptr ? std::vector<double>() : place->binary_reals(tag);
}

std::vector<double> position_of(const Attributes& attributes) {
  if (attributes.group(kPlanePositionSequence) == nullptr) {
    auto told = volume_numbers(attributes, kPlanePositionVolumeSequence, kImagePositionVolume);
    if (told.size() == 3 && all_finite(told)) return told;
  }
  return required_numbers(attributes.place(kPlanePositionSequence), kImagePosition, 3, "position");
}

std::vector<double> cosines_of(const Attributes& attributes) {
  if (attributes.group(kPlaneOrientationSequence) == nullptr) {
    auto told =
        volume_numbers(attributes, kPlaneOrientationVolumeSequence, kImageOrientationVolume);
    if (told.size() == 6 && all_finite(told)) return told;
  }
  return required_numbers(attributes.place(kPlaneOrientationSequence), kImageOrientation, 6,
                          "orientation");
}

}  // namespace

Attributes::Attributes(const DataSet& data, std::uint32_t frame)
    : data_(data), shared_(data.item(kSharedFunctionalGroups)) {
  const auto frames = data.items(kPerFrameFunctionalGroups);
  if (frame < frames.size()) own_ = &frames[frame];
}

std::span<const DataSet> Attributes::items(Tag sequence) const {
  for (const DataSet* groups : {own_, shared_}) {
    const auto found = groups == nullptr ? std::span<const DataSet>() : groups->items(sequence);
    if (!found.empty()) return found;
  }
  return {};
}

const DataSet* Attributes::group(Tag sequence) const {
  const auto found = items(sequence);
  return found.empty() ? nullptr : &found.front();
}

const DataSet& Attributes::place(Tag sequence) const {
  const DataSet* found = group(sequence);
  return found == nullptr ? data_ : *found;
}

bool is_in_volume_space(const Attributes& attributes) {
  return attributes.group(kPlanePositionSequence) == nullptr &&
         attributes.group(kPlanePositionVolumeSequence) != nullptr;
}

bool has_functional_groups(const DataSet& data) {
  return data.find(kSharedFunctionalGroups) != nullptr ||
         data.find(kPerFrameFunctionalGroups) != nullptr;
}

std::vector<double> required_numbers(const DataSet& data, Tag tag, std::size_t count,
                                     std::string_view name) {
  std::vector<double> numbers = data.numbers(tag);
  if (numbers.size() == count) return numbers;
  const std::string_view text = data.text(tag);
  if (text.empty()) {
    throw_unusable("The DICOM image has no " + std::string(name) + ' ' + tag_name(tag) +
                   ", so its place in the patient is unknown.");
  }
  throw_unusable("The DICOM image's " + std::string(name) + ' ' + tag_name(tag) + " is " +
                 in_quotes(text) + ", not " + std::to_string(count) + " numbers.");
}

Vector3 unit_vector(const double* parts) { return unit_vector(parts, kCosineTolerance); }

Plane plane_of(const Attributes& attributes) {
  const auto position = position_of(attributes);
  Plane plane = placeless_plane_of(attributes);
  std::copy(position.begin(), position.end(), plane.position.begin());
  return plane;
}

Plane placeless_plane_of(const Attributes& attributes) {
  return plane_of(cosines_of(attributes), required_numbers(attributes.place(kPixelMeasuresSequence),
                                                           kPixelSpacing, 2, "pixel spacing"));
}

Plane plane_of(const std::vector<double>& cosines, const std::vector<double>& spacing) {
  Plane plane;
  plane.along_row = unit_vector(cosines.data(), kMostStretch);
  plane.along_column = unit_vector(cosines.data() + 3, kMostStretch);
  for (const std::size_t at : {0U, 3U}) {
    const double off = std::abs(std::hypot(cosines[at], cosines[at + 1], cosines[at + 2]) - 1);
    if (off > kCosineTolerance) plane.stretch = std::max(plane.stretch, off);
  }
  make_perpendicular(plane);
  // The file has the distance between rows first, then that between columns.
  plane.spacing = {spacing[1], spacing[0]};
  if (!(spacing[0] > 0 && spacing[1] > 0)) {
    throw_unusable("The DICOM image's pixel spacing is not positive.");
  }
  return plane;
}

void set_rescale(const DataSet& data, Frame& frame) {
  const std::optional<double> slope = factor(data, kRescaleSlope);
  const std::optional<double> intercept = factor(data, kRescaleIntercept);
  frame.rescale = {slope.value_or(1), intercept.value_or(0)};
  frame.has_slope = slope.has_value();
  frame.has_intercept = intercept.has_value();
}

std::span<const std::string_view> phase_names() { return kPhaseNames; }

std::size_t phase_attribute(std::string_view name) {
  return static_cast<std::size_t>(std::ranges::find(kPhaseNames, name) - kPhaseNames.begin());
}

bool is_planned(std::string_view phase_name) {
  const auto* row = std::ranges::find(kPhaseRows, phase_name, &PhaseRow::name);
  return row != kPhaseRows.end() && row->role != Role::kTaken;
}

bool is_of_volumes(std::string_view phase_name) {
  const auto* row = std::ranges::find(kPhaseRows, phase_name, &PhaseRow::name);
  return row != kPhaseRows.end() && row->role == Role::kVolume;
}

std::vector<Phase> phases_of_object(const DataSet& data) {
  return phases_in(data.item(kSharedFunctionalGroups), &data);
}

std::vector<Phase> phases_of_frame(const DataSet& data, std::uint32_t frame) {
  const auto frames = data.items(kPerFrameFunctionalGroups);
  return frame < frames.size() ? phases_in(&frames[frame], nullptr) : std::vector<Phase>();
}

}  // namespace isomesh::import::dicom
