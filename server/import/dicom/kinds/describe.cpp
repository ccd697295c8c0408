#include "server/import/dicom/kinds/describe.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/text.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/elements/text.h"
#include "server/import/dicom/geometry/attributes.h"
#include "server/import/dicom/kinds/placed_frames.h"
#include "server/import/dicom/kinds/segmentation.h"
#include "server/import/dicom/pixels/padding.h"
#include "server/import/dicom/pixels/pixels.h"
#include "server/import/dicom/pixels/values.h"
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

// True if a frame has a place of its own that differs from the first one's, or if frames at one
// place differ in time or otherwise.
bool have_own_places(const DataSet& data) {
  const auto all = data.items(kPerFrameFunctionalGroups);
  bool has_place = false;
  for (std::size_t frame = 0; frame < all.size(); ++frame) {
    if (all[frame].item(kPlanePositionVolumeSequence) != nullptr) return true;
    for (const auto& [sequence, tag] : {std::pair{kPlanePositionSequence, kImagePosition},
                                        std::pair{kPlaneOrientationSequence, kImageOrientation}}) {
      // Clang 14 does not capture what a structured binding names.
      const auto place_in = [sequence = sequence, tag = tag](const DataSet& groups) {
        const DataSet* item = groups.item(sequence);
        return item == nullptr ? std::string_view() : item->text(tag);
      };
      if (place_in(all[frame]) != place_in(all.front())) return true;
      has_place = has_place || !place_in(all[frame]).empty();
    }
  }
  if (!has_place) return false;
  for (std::uint32_t frame = 1; frame < all.size(); ++frame) {
    if (phases_of_frame(data, frame) != phases_of_frame(data, 0)) return true;
  }
  return false;
}

// True for several frames with one position: in the object, in the functional groups that all
// frames share, or the same in each frame's own.
bool has_one_position(const DataSet& data, std::uint32_t frames) {
  if (frames == 1 || is_dose(data) || !data.text(kSegmentationType).empty()) return false;
  if (have_own_places(data)) return false;
  const Attributes first(data, 0);
  return !first.place(kPlanePositionSequence).text(kImagePosition).empty() &&
         !first.place(kPlaneOrientationSequence).text(kImageOrientation).empty();
}

// True if the frames follow one another in time.
bool are_ordered_by_time(const DataSet& data) {
  const std::vector<std::uint32_t> pointer = data.unsigned_numbers(kFrameIncrementPointer);
  for (std::size_t at = 0; at + 1 < pointer.size(); at += 2) {
    const Tag tag = pointer[at] << 16 | pointer[at + 1];
    if (tag == kFrameTime || tag == kFrameTimeVector) return true;
  }
  return false;
}

void refuse_unplaced_frames(const DataSet& data, std::uint32_t frames) {
  if (frames == 1 || has_one_position(data, frames)) return;
  if (!has_functional_groups(data)) {
    throw_unusable("The DICOM image has " + std::to_string(frames) +
                   " frames, but no position for each of them.");
  }
  const std::size_t placed = data.items(kPerFrameFunctionalGroups).size();
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

// --- Parametric maps (PS3.3, A.75): a mapping to real world values gives samples a meaning
// --------

struct Mapping {
  Rescale rescale;
  // The stored values that it applies to; all if the object does not say.
  double first = -std::numeric_limits<double>::infinity();
  double last = std::numeric_limits<double>::infinity();

  bool covers(const Mapping& other) const { return first <= other.first && last >= other.last; }
  bool same_values(const Mapping& other) const {
    return rescale.slope == other.rescale.slope && rescale.intercept == other.rescale.intercept;
  }
};

[[noreturn]] void throw_mapping(const std::string& reason) {
  throw_unusable("The DICOM parametric map's samples cannot be mapped to real world values " +
                 tag_name(kRealWorldValueMappingSequence) + ": " + reason);
}

double required_real(const DataSet& item, Tag tag, const std::string& name) {
  const std::vector<double> numbers = item.binary_reals(tag);
  if (numbers.size() == 1 && std::isfinite(numbers[0])) return numbers[0];
  throw_mapping("the " + name + ' ' + tag_name(tag) + " is not a finite number.");
}

// The end of a range, which is a real number or of the same kind as the stored samples.
std::optional<double> end_of_range(const DataSet& item, Tag real, Tag word, bool is_signed) {
  const std::vector<double> numbers = item.binary_reals(real);
  if (numbers.size() == 1 && std::isfinite(numbers[0])) return numbers[0];
  const std::vector<std::uint32_t> words = item.unsigned_numbers(word);
  if (words.size() != 1) return std::nullopt;
  return is_signed ? static_cast<std::int16_t>(words[0]) : static_cast<double>(words[0]);
}

Mapping mapping_of(const DataSet& item, bool is_signed) {
  Mapping mapping;
  mapping.rescale = {required_real(item, kRealWorldValueSlope, "slope"),
                     required_real(item, kRealWorldValueIntercept, "intercept")};
  if (mapping.rescale.slope == 0) {
    throw_mapping("the slope " + tag_name(kRealWorldValueSlope) + " is 0.");
  }
  const auto first =
      end_of_range(item, kDoubleRealWorldValueFirst, kRealWorldValueFirst, is_signed);
  const auto last = end_of_range(item, kDoubleRealWorldValueLast, kRealWorldValueLast, is_signed);
  if (first && last) {
    mapping.first = *first;
    mapping.last = *last;
  }
  return mapping;
}

// Mappings with a slope and an intercept. Those that give the same values count once.
std::vector<Mapping> different_mappings(std::span<const DataSet> items, bool is_signed) {
  std::vector<Mapping> mappings;
  for (const DataSet& item : items) {
    if (item.find(kRealWorldValueLutData) != nullptr) continue;
    const Mapping mapping = mapping_of(item, is_signed);
    const auto same = std::ranges::find_if(
        mappings, [&](const Mapping& known) { return known.same_values(mapping); });
    if (same == mappings.end()) {
      mappings.push_back(mapping);
    } else {
      same->first = std::min(same->first, mapping.first);
      same->last = std::max(same->last, mapping.last);
    }
  }
  return mappings;
}

bool is_parametric_map(const DataSet& data) {
  return data.text(kSopClassUid) == "1.2.840.10008.5.1.4.1.1.30";
}

// Sets the frame's rescale to its mapping (PS3.3, C.7.6.16.2.11), which stands for a rescale. If
// several mappings differ, such as those to other units, the first is used that covers the stored
// values of the others. Returns the number of different mappings, 0 if there are none.
//
// Throws Error kUnusableVolume if the frame has only lookup tables, a mapping without a finite
// slope and intercept, or mappings that cover different values.
std::uint32_t set_real_world_values(const Attributes& attributes, const PixelLayout& stored,
                                    Frame& frame) {
  const auto items = attributes.items(kRealWorldValueMappingSequence);
  if (items.empty()) return 0;
  const std::vector<Mapping> mappings = different_mappings(items, stored.is_signed);
  if (mappings.empty()) {
    throw_mapping("it has only lookup tables " + tag_name(kRealWorldValueLutData) +
                  ". Mappings by slope and intercept are supported.");
  }
  const auto widest = std::ranges::find_if(mappings, [&](const Mapping& mapping) {
    return std::ranges::all_of(mappings,
                               [&](const Mapping& other) { return mapping.covers(other); });
  });
  if (widest == mappings.end()) {
    throw_mapping(
        "its " + std::to_string(mappings.size()) +
        " mappings apply to different stored values. One mapping for all stored values is "
        "supported.");
  }
  frame.rescale = widest->rescale;
  frame.has_slope = frame.has_intercept = true;
  return static_cast<std::uint32_t>(mappings.size());
}

// --- The object ----------------------------------------------------------------------------------

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
  image.padding = padding_range(data, image.stored);
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
  if (has_one_position(data, frames)) {
    place_along_normal(data, image);
    image.may_be_times = are_ordered_by_time(data);
  }
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
