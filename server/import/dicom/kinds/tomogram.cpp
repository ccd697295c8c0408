#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "base/text.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/geometry/attributes.h"
#include "server/import/dicom/geometry/vectors.h"
#include "server/import/dicom/kinds/placed_frames.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

constexpr std::string_view kNuclearMedicine = "1.2.840.10008.5.1.4.1.1.20";

void refuse_projections(const DataSet& data) {
  const auto types = data.texts(kImageType);
  const std::string_view kind = types.size() > 2 ? types[2] : std::string_view();
  if (kind.find("RECON") != kind.npos) return;
  if (kind.empty() && data.find(kSliceVector) != nullptr) return;
  throw_unusable("The DICOM image of nuclear medicine is of the type " + in_quotes(kind) +
                 ". Its frames are projections, not the slices of a volume. Only reconstructed "
                 "tomograms (RECON TOMO) are volumes.");
}

double slice_step(const DataSet& data, Image& image) {
  const double step = frame_distance(data, image);
  image.is_distance_unknown = step == 0;
  if (step != 0) return step;
  image.is_distance_assumed = false;
  return 1;
}

// The element in the sequence of detectors, or in the object.
std::vector<double> told_numbers(const DataSet& data, Tag tag, std::size_t count) {
  const DataSet* detector = data.item(kDetectorInformationSequence);
  for (const DataSet* place : {detector, &data}) {
    if (place == nullptr) continue;
    std::vector<double> numbers = place->numbers(tag);
    if (numbers.size() == count) return numbers;
  }
  return {};
}

Plane first_plane(const DataSet& data, Image& image) {
  const auto position = told_numbers(data, kImagePosition, 3);
  auto cosines = told_numbers(data, kImageOrientation, 6);
  if (position.empty() || cosines.empty()) image.place = PlaceKind::kAssumed;
  if (cosines.empty()) cosines = {1, 0, 0, 0, 1, 0};
  Plane plane = plane_of(cosines, required_numbers(data, kPixelSpacing, 2, "pixel spacing"));
  std::ranges::copy(position, plane.position.begin());
  return plane;
}

// The slice numbers of the frames, from 1. Objects without them have one volume, in order.
std::vector<std::uint32_t> slice_numbers(const DataSet& data, std::uint32_t frames) {
  std::vector<std::uint32_t> numbers = data.unsigned_numbers(kSliceVector);
  if (numbers.empty()) {
    for (std::uint32_t frame = 0; frame < frames; ++frame) numbers.push_back(frame + 1);
  }
  if (numbers.size() == frames) return numbers;
  throw_unusable("The DICOM tomogram has " + std::to_string(frames) + " frames, but " +
                 std::to_string(numbers.size()) + " slice numbers " + tag_name(kSliceVector) + ".");
}

void add_phases(const DataSet& data, std::span<Frame> frames) {
  struct Vector {
    Tag tag;
    std::string_view name;
  };
  for (const Vector& each :
       {Vector{kEnergyWindowVector, "EnergyWindowVector"},
        Vector{kRrIntervalVector, "RRIntervalVector"}, Vector{kTimeSlotVector, "TimeSlotVector"}}) {
    const auto values = data.unsigned_numbers(each.tag);
    if (values.size() != frames.size()) continue;
    for (std::size_t frame = 0; frame < frames.size(); ++frame) {
      frames[frame].phases.push_back({phase_attribute(each.name), std::to_string(values[frame])});
    }
  }
}

}  // namespace

double frame_distance(const DataSet& data, Image& image) {
  const DataSet& measures = Attributes(data, 0).place(kPixelMeasuresSequence);
  for (const DataSet* place : {&measures, &data}) {
    const auto told = place->numbers(kSpacingBetweenSlices);
    if (!told.empty() && told.front() != 0) return told.front();
  }
  image.is_distance_assumed = true;
  for (const DataSet* place : {&measures, &data}) {
    const auto thickness = place->numbers(kSliceThickness);
    if (!thickness.empty() && thickness.front() > 0) return thickness.front();
  }
  return 0;
}

void place_along_normal(const DataSet& data, Image& image) {
  const double step = frame_distance(data, image);
  if (step == 0) {
    throw_unusable("The DICOM image has " + std::to_string(image.frames.size()) +
                   " frames, but no position for each of them, and no distance between them " +
                   tag_name(kSpacingBetweenSlices) + " or thickness " + tag_name(kSliceThickness) +
                   ".");
  }
  const Plane first = image.frames.front().plane;
  const Vector3 normal = cross(first.along_row, first.along_column);
  for (Frame& frame : image.frames) {
    frame.plane.position = moved(first.position, normal, step * frame.number);
  }
  image.has_one_position = true;
}

bool is_tomogram(const DataSet& data) { return data.text(kSopClassUid) == kNuclearMedicine; }

void place_tomogram(const DataSet& data, std::uint32_t frames, Image& image) {
  refuse_projections(data);
  const Plane first = first_plane(data, image);
  const Vector3 normal = cross(first.along_row, first.along_column);
  const double step = slice_step(data, image);
  const std::vector<std::uint32_t> numbers = slice_numbers(data, frames);
  for (std::uint32_t number = 0; number < frames; ++number) {
    Frame frame;
    frame.number = number;
    frame.plane = first;
    set_rescale(data, frame);
    frame.plane.position = moved(first.position, normal, step * (numbers[number] - 1.0));
    image.frames.push_back(std::move(frame));
  }
  add_phases(data, image.frames);
}

}  // namespace isomesh::import::dicom
