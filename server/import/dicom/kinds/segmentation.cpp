#include "server/import/dicom/kinds/segmentation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/text.h"
#include "proto/samples.h"
#include "server/import/dicom/elements/dataset.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/elements/text.h"
#include "server/import/dicom/geometry/attributes.h"
#include "server/import/dicom/geometry/placement.h"
#include "server/import/dicom/geometry/vectors.h"
#include "server/import/dicom/kinds/palette.h"
#include "server/import/dicom/pixels/values.h"
#include "server/import/labels/combinations.h"
#include "server/import/labels/label_table.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

using Triple = std::array<double, 3>;

// L* is 0..100 and a*, b* are -128..127; each spans all 16 bits.
Triple cie_lab(const std::vector<std::uint32_t>& stored) {
  constexpr double kMost = 0xFFFF;
  return {stored[0] / kMost * 100, stored[1] / kMost * 255 - 128, stored[2] / kMost * 255 - 128};
}

// CIE 15, from D65. The standard requires D50, the white point of profile connection spaces. But
// dcmqi and its descendants write sRGB's own white point, and their colours must be preserved.
Triple cie_xyz(const Triple& lab) {
  constexpr Triple kWhite = {0.95047, 1, 1.08883};
  constexpr double kLinearBelow = 6.0 / 29;
  const auto inverse = [](double t) {
    return t > kLinearBelow ? t * t * t : 3 * kLinearBelow * kLinearBelow * (t - 4.0 / 29);
  };
  const double y = (lab[0] + 16) / 116;
  return {kWhite[0] * inverse(y + lab[1] / 500), kWhite[1] * inverse(y),
          kWhite[2] * inverse(y - lab[2] / 200)};
}

// IEC 61966-2-1.
Triple srgb(const Triple& xyz) {
  constexpr std::array<Triple, 3> kFromXyz = {{{3.2404542, -1.5371385, -0.4985314},
                                               {-0.9692660, 1.8760108, 0.0415560},
                                               {0.0556434, -0.2040259, 1.0572252}}};
  Triple rgb = {};
  for (std::size_t at = 0; at < 3; ++at) {
    const Triple& row = kFromXyz[at];
    const double linear = row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2];
    rgb[at] = linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
  }
  return rgb;
}

// The Recommended Display CIELab Value (PS3.3, C.10.7.1.1) as "#rrggbb" in sRGB, clamped to its
// gamut. Empty if missing.
std::optional<std::string> display_color(const DataSet& data) {
  const std::vector<std::uint32_t> stored = data.unsigned_numbers(kRecommendedDisplayCieLabValue);
  if (stored.size() != 3) return std::nullopt;
  return label_color(srgb(cie_xyz(cie_lab(stored))));
}

constexpr double kMostPlanes = 65535;
// A gap of more thicknesses says that the thickness is wrong.
constexpr double kMostThicknesses = 20;

// A palette (PS3.3, C.7.6.3.1.5) is for the display of the samples, and may say only that labels
// differ. The value of a segment is a recommendation for that segment in any display, and does not
// depend on the device. So it wins.
std::vector<Segment> described_segments(const DataSet& data) {
  const auto palette = read_palette(data);
  std::vector<Segment> segments;
  for (const DataSet& item : data.items(kSegmentSequence)) {
    const auto number = item.unsigned_number(kSegmentNumber);
    if (!number) continue;
    auto color = display_color(item);
    if (!color && palette) color = palette->color(*number);
    segments.push_back({*number, utf8(item, kSegmentLabel), std::move(color)});
  }
  std::ranges::sort(segments, {}, &Segment::number);
  return segments;
}

std::optional<double> measure_of(const DataSet& data, Tag tag) {
  const auto told = Attributes(data, 0).place(kPixelMeasuresSequence).numbers(tag);
  if (told.size() == 1 && told[0] != 0) return std::abs(told[0]);
  return std::nullopt;
}

bool is_whole_step(double gap, double distance) {
  const double steps = gap / distance;
  return std::round(steps) >= 1 && std::abs(steps - std::round(steps)) <= kPlaceTolerance;
}

std::vector<double> gaps_of(std::span<const Placed> placed, std::span<const std::size_t> starts) {
  std::vector<double> gaps;
  for (std::size_t i = 1; i < starts.size(); ++i) {
    gaps.push_back(placed[starts[i]].along - placed[starts[i - 1]].along);
  }
  return gaps;
}

struct PlaneDistance {
  double mm = 0;
  bool is_thickness = false;
};

// The distance of planes that include all positions. If the object has none, and all gaps are of
// several slices, frames between them were left out.
PlaneDistance plane_distance(const std::vector<double>& gaps, const Segmentation& told) {
  const auto fits = [&](double distance) {
    return std::ranges::all_of(gaps, [&](double gap) { return is_whole_step(gap, distance); });
  };
  if (told.slice_distance && fits(*told.slice_distance)) return {*told.slice_distance};
  const double smallest = std::ranges::min(gaps);
  const double thicknesses = told.thickness ? std::round(smallest / *told.thickness) : 0;
  if (!told.slice_distance && thicknesses >= 2 && thicknesses <= kMostThicknesses &&
      fits(*told.thickness)) {
    return {*told.thickness, true};
  }
  if (fits(smallest)) return {smallest};
  throw_unusable("The segmentation's frames are unevenly spaced: some are " + in_mm(smallest) +
                 " apart, others " + in_mm(std::ranges::max(gaps)) + '.');
}

// The distance of the planes of the whole object; empty for one plane.
std::optional<PlaneDistance> distance_in_object(const Slice& slice) {
  std::vector<Slice> all;
  for (const Frame& frame : slice.image->frames) {
    all.push_back({.image = slice.image, .frame = &frame, .file = slice.file});
  }
  const std::vector<Placed> placed = placed_along_normal(all);
  const std::vector<std::size_t> starts = position_starts(placed);
  if (starts.size() == 1) return std::nullopt;
  return plane_distance(gaps_of(placed, starts), *slice.image->segmentation);
}

// The thickness of the only plane of a segmentation, or of one of its segments.
PlaneDistance plane_thickness(const Slice& slice, const ImportOptions& options) {
  const Segmentation& told = *slice.image->segmentation;
  const auto distance = distance_in_object(slice);
  if (distance || told.slice_distance || told.thickness) refuse_spacing(options);
  if (distance) return *distance;
  if (told.slice_distance) return {*told.slice_distance};
  if (told.thickness) return {*told.thickness, true};
  if (options.spacing) return {(*options.spacing)[2]};
  const auto& [across, down] = slice.frame->plane.spacing;
  throw_choice(
      "The segmentation has one plane, and does not say how thick it is: it has neither a spacing "
      "between slices " +
          tag_name(kSpacingBetweenSlices) + " nor a slice thickness " + tag_name(kSliceThickness) +
          "." + begin_remedy(options, "Add") +
          "spacing=X,Y,Z (mm); Z is the thickness, and X and Y are not used.",
      {{"spacing", to_text(across) + ',' + to_text(down) + ",1", "a thickness of 1 mm"}});
}

// Sets the stack's planes. Returns their distance.
double set_planes(std::span<const Placed> placed, const ImportOptions& options, Stack& stack) {
  const std::vector<std::size_t> starts = position_starts(placed);
  const Slice& first = placed.front().slice;
  const bool is_single = starts.size() == 1;
  const std::vector<double> gaps = gaps_of(placed, starts);
  if (!is_single) refuse_spacing(options);
  const PlaneDistance distance = is_single ? plane_thickness(first, options)
                                           : plane_distance(gaps, *first.image->segmentation);
  stack.is_distance_assumed = distance.is_thickness;
  double plane = 0;
  for (std::size_t position = 0; position < starts.size(); ++position) {
    if (position > 0) plane += std::round(gaps[position - 1] / distance.mm);
    if (plane > kMostPlanes) {
      throw_unusable("The segmentation's frames lie more than " + to_text(kMostPlanes) +
                     " planes apart.");
    }
    const std::size_t end = position + 1 < starts.size() ? starts[position + 1] : placed.size();
    stack.planes.resize(end, static_cast<std::uint32_t>(plane));
  }
  stack.plane_count = stack.planes.back() + 1;
  return distance.mm;
}

// The step from a plane to the next. The positions are more exact than the distance.
Vector3 step_between(std::span<const Placed> placed, const Stack& stack, double distance) {
  if (stack.plane_count == 1) {
    const Plane& plane = placed.front().slice.frame->plane;
    return moved({}, cross(plane.along_row, plane.along_column), distance);
  }
  Vector3 step = difference(placed.back().position(), placed.front().position());
  for (double& part : step) part /= stack.planes.back();
  return step;
}

void refuse_crooked(std::span<const Placed> placed, const Stack& stack, const Vector3& step) {
  for (std::size_t i = 0; i < placed.size(); ++i) {
    const Vector3 place = moved(placed.front().position(), step, stack.planes[i]);
    const double off = length(difference(placed[i].position(), place));
    if (off <= kPlaceTolerance * length(step)) continue;
    throw_unusable("Frame " + std::to_string(placed[i].slice.frame->number + 1) +
                   " of the segmentation lies " + in_mm(off) +
                   " away from its place in a line of evenly spaced frames.");
  }
}

// Two frames of one segment at one position are contradictory.
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

SegmentKind kind_of(const DataSet& data) {
  const std::string_view type = data.text(kSegmentationType);
  if (type == "BINARY") return SegmentKind::kBinary;
  if (type == "FRACTIONAL") return SegmentKind::kFractional;
  if (type == "LABELMAP") return SegmentKind::kLabelMap;
  throw_unusable("The DICOM segmentation is " + in_quotes(type) +
                 ", which is unknown. BINARY, FRACTIONAL and LABELMAP are supported.");
}

std::uint32_t maximum_of(const DataSet& data) {
  const auto maximum = data.unsigned_number(kMaximumFractionalValue);
  if (maximum && *maximum > 0 && *maximum <= 0xFF) return *maximum;
  throw_unusable(
      "The fractional DICOM segmentation does not declare the largest value of its samples " +
      tag_name(kMaximumFractionalValue) + ".");
}

const Segmentation& segmentation_of(const Stack& stack) {
  return *stack.slices.front().image->segmentation;
}

bool is_label_map(const Stack& stack) {
  return segmentation_of(stack).kind == SegmentKind::kLabelMap;
}

std::uint32_t highest_segment(const Stack& stack) {
  const auto segment = [](const Slice& slice) { return slice.frame->segment; };
  return segment(std::ranges::max(stack.slices, {}, segment));
}

// The padding of a label map is its background (PS3.3, C.8.20.2), which is 0 in ours.
std::optional<std::int64_t> background_of(const Image& image) {
  if (!image.padding || image.padding->first == 0) return std::nullopt;
  if (image.padding->first >= std::pow(2, image.layout.bits_stored)) return std::nullopt;
  return static_cast<std::int64_t>(image.padding->first);
}

void clear_background(const Image& image, SampleType type, std::span<std::byte> samples) {
  const auto background = background_of(image);
  if (!background) return;
  with_sample(type, [&](auto sample) {
    using Sample = decltype(sample);
    const std::span labels(reinterpret_cast<Sample*>(samples.data()),
                           samples.size() / sizeof(Sample));
    std::ranges::replace(labels, static_cast<Sample>(*background), Sample{0});
  });
}

void copy_frames(const Stack& stack, SampleType type, const ReadSlice& read,
                 std::span<std::byte> target) {
  std::vector<std::byte> stored;
  for (std::size_t i = 0; i < stack.slices.size(); ++i) {
    const PixelLayout& layout = stack.slices[i].image->layout;
    stored.resize(layout.frame_bytes());
    read(i, stored);
    const std::size_t bytes = layout.samples() * bytes_per_sample(type);
    const std::span<std::byte> plane = target.subspan(stack.planes[i] * bytes, bytes);
    convert_frame(stored, layout, {}, type, plane);
    if (is_label_map(stack)) clear_background(*stack.slices[i].image, type, plane);
  }
}

// Orders slices by plane, then by segment, as Combinations::with requires.
std::vector<std::size_t> by_plane_and_segment(const Stack& stack) {
  std::vector<std::size_t> order(stack.slices.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, {}, [&](std::size_t i) {
    return std::pair(stack.planes[i], stack.slices[i].frame->segment);
  });
  return order;
}

// Adds the segment to samples of at least half the maximum, which includes set bits.
void add_segment(std::span<const std::byte> samples, const Slice& slice,
                 std::span<Combinations::State> states, Combinations& combinations) {
  const std::uint32_t maximum = slice.image->segmentation->maximum;
  for (std::size_t at = 0; at < samples.size(); ++at) {
    if (std::to_integer<std::uint32_t>(samples[at]) * 2 < maximum) continue;
    states[at] = combinations.with(states[at], slice.frame->segment);
  }
}

// Returns false if a value does not fit into the type.
bool write_combinations(const Stack& stack, SampleType type, const ReadSlice& read,
                        std::span<std::byte> target, Combinations& combinations) {
  const std::vector<std::size_t> order = by_plane_and_segment(stack);
  std::vector<std::byte> stored;
  std::vector<Combinations::State> states;
  for (std::size_t at = 0; at < order.size(); ++at) {
    const std::size_t i = order[at];
    const PixelLayout& layout = stack.slices[i].image->layout;
    const std::uint32_t plane = stack.planes[i];
    if (at == 0 || plane != stack.planes[order[at - 1]]) {
      states.assign(layout.samples(), Combinations::kNone);
    }
    stored.resize(layout.frame_bytes());
    read(i, stored);
    add_segment(stored, stack.slices[i], states, combinations);
    if (at + 1 < order.size() && stack.planes[order[at + 1]] == plane) continue;
    const std::size_t bytes = layout.samples() * bytes_per_sample(type);
    if (!combinations.write(states, type, target.subspan(plane * bytes, bytes))) return false;
  }
  return true;
}

std::vector<LabelEntry> entries_of(const std::vector<Segment>& segments) {
  std::vector<LabelEntry> entries;
  for (const Segment& segment : segments) {
    entries.push_back(
        {.label = segment.number, .name = label_name(segment.label), .color = segment.color});
  }
  return label_table(std::move(entries));
}

std::vector<Segment> segments_in(const Stack& stack) {
  std::set<std::uint32_t> numbers;
  for (const Slice& slice : stack.slices) numbers.insert(slice.frame->segment);
  std::vector<Segment> segments = segmentation_of(stack).segments;
  std::erase_if(segments, [&](const Segment& each) { return !numbers.contains(each.number); });
  return segments;
}

// Without the background, which some programs describe as a segment, also where it is 0 and the
// padding is another value.
std::vector<Segment> segments_of_map(const Stack& stack) {
  const auto background = background_of(*stack.slices.front().image).value_or(0);
  std::vector<Segment> segments = segmentation_of(stack).segments;
  std::erase_if(segments,
                [&](const Segment& each) { return each.number == 0 || each.number == background; });
  return segments;
}

}  // namespace

bool is_segmentation(const DataSet& data) { return !data.text(kSegmentationType).empty(); }

Segmentation describe_segmentation(const DataSet& data) {
  const SegmentKind kind = kind_of(data);
  return {.segments = described_segments(data),
          .kind = kind,
          .maximum = kind == SegmentKind::kFractional ? maximum_of(data) : 1,
          .slice_distance = measure_of(data, kSpacingBetweenSlices),
          .thickness = measure_of(data, kSliceThickness)};
}

std::uint32_t segment_of(const DataSet& data, std::uint32_t frame) {
  const auto number = Attributes(data, frame)
                          .place(kSegmentIdentificationSequence)
                          .unsigned_number(kReferencedSegmentNumber);
  if (number && *number > 0 && *number <= 0xFFFF) return *number;
  throw_unusable("The DICOM segmentation does not declare the segment of its frame " +
                 std::to_string(frame + 1) + ' ' + tag_name(kReferencedSegmentNumber) + ".");
}

std::string segment_name(const Image& image, std::uint64_t number) {
  const auto& segments = image.segmentation->segments;
  const auto found = std::ranges::find(segments, number, &Segment::number);
  const std::string text = std::to_string(number);
  return found == segments.end() || found->label.empty()
             ? text
             : text + " (" + in_quotes(found->label) + ')';
}

Stack make_label_stack(std::vector<Slice> slices, const ImportOptions& options) {
  refuse_mixtures(slices);
  const std::vector<Placed> placed = placed_along_normal(slices);
  Stack stack;
  const double distance = set_planes(placed, options, stack);
  const Vector3 step = step_between(placed, stack, distance);
  refuse_crooked(placed, stack, step);
  stack.geometry = lattice(placed.front().slice.frame->plane, step);
  for (const Placed& each : placed) stack.slices.push_back(each.slice);
  refuse_doubled(stack);
  return stack;
}

bool are_shares(const Stack& stack) {
  const std::uint32_t segment = stack.slices.front().frame->segment;
  return segmentation_of(stack).kind == SegmentKind::kFractional &&
         std::ranges::all_of(stack.slices,
                             [&](const Slice& slice) { return slice.frame->segment == segment; });
}

std::vector<SampleType> label_types(const Stack& stack) {
  if (are_shares(stack)) return {SampleType::kUint8};
  if (is_label_map(stack)) {
    const unsigned bits = stack.slices.front().image->layout.bits_allocated;
    return {bits == 8 ? SampleType::kUint8 : SampleType::kUint16};
  }
  if (highest_segment(stack) > 0xFF) return {SampleType::kUint16};
  return {SampleType::kUint8, SampleType::kUint16};
}

bool write_labels(const Stack& stack, SampleType type, const ReadSlice& read,
                  std::span<std::byte> target, Volume& volume) {
  std::ranges::fill(target, std::byte{0});
  if (are_shares(stack) || is_label_map(stack)) {
    copy_frames(stack, type, read, target);
    if (is_label_map(stack)) volume.labels = entries_of(segments_of_map(stack));
    return true;
  }
  Combinations combinations(highest_segment(stack));
  if (!write_combinations(stack, type, read, target, combinations)) return false;
  combinations.sort_values(type, target);
  volume.labels = combinations.entries(entries_of(segments_in(stack)));
  if (auto note = combinations.note()) volume.notes.push_back(std::move(*note));
  return true;
}

std::optional<Note> note_on_shares(const Stack& stack) {
  const Segmentation& segmentation = segmentation_of(stack);
  if (segmentation.kind != SegmentKind::kFractional) return std::nullopt;
  return note_of(NoteCode::kFractionalSegments,
                 "A sample belongs to a segment if its value is " + to_text(half_of(stack)) +
                     " or more, half of the maximum." +
                     (are_shares(stack) ? " The values are kept unchanged." : ""));
}

double half_of(const Stack& stack) { return segmentation_of(stack).maximum / 2.0; }

}  // namespace isomesh::import::dicom
