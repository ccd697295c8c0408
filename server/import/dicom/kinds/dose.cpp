#include <cmath>
#include <vector>

#include "base/text.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/geometry/vectors.h"
#include "server/import/dicom/kinds/placed_frames.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

constexpr double kSamePlace = 1e-3;  // mm

std::vector<double> offsets_of(const DataSet& data, std::size_t frames) {
  std::vector<double> offsets = data.numbers(kGridFrameOffsetVector);
  if (offsets.size() == frames) return offsets;
  throw_unusable("The DICOM dose has " + std::to_string(frames) + " planes, but " +
                 std::to_string(offsets.size()) + " offsets " + tag_name(kGridFrameOffsetVector) +
                 " for their positions.");
}

// The distance of each plane from the first, along the normal. The file's offsets begin with 0, or,
// for transverse planes, may be the patient's z.
std::vector<double> distances_of(const DataSet& data, const Plane& first, std::size_t frames) {
  std::vector<double> offsets = offsets_of(data, frames);
  if (offsets.front() == 0) return offsets;
  const double along_z = cross(first.along_row, first.along_column)[2];
  if (std::abs(std::abs(along_z) - 1) > kSamePlace ||
      std::abs(offsets.front() - first.position[2]) > kSamePlace) {
    throw_unusable("The DICOM dose's offsets " + tag_name(kGridFrameOffsetVector) +
                   " do not begin with 0 or with the z of its first transverse plane.");
  }
  for (double& offset : offsets) offset = (offset - first.position[2]) * std::copysign(1, along_z);
  return offsets;
}

}  // namespace

bool is_dose(const DataSet& data) {
  return data.text(kSopClassUid) == "1.2.840.10008.5.1.4.1.1.481.2";
}

void place_dose(const DataSet& data, std::span<Frame> frames) {
  const auto scaling = data.numbers(kDoseGridScaling);
  if (scaling.size() != 1 || !(scaling[0] > 0)) {
    throw_unusable("The DICOM dose's scaling " + tag_name(kDoseGridScaling) + " is " +
                   in_quotes(data.text(kDoseGridScaling)) + ", not a positive number.");
  }
  for (Frame& frame : frames) {
    frame.rescale = {scaling[0], 0};
    frame.has_slope = frame.has_intercept = true;
  }
  if (frames.size() == 1) return;
  const Plane first = frames.front().plane;
  const Vector3 normal = cross(first.along_row, first.along_column);
  const std::vector<double> distances = distances_of(data, first, frames.size());
  for (std::size_t at = 0; at < frames.size(); ++at) {
    frames[at].plane.position = moved(first.position, normal, distances[at]);
  }
}

}  // namespace isomesh::import::dicom
