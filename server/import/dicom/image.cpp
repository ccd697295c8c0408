#include "server/import/dicom/image.h"

#include <algorithm>
#include <cmath>

#include "base/text.h"
#include "server/import/dicom/decode.h"
#include "server/import/dicom/dose.h"
#include "server/import/dicom/tags.h"
#include "server/import/dicom/text.h"
#include "server/import/source.h"

namespace isomesh::import::dicom {
namespace {

// For direction cosines, which are often written with only four decimals.
constexpr double kCosineTolerance = 1e-3;
constexpr std::uint32_t kMostFrames = 1U << 20;
// A bound, because one frame is decoded in memory.
constexpr std::uint64_t kMostFrameBytes = std::uint64_t{1} << 29;

unsigned required(const DataSet& data, Tag tag, std::string_view name) {
  if (const auto number = data.unsigned_number(tag)) return *number;
  throw_unusable("The DICOM image does not tell its " + std::string(name) + ' ' + tag_name(tag) +
                 ".");
}

std::uint32_t frame_count(const DataSet& data) {
  if (data.text(kNumberOfFrames).empty()) return 1;
  const auto count = data.integer(kNumberOfFrames);
  if (count && *count > 0 && *count <= kMostFrames) return static_cast<std::uint32_t>(*count);
  throw_unusable("The DICOM image's number of frames is " + in_quotes(data.text(kNumberOfFrames)) +
                 ".");
}

void refuse_other_than_gray(const DataSet& data) {
  const auto samples = data.unsigned_number(kSamplesPerPixel).value_or(1);
  const std::string_view photometric = data.text(kPhotometricInterpretation);
  if (samples == 1 && photometric.starts_with("MONOCHROME")) return;
  if (samples == 1 && photometric == "PALETTE COLOR") {
    throw_unusable("The DICOM image's samples are indices into a palette of colours.");
  }
  throw_unusable("The DICOM image is in colour: " + in_quotes(photometric) + " with " +
                 std::to_string(samples) + " samples a pixel.");
}

PixelLayout pixel_layout(const DataSet& data) {
  PixelLayout layout;
  layout.columns = required(data, kColumns, "columns");
  layout.rows = required(data, kRows, "rows");
  layout.bits_allocated = required(data, kBitsAllocated, "bits allocated");
  layout.bits_stored = data.unsigned_number(kBitsStored).value_or(layout.bits_allocated);
  layout.high_bit = data.unsigned_number(kHighBit).value_or(layout.bits_stored - 1);
  layout.is_signed = data.unsigned_number(kPixelRepresentation).value_or(0) != 0;
  if (layout.columns == 0 || layout.rows == 0) throw_unusable("The DICOM image's size is 0.");
  const unsigned allocated = layout.bits_allocated;
  if (allocated != 8 && allocated != 16 && allocated != 32) {
    throw_unusable("The DICOM image's samples have " + std::to_string(allocated) +
                   " bits; 8, 16 and 32 are read.");
  }
  if (layout.bits_stored == 0 || layout.bits_stored > allocated || layout.high_bit >= allocated ||
      layout.high_bit + 1 < layout.bits_stored) {
    throw_unusable("The DICOM image's bits contradict each other: " +
                   std::to_string(layout.bits_stored) + " stored up to bit " +
                   std::to_string(layout.high_bit) + " of " + std::to_string(allocated) + ".");
  }
  return layout;
}

// Empty where it is not told.
bool is_native_syntax(std::string_view syntax) {
  return syntax.empty() || syntax == kImplicitLittleEndian || syntax == kExplicitLittleEndian ||
         syntax == kDeflated || syntax == kExplicitBigEndian;
}

void require_pixels(const DicomFile& file, const PixelLayout& layout, std::uint32_t frames) {
  const auto& pixels = file.pixels();
  const std::string& syntax = file.transfer_syntax();
  if (!pixels) throw_unusable("The DICOM image holds no pixel data.");
  if (!(pixels->is_encapsulated ? can_decode(syntax) : is_native_syntax(syntax))) {
    throw_unusable("The DICOM image's transfer syntax " + in_quotes(syntax) +
                   (pixels->is_encapsulated ? " is not one of compressed samples that are read."
                                            : " is not one of plain samples."));
  }
  if (pixels->tag != kPixelData) {
    throw_unusable("The DICOM image's pixels are floating-point numbers, which are not read.");
  }
  const std::uint64_t expected = layout.frame_bytes() * frames;
  if (!pixels->is_encapsulated && pixels->native.bytes < expected) {
    throw_unusable("The DICOM image's pixel data is truncated: " + std::to_string(layout.columns) +
                   " x " + std::to_string(layout.rows) + " x " + std::to_string(frames) +
                   " samples take " + std::to_string(expected) + " bytes, and " +
                   std::to_string(pixels->native.bytes) + " are there.");
  }
  if (pixels->is_encapsulated && pixels->fragments.size() < frames) {
    throw_unusable("The DICOM image's pixel data is truncated: it has " + std::to_string(frames) +
                   " frames, and " + std::to_string(pixels->fragments.size()) +
                   " compressed fragments are there.");
  }
  if (layout.frame_bytes() > kMostFrameBytes) {
    throw_unusable("One frame of the DICOM image is " + std::to_string(layout.columns) + " x " +
                   std::to_string(layout.rows) + " samples, more than can be decoded.");
  }
}

// The places where a frame's attributes may be: its own functional groups, the shared ones, and, in
// an object of one frame, the object itself.
class Attributes {
 public:
  Attributes(const DataSet& data, std::uint32_t frame) : data_(data) {
    shared_ = data.item(kSharedFunctionalGroups);
    const Element* frames = data.find(kPerFrameFunctionalGroups);
    if (frames != nullptr && frame < frames->items.size()) own_ = &frames->items[frame];
  }

  // The group for the frame, its own or the shared one; null when there is neither.
  const DataSet* group(Tag sequence) const {
    if (own_ != nullptr) {
      if (const DataSet* item = own_->item(sequence)) return item;
    }
    return shared_ == nullptr ? nullptr : shared_->item(sequence);
  }

  // The data set in which an attribute of a group is looked for.
  const DataSet& place(Tag sequence) const {
    const DataSet* found = group(sequence);
    return found == nullptr ? data_ : *found;
  }

 private:
  const DataSet& data_;
  const DataSet* shared_ = nullptr;
  const DataSet* own_ = nullptr;
};

std::vector<double> required_numbers(const DataSet& data, Tag tag, std::size_t count,
                                     std::string_view name) {
  std::vector<double> numbers = data.numbers(tag);
  if (numbers.size() == count) return numbers;
  const std::string_view text = data.text(tag);
  if (text.empty()) {
    throw_unusable("The DICOM image does not tell its " + std::string(name) + ' ' + tag_name(tag) +
                   ", without which its frames lie nowhere in the patient.");
  }
  throw_unusable("The DICOM image's " + std::string(name) + ' ' + tag_name(tag) + " is " +
                 in_quotes(text) + ", not " + std::to_string(count) + " numbers.");
}

double dot(const Vector3& a, const Vector3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Vector3 unit_vector(const double* parts) {
  Vector3 vector = {parts[0], parts[1], parts[2]};
  const double length = std::sqrt(dot(vector, vector));
  if (!(std::abs(length - 1) <= kCosineTolerance)) {
    throw_unusable("The DICOM image's orientation is not made of unit vectors.");
  }
  for (double& part : vector) part /= length;
  return vector;
}

Plane plane_of(const Attributes& attributes) {
  const auto position =
      required_numbers(attributes.place(kPlanePositionSequence), kImagePosition, 3, "position");
  const auto cosines = required_numbers(attributes.place(kPlaneOrientationSequence),
                                        kImageOrientation, 6, "orientation");
  const auto spacing =
      required_numbers(attributes.place(kPixelMeasuresSequence), kPixelSpacing, 2, "pixel spacing");
  Plane plane;
  std::copy(position.begin(), position.end(), plane.position.begin());
  plane.along_row = unit_vector(cosines.data());
  plane.along_column = unit_vector(cosines.data() + 3);
  if (std::abs(dot(plane.along_row, plane.along_column)) > kCosineTolerance) {
    throw_unusable("The DICOM image's rows and columns are not at right angles.");
  }
  // The file tells the distance between rows first, then that between columns.
  plane.spacing = {spacing[1], spacing[0]};
  if (!(spacing[0] > 0 && spacing[1] > 0)) {
    throw_unusable("The DICOM image's pixel spacing is not positive.");
  }
  return plane;
}

Rescale rescale_of(const DataSet& data) {
  Rescale rescale;
  if (data.text(kRescaleSlope).empty() && data.text(kRescaleIntercept).empty()) return rescale;
  const auto slope = data.numbers(kRescaleSlope);
  const auto intercept = data.numbers(kRescaleIntercept);
  if (slope.size() != 1 || slope[0] == 0 || intercept.size() != 1) {
    throw_unusable("The DICOM image's rescale slope " + in_quotes(data.text(kRescaleSlope)) +
                   " and intercept " + in_quotes(data.text(kRescaleIntercept)) +
                   " give its samples no values.");
  }
  return {slope[0], intercept[0]};
}

std::vector<Phase> phases_of(const DataSet& data, const Attributes& attributes) {
  struct Row {
    std::string_view name;
    Tag tag;
  };
  static constexpr Row kRows[] = {{"TemporalPositionIdentifier", kTemporalPositionIdentifier},
                                  {"TriggerTime", kTriggerTime},
                                  {"EchoTime", kEchoTime},
                                  {"AcquisitionNumber", kAcquisitionNumber}};
  std::vector<Phase> phases;
  for (const Row& row : kRows) phases.push_back({row.name, std::string(data.text(row.tag))});
  if (const DataSet* content = attributes.group(kFrameContentSequence)) {
    const auto index = content->unsigned_number(kTemporalPositionIndex);
    phases.push_back({"TemporalPositionIndex", index ? std::to_string(*index) : ""});
  }
  return phases;
}

bool is_multi_frame(const DataSet& data) {
  return data.find(kSharedFunctionalGroups) != nullptr ||
         data.find(kPerFrameFunctionalGroups) != nullptr;
}

void refuse_unplaced_frames(const DataSet& data, std::uint32_t frames) {
  const Element* groups = data.find(kPerFrameFunctionalGroups);
  if (frames == 1) return;
  if (!is_multi_frame(data)) {
    throw_unusable("The DICOM image has " + std::to_string(frames) +
                   " frames and does not tell where each of them lies in the patient.");
  }
  const std::size_t placed = groups == nullptr ? 0 : groups->items.size();
  if (placed != frames) {
    throw_unusable("The DICOM image has " + std::to_string(frames) + " frames and describes " +
                   std::to_string(placed) + '.');
  }
}

}  // namespace

std::optional<std::string> reason_to_ignore(const DicomFile& file) {
  const DataSet& data = file.data();
  if (data.find(kDirectoryRecordSequence) != nullptr) return "it is a directory of DICOM files";
  if (data.find(kRows) == nullptr && !file.pixels()) {
    return "it is no image (modality " + in_quotes(data.text(kModality)) + ")";
  }
  const auto types = data.texts(kImageType);
  if (std::find(types.begin(), types.end(), "LOCALIZER") != types.end()) {
    return "it is a localiser";
  }
  return std::nullopt;
}

Image describe_image(const DicomFile& file) {
  const DataSet& data = file.data();
  Image image;
  image.frame_of_reference_uid = data.text(kFrameOfReferenceUid);
  image.modality = utf8(data, kModality);
  image.photometric = data.text(kPhotometricInterpretation);
  image.instance_number = data.integer(kInstanceNumber);
  const std::uint32_t frames = frame_count(data);
  refuse_other_than_gray(data);
  image.layout = pixel_layout(data);
  require_pixels(file, image.layout, frames);
  if (data.item(kModalityLutSequence) != nullptr) {
    throw_unusable("The DICOM image gives its samples their values by a table, which is not read.");
  }
  if (!is_dose(data)) refuse_unplaced_frames(data, frames);
  for (std::uint32_t number = 0; number < frames; ++number) {
    const Attributes attributes(data, number);
    const DataSet& values = attributes.place(kPixelValueTransformationSequence);
    if (number == 0) image.rescale_type = values.text(kRescaleType);
    image.frames.push_back(
        {number, plane_of(attributes), rescale_of(values), phases_of(data, attributes)});
  }
  if (is_dose(data)) place_dose(data, image.frames);
  return image;
}

}  // namespace isomesh::import::dicom
