#include "server/import/dicom/segmentation.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <string>

#include "base/text.h"
#include "proto/samples.h"
#include "server/import/dicom/attributes.h"
#include "server/import/dicom/placement.h"
#include "server/import/dicom/tags.h"
#include "server/import/dicom/text.h"
#include "server/import/dicom/values.h"
#include "server/import/dicom/vectors.h"
#include "server/import/source.h"

namespace isomesh::import::dicom {
namespace {

constexpr double kMostPlanes = 65535;

std::vector<Segment> segments_of(const DataSet& data) {
  std::vector<Segment> segments;
  const Element* sequence = data.find(kSegmentSequence);
  if (sequence == nullptr) return segments;
  for (const DataSet& item : sequence->items) {
    const auto number = item.unsigned_number(kSegmentNumber);
    if (number) segments.push_back({*number, utf8(item, kSegmentLabel)});
  }
  std::ranges::sort(segments, {}, &Segment::number);
  return segments;
}

// Empty where the object does not tell it.
std::optional<double> slice_distance(const DataSet& data) {
  const auto told =
      Attributes(data, 0).place(kPixelMeasuresSequence).numbers(kSpacingBetweenSlices);
  if (told.size() == 1 && told[0] != 0) return std::abs(told[0]);
  return std::nullopt;
}

bool is_whole_step(double gap, double distance) {
  const double steps = gap / distance;
  return std::round(steps) >= 1 && std::abs(steps - std::round(steps)) <= kPlaceTolerance;
}

// The distances from each position to the next.
std::vector<double> gaps_of(std::span<const Placed> placed, std::span<const std::size_t> starts) {
  std::vector<double> gaps;
  for (std::size_t i = 1; i < starts.size(); ++i) {
    gaps.push_back(placed[starts[i]].along - placed[starts[i - 1]].along);
  }
  return gaps;
}

// The distance of planes of which all positions are some.
double plane_distance(const std::vector<double>& gaps, const std::optional<double>& told) {
  const auto fits = [&](double distance) {
    return std::ranges::all_of(gaps, [&](double gap) { return is_whole_step(gap, distance); });
  };
  if (told && fits(*told)) return *told;
  const double smallest = std::ranges::min(gaps);
  if (fits(smallest)) return smallest;
  throw_unusable("The segmentation's frames are unevenly spaced: some are " + in_mm(smallest) +
                 " apart, and others " + in_mm(std::ranges::max(gaps)) + '.');
}

// The number of each slice's plane.
std::vector<std::uint32_t> planes_of(std::span<const Placed> placed,
                                     const std::optional<double>& told) {
  const std::vector<std::size_t> starts = position_starts(placed);
  if (starts.size() < 2) {
    throw_unusable("The segmentation is a single slice, and a volume needs at least two.");
  }
  const std::vector<double> gaps = gaps_of(placed, starts);
  const double distance = plane_distance(gaps, told);
  std::vector<std::uint32_t> planes;
  double plane = 0;
  for (std::size_t position = 0; position < starts.size(); ++position) {
    if (position > 0) plane += std::round(gaps[position - 1] / distance);
    if (plane > kMostPlanes) {
      throw_unusable("The segmentation's frames lie more than " + to_text(kMostPlanes) +
                     " planes apart.");
    }
    const std::size_t end = position + 1 < starts.size() ? starts[position + 1] : placed.size();
    planes.resize(end, static_cast<std::uint32_t>(plane));
  }
  return planes;
}

void refuse_crooked(std::span<const Placed> placed, const Stack& stack, const Vector3& step) {
  for (std::size_t i = 0; i < placed.size(); ++i) {
    const Vector3 place = moved(placed.front().position(), step, stack.planes[i]);
    const double off = length(difference(placed[i].position(), place));
    if (off <= kPlaceTolerance * length(step)) continue;
    throw_unusable("Frame " + std::to_string(placed[i].slice.frame->number + 1) +
                   " of the segmentation lies " + in_mm(off) +
                   " off the line on which the others are evenly spaced.");
  }
}

// Two frames of one segment at one place contradict each other.
void refuse_doubled(const Stack& stack) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> seen;
  for (std::size_t i = 0; i < stack.slices.size(); ++i) {
    seen.emplace_back(stack.planes[i], stack.slices[i].frame->segment);
  }
  std::ranges::sort(seen);
  const auto twice = std::ranges::adjacent_find(seen);
  if (twice == seen.end()) return;
  throw_unusable("The segmentation has two frames of " +
                 (twice->second == 0 ? std::string("its labels")
                                     : "segment " + std::to_string(twice->second)) +
                 " at one position.");
}

[[noreturn]] void throw_overlap(const Slice& slice, std::uint64_t one) {
  const Image& image = *slice.image;
  std::vector<Choice> choices;
  for (const Segment& segment : image.segmentation->segments) {
    choices.push_back(
        {"volume", std::to_string(choices.size()), segment_name(image, segment.number)});
  }
  throw_choice("The segmentation's segments overlap, " + segment_name(image, one) + " and " +
                   segment_name(image, slice.frame->segment) +
                   " for two, so they make no single label map; choose one of its " +
                   count_of(choices.size(), "segment") + " with volume=N.",
               choices);
}

template <class Label>
void mark(std::span<const std::byte> bits, const Slice& slice, std::span<std::byte> plane) {
  const auto label = static_cast<Label>(slice.frame->segment);
  for (std::size_t at = 0; at < bits.size(); ++at) {
    if (bits[at] == std::byte{0}) continue;
    Label found;
    std::memcpy(&found, plane.data() + at * sizeof(Label), sizeof(Label));
    if (found != 0) throw_overlap(slice, found);
    std::memcpy(plane.data() + at * sizeof(Label), &label, sizeof(Label));
  }
}

}  // namespace

bool is_segmentation(const DataSet& data) { return !data.text(kSegmentationType).empty(); }

Segmentation describe_segmentation(const DataSet& data) {
  const std::string_view type = data.text(kSegmentationType);
  if (type != "BINARY" && type != "LABELMAP") {
    throw_unusable("The DICOM segmentation is " + in_quotes(type) +
                   ", which gives samples no labels; binary ones and label maps are read.");
  }
  return {.segments = segments_of(data),
          .is_binary = type == "BINARY",
          .slice_distance = slice_distance(data)};
}

std::uint32_t segment_of(const DataSet& data, std::uint32_t frame) {
  const auto number = Attributes(data, frame)
                          .place(kSegmentIdentificationSequence)
                          .unsigned_number(kReferencedSegmentNumber);
  if (number && *number > 0 && *number <= 0xFFFF) return *number;
  throw_unusable("The DICOM segmentation does not tell which segment its frame " +
                 std::to_string(frame + 1) + " shows " + tag_name(kReferencedSegmentNumber) + ".");
}

std::string segment_name(const Image& image, std::uint64_t number) {
  const auto& segments = image.segmentation->segments;
  const auto found = std::ranges::find(segments, number, &Segment::number);
  const std::string text = std::to_string(number);
  return found == segments.end() || found->label.empty()
             ? text
             : text + " (" + in_quotes(found->label) + ')';
}

Stack make_label_stack(std::vector<Slice> slices) {
  refuse_mixtures(slices);
  const std::vector<Placed> placed = placed_along_normal(slices);
  Stack stack;
  stack.planes = planes_of(placed, slices.front().image->segmentation->slice_distance);
  stack.plane_count = stack.planes.back() + 1;
  Vector3 step = difference(placed.back().position(), placed.front().position());
  for (double& part : step) part /= stack.planes.back();
  refuse_crooked(placed, stack, step);
  stack.geometry = lattice(placed.front().slice.frame->plane, step);
  for (const Placed& each : placed) stack.slices.push_back(each.slice);
  refuse_doubled(stack);
  return stack;
}

SampleType label_type(std::span<const Slice> slices) {
  const Image& image = *slices.front().image;
  if (!image.segmentation->is_binary) {
    return image.layout.bits_allocated == 8 ? SampleType::kUint8 : SampleType::kUint16;
  }
  const auto highest =
      std::ranges::max(slices, {}, [](const Slice& slice) { return slice.frame->segment; });
  return highest.frame->segment <= 0xFF ? SampleType::kUint8 : SampleType::kUint16;
}

void write_labels(const Stack& stack, SampleType type, const ReadSlice& read,
                  std::span<std::byte> target) {
  std::ranges::fill(target, std::byte{0});
  std::vector<std::byte> stored;
  for (std::size_t i = 0; i < stack.slices.size(); ++i) {
    const Slice& slice = stack.slices[i];
    const PixelLayout& layout = slice.image->layout;
    stored.resize(layout.frame_bytes());
    read(i, stored);
    const std::size_t bytes = layout.samples() * bytes_per_sample(type);
    const std::span<std::byte> plane = target.subspan(stack.planes[i] * bytes, bytes);
    if (!slice.image->segmentation->is_binary) {
      convert_frame(stored, layout, {}, type, plane);
    } else if (type == SampleType::kUint8) {
      mark<std::uint8_t>(stored, slice, plane);
    } else {
      mark<std::uint16_t>(stored, slice, plane);
    }
  }
}

}  // namespace isomesh::import::dicom
