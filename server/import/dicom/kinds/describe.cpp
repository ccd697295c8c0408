#include "server/import/dicom/kinds/describe.h"

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>

#include "base/text.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/elements/text.h"
#include "server/import/dicom/geometry/attributes.h"
#include "server/import/dicom/kinds/parametric_map.h"
#include "server/import/dicom/kinds/placed_frames.h"
#include "server/import/dicom/kinds/segmentation.h"
#include "server/import/dicom/pixels/pixel_layout.h"
#include "server/import/dicom/pixels/value_table.h"
#include "server/import/source/source.h"
#include "server/volume/object_classes.h"

namespace isomesh::import::dicom {
namespace {

constexpr std::uint32_t kMostFrames = 1U << 20;

std::uint32_t frame_count(const DataSet& data) {
  if (data.text(kNumberOfFrames).empty()) return 1;
  const auto count = data.integer(kNumberOfFrames);
  if (count && *count > 0 && *count <= kMostFrames) return static_cast<std::uint32_t>(*count);
  throw_unusable("The DICOM image's number of frames is " + in_quotes(data.text(kNumberOfFrames)) +
                 ", not a number from 1 to " + std::to_string(kMostFrames) + ".");
}

void refuse_unplaced_frames(const DataSet& data, std::uint32_t frames) {
  const Element* groups = data.find(kPerFrameFunctionalGroups);
  if (frames == 1) return;
  if (!has_functional_groups(data)) {
    throw_unusable("The DICOM image has " + std::to_string(frames) +
                   " frames, but no position for each of them.");
  }
  const std::size_t placed = groups == nullptr ? 0 : groups->items.size();
  if (placed != frames) {
    throw_unusable("The DICOM image has " + std::to_string(frames) + " frames, but describes " +
                   std::to_string(placed) + '.');
  }
}

void check_label_layout(const Segmentation& segmentation, const PixelLayout& layout) {
  const bool is_binary = segmentation.kind == SegmentKind::kBinary;
  const bool is_label_map = segmentation.kind == SegmentKind::kLabelMap;
  const bool fits = layout.bits_allocated == (is_binary ? 1U : 8U) ||
                    (is_label_map && layout.bits_allocated == 16);
  if (fits && !layout.is_signed && !layout.is_float) return;
  throw_unusable("The DICOM segmentation's samples cannot be labels: they have " +
                 std::to_string(layout.bits_allocated) + " bits" +
                 (layout.is_signed ? " and a sign." : "."));
}

// The most common reason for an unusable file: a picture made by some program.
void refuse_placeless(const DataSet& data, std::uint32_t frames) {
  if (frames > 1 || has_functional_groups(data) || is_placed_grid(data)) return;
  for (const auto& [tag, name] :
       {std::pair{kImagePosition, "position"}, std::pair{kImageOrientation, "orientation"},
        std::pair{kPixelSpacing, "pixel spacing"}}) {
    if (!data.text(tag).empty()) continue;
    throw_unusable("The DICOM image has 1 slice and no " + std::string(name) + ' ' + tag_name(tag) +
                   ", so it is a flat image and cannot be part of a volume.");
  }
}

// Single bits become 8-bit samples, and values of a table 16-bit ones.
PixelLayout decoded_layout(const Image& image) {
  PixelLayout layout = image.stored;
  if (layout.bits_allocated != 1 && !image.table) return layout;
  layout.bits_allocated = image.table ? 16 : 8;
  layout.bits_stored = layout.bits_allocated;
  layout.high_bit = layout.bits_stored - 1;
  layout.is_signed = false;
  return layout;
}

void set_values(const DataSet& data, const Attributes& attributes, Image& image, Frame& frame) {
  if (image.table) {
    frame.has_slope = frame.has_intercept = true;
    return;
  }
  set_rescale(attributes.place(kPixelValueTransformationSequence), frame);
  if (!is_parametric_map(data)) return;
  const std::uint32_t mappings = set_real_world_values(attributes, image.stored, frame);
  image.value_mappings = std::max(image.value_mappings, mappings);
  // Another frame's mapping does not apply to this one.
  if (mappings == 0) frame.has_slope = frame.has_intercept = false;
}

Frame describe_frame(const DataSet& data, std::uint32_t number, Image& image) {
  const Attributes attributes(data, number);
  Frame frame;
  frame.number = number;
  frame.plane = is_placed_grid(data) ? placeless_plane_of(attributes) : plane_of(attributes);
  set_values(data, attributes, image, frame);
  if (image.segmentation && image.segmentation->kind != SegmentKind::kLabelMap) {
    frame.segment = segment_of(data, number);
  }
  frame.phases = phases_of_frame(data, number);
  return frame;
}

Image describe_object(const DataSet& data) {
  Image image;
  image.frame_of_reference_uid = data.text(kFrameOfReferenceUid);
  image.modality = utf8(data, kModality);
  image.photometric = data.text(kPhotometricInterpretation);
  image.instance_number = data.integer(kInstanceNumber);
  const DataSet* table = data.item(kModalityLutSequence);
  image.rescale_type =
      table != nullptr
          ? table->text(kModalityLutType)
          : Attributes(data, 0).place(kPixelValueTransformationSequence).text(kRescaleType);
  image.phases = phases_of_object(data);
  if (is_segmentation(data)) image.segmentation = describe_segmentation(data);
  return image;
}

}  // namespace

Image describe_image(const DicomFile& file) {
  const DataSet& data = file.data();
  Image image = describe_object(data);
  const std::uint32_t frames = frame_count(data);
  image.stored = pixel_layout(file);
  image.table = value_table(data, image.stored);
  image.layout = decoded_layout(image);
  if (image.segmentation) check_label_layout(*image.segmentation, image.stored);
  require_pixels(file, image.stored, frames);
  if (is_tomogram(data)) {
    place_tomogram(data, frames, image);
    return image;
  }
  if (!is_dose(data)) refuse_unplaced_frames(data, frames);
  refuse_placeless(data, frames);
  for (std::uint32_t number = 0; number < frames; ++number) {
    image.frames.push_back(describe_frame(data, number, image));
  }
  if (is_dose(data)) place_dose(data, image.frames);
  if (frames == 1 && is_mosaic(data)) unfold_mosaic(data, image);
  if (is_in_volume_space(Attributes(data, 0))) image.place = PlaceKind::kVolume;
  return image;
}

std::optional<std::string> reason_to_ignore(const DicomFile& file) {
  const DataSet& data = file.data();
  if (data.find(kDirectoryRecordSequence) != nullptr) return "it is a directory of DICOM files";
  const std::string_view sop_class = data.text(kSopClassUid);
  const auto kind = volume::kind_without_images(
      sop_class.empty() ? std::string_view(file.meta().sop_class_uid) : sop_class);
  if (kind) {
    return "it is " + std::string(*kind) + " (modality " + in_quotes(data.text(kModality)) + ")";
  }
  if (data.find(kRows) == nullptr && !file.pixels()) {
    return "it is not an image (modality " + in_quotes(data.text(kModality)) + ")";
  }
  const auto types = data.texts(kImageType);
  if (std::ranges::find(types, "LOCALIZER") != types.end()) return "it is a localiser";
  return std::nullopt;
}

}  // namespace isomesh::import::dicom
