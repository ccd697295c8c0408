#include "server/hospital/objects/segmentation.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <span>

#include "base/error.h"
#include "server/hospital/objects/data_set.h"
#include "server/hospital/objects/derived_object.h"
#include "server/hospital/objects/encapsulated_document.h"
#include "server/hospital/objects/uid.h"

namespace isomesh::dicom {
namespace {

constexpr Tag kPixelData = 0x7FE00010;
constexpr Tag kSegmentNumber = 0x0062000B;
constexpr Tag kPosition = 0x00200032;

using Vector = std::array<double, 3>;

double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
double length_of(const Vector& a) { return std::sqrt(dot(a, a)); }

Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

std::string little_endian(std::uint32_t number, int bytes) {
  std::string text;
  for (int byte = 0; byte < bytes; ++byte) text += static_cast<char>(number >> (8 * byte) & 0xff);
  return text;
}

void set_short(DataSet& data, Tag tag, std::uint32_t number) {
  data.set_bytes(tag, "US", little_endian(number, 2));
}

// Decimal strings (DS) of at most 16 characters.
std::string decimals(std::span<const double> numbers) {
  std::string text;
  for (const double number : numbers) {
    std::array<char, 32> digits = {};
    std::snprintf(digits.data(), digits.size(), "%.9g", number == 0 ? 0 : number);
    text += (text.empty() ? "" : "\\") + std::string(digits.data());
  }
  return text;
}

void add_pixel_description(const SegmentationObject& object, DataSet& data) {
  data.set(0x00080008, "CS", "DERIVED\\PRIMARY");  // ImageType
  set_short(data, 0x00280002, 1);                  // SamplesPerPixel
  data.set(0x00280004, "CS", "MONOCHROME2");       // PhotometricInterpretation
  data.set(0x00280008, "IS", std::to_string(object.frames.size()));
  set_short(data, 0x00280010, object.dims[1]);      // Rows
  set_short(data, 0x00280011, object.dims[0]);      // Columns
  set_short(data, 0x00280100, 1);                   // BitsAllocated
  set_short(data, 0x00280101, 1);                   // BitsStored
  set_short(data, 0x00280102, 0);                   // HighBit
  set_short(data, 0x00280103, 0);                   // PixelRepresentation
  data.set(0x00282110, "CS", "00");                 // LossyImageCompression
  data.set(0x00620001, "CS", "BINARY");             // SegmentationType
  data.set(0x00700080, "CS", "SEGMENTATION");       // ContentLabel
  data.set(0x00700081, "LO", object.common.title);  // ContentDescription
  data.set(0x00700084, "PN", "");                   // ContentCreatorName
}

DataSet segment_item(const SegmentationObject& object, std::size_t place) {
  const SegmentationSegment& segment = object.segments[place];
  // The standard wants codes, but a label volume has none.
  const DicomCode tissue = {"85756007", "SCT", "Tissue"};
  DataSet item;
  item.set_sequence(0x00620003, {code_item(tissue)});  // SegmentedPropertyCategoryCodeSequence
  set_short(item, 0x00620004, static_cast<std::uint32_t>(place + 1));
  item.set(0x00620005, "LO", segment.name);                              // SegmentLabel
  item.set(0x00620006, "ST", "label " + std::to_string(segment.label));  // SegmentDescription
  item.set(0x00620008, "CS", "AUTOMATIC");                               // SegmentAlgorithmType
  item.set(0x00620009, "LO", object.common.title);                       // SegmentAlgorithmName
  if (segment.color) {
    std::string lab;
    for (const std::uint16_t part : cielab_of(*segment.color)) lab += little_endian(part, 2);
    item.set_bytes(0x0062000D, "US", lab);  // RecommendedDisplayCIELabValue
  }
  item.set_sequence(0x0062000F, {code_item(tissue)});  // SegmentedPropertyTypeCodeSequence
  return item;
}

void add_dimensions(const SegmentationObject& object, DataSet& data) {
  const std::string organization = name_based_uid("dimensions\n" + object.common.sop_instance_uid);
  const auto index = [&](Tag pointer, Tag group) {
    const auto tag_bytes = [](Tag tag) {
      return little_endian(tag >> 16, 2) + little_endian(tag & 0xffff, 2);
    };
    DataSet item;
    item.set(0x00209164, "UI", organization);              // DimensionOrganizationUID
    item.set_bytes(0x00209165, "AT", tag_bytes(pointer));  // DimensionIndexPointer
    item.set_bytes(0x00209167, "AT", tag_bytes(group));    // FunctionalGroupPointer
    return item;
  };
  DataSet dimensions;
  dimensions.set(0x00209164, "UI", organization);
  data.set_sequence(0x00209221, {dimensions});  // DimensionOrganizationSequence
  data.set_sequence(0x00209222,                 // DimensionIndexSequence
                    {index(kSegmentNumber, 0x0062000A), index(kPosition, 0x00209113)});
}

// The functional groups of all frames.
DataSet shared_groups(const SegmentationObject& object) {
  const Vector& across = object.steps[0];
  const Vector& down = object.steps[1];
  const double columns = length_of(across);
  const double rows = length_of(down);
  const Vector normal = cross(across, down);
  const double apart = std::abs(dot(object.steps[2], normal)) / length_of(normal);
  DataSet measures;
  measures.set(0x00180050, "DS", decimals({{apart}}));          // SliceThickness
  measures.set(0x00180088, "DS", decimals({{apart}}));          // SpacingBetweenSlices
  measures.set(0x00280030, "DS", decimals({{rows, columns}}));  // PixelSpacing
  std::array<double, 6> cosines = {};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    cosines[axis] = across[axis] / columns;
    cosines[axis + 3] = down[axis] / rows;
  }
  DataSet orientation;
  orientation.set(0x00200037, "DS", decimals(cosines));  // ImageOrientationPatient
  DataSet groups;
  groups.set_sequence(0x00209116, {orientation});  // PlaneOrientationSequence
  groups.set_sequence(0x00289110, {measures});     // PixelMeasuresSequence
  return groups;
}

DataSet groups_of(const SegmentationObject& object, const SegmentationFrame& frame) {
  const DicomInstance& image = object.common.identity.instances[frame.slice];
  DataSet source = reference_to(image.sop_class_uid, image.sop_instance_uid);
  source.set(0x0028135A, "CS", "YES");  // SpatialLocationsPreserved
  source.set_sequence(
      0x0040A170,  // PurposeOfReferenceCodeSequence
      {code_item({"121322", "DCM", "Source image for image processing operation"})});
  DataSet derivation;
  derivation.set_sequence(0x00082112, {source});  // SourceImageSequence
  derivation.set_sequence(0x00089215,             // DerivationCodeSequence
                          {code_item({"113076", "DCM", "Segmentation"})});
  DataSet content;
  content.set_bytes(0x00209157, "UL",  // DimensionIndexValues
                    little_endian(frame.segment, 4) + little_endian(frame.slice + 1, 4));
  Vector position = object.origin;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    position[axis] += frame.slice * object.steps[2][axis];
  }
  DataSet plane;
  plane.set(kPosition, "DS", decimals(position));
  DataSet segment;
  set_short(segment, kSegmentNumber, frame.segment);
  DataSet groups;
  groups.set_sequence(0x00089124, {derivation});  // DerivationImageSequence
  groups.set_sequence(0x00209111, {content});     // FrameContentSequence
  groups.set_sequence(0x00209113, {plane});       // PlanePositionSequence
  groups.set_sequence(0x0062000A, {segment});     // SegmentIdentificationSequence
  return groups;
}

void add_groups(const SegmentationObject& object, DataSet& data) {
  data.set_sequence(0x52009229, {shared_groups(object)});
  std::string items;
  for (const SegmentationFrame& frame : object.frames) {
    DataSet::append_item(groups_of(object, frame), items);
  }
  data.set_bytes(0x52009230, "SQ", items);
}

void check_size(const SegmentationObject& object) {
  check_frames(object.frames.size());
  if (segmentation_pixel_bytes(object) > kMostDocumentBytes) {
    throw Error(ErrorCode::kTooLarge,
                "the segmentation has more bytes than a DICOM object can hold; order fewer labels");
  }
}

}  // namespace

void check_frames(std::size_t frames) {
  if (frames <= kMostFrames) return;
  throw Error(ErrorCode::kTooLarge, "the segmentation has more than " +
                                        std::to_string(kMostFrames) +
                                        " frames, the most of an object; order fewer labels");
}

std::uint64_t segmentation_pixel_bytes(const SegmentationObject& object) {
  const std::uint64_t bits = std::uint64_t{object.dims[0]} * object.dims[1] * object.frames.size();
  return (bits + 15) / 16 * 2;
}

std::array<std::uint16_t, 3> cielab_of(std::string_view color) {
  // From sRGB to XYZ with the white point D50, which profiles and DICOM use.
  constexpr std::array<Vector, 3> kToXyz = {Vector{0.4360747, 0.3850649, 0.1430804},
                                            Vector{0.2225045, 0.7168786, 0.0606169},
                                            Vector{0.0139322, 0.0971045, 0.7141733}};
  constexpr Vector kWhite = {0.9642200, 1.0, 0.8252100};
  Vector linear = {};
  for (std::size_t part = 0; part < 3; ++part) {
    const std::string digits(color.substr(1 + 2 * part, 2));
    const double value = std::stoi(digits, nullptr, 16) / 255.0;
    linear[part] = value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
  }
  Vector f = {};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double t = dot(kToXyz[axis], linear) / kWhite[axis];
    constexpr double kLinearBelow = 216.0 / 24389;
    f[axis] = t > kLinearBelow ? std::cbrt(t) : (24389.0 / 27 * t + 16) / 116;
  }
  const auto scaled = [](double value, double low, double width) {
    return static_cast<std::uint16_t>(
        std::lround(std::clamp((value - low) / width, 0.0, 1.0) * 65535));
  };
  return {scaled(116 * f[1] - 16, 0, 100), scaled(500 * (f[0] - f[1]), -128, 255),
          scaled(200 * (f[1] - f[2]), -128, 255)};
}

std::string segmentation_head(const SegmentationObject& object) {
  check_size(object);
  DataSet data = derived_object(object.common, kSegmentationStorage, "SEG");
  add_frame_of_reference(object.common.identity, data);
  add_pixel_description(object, data);
  std::vector<DataSet> segments;
  for (std::size_t place = 0; place < object.segments.size(); ++place) {
    segments.push_back(segment_item(object, place));
  }
  data.set_sequence(0x00620002, segments);  // SegmentSequence
  const DicomIdentity& identity = object.common.identity;
  data.set_sequence(0x00081115,  // ReferencedSeriesSequence
                    {series_item(identity.series_uid, references_to(identity))});
  add_dimensions(object, data);
  add_groups(object, data);
  return file_head(kSegmentationStorage, object.common.sop_instance_uid, kExplicitLittleEndian) +
         data.bytes() +
         element_head(kPixelData, "OB",
                      static_cast<std::uint32_t>(segmentation_pixel_bytes(object)));
}

}  // namespace isomesh::dicom
