#include "server/import/dicom/geometry/placement.h"

#include <algorithm>
#include <cmath>

#include "base/text.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/geometry/vectors.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

// For direction cosines: 0.25 mm at a distance of 500 mm.
constexpr double kOrientationTolerance = 5e-4;
constexpr double kRelativeSpacingTolerance = 1e-3;

bool nearly_same(const Vector3& a, const Vector3& b) {
  for (std::size_t i = 0; i < 3; ++i) {
    if (!(std::abs(a[i] - b[i]) <= kOrientationTolerance)) return false;
  }
  return true;
}

bool nearly_same(const std::array<double, 2>& a, const std::array<double, 2>& b) {
  for (std::size_t i = 0; i < 2; ++i) {
    if (!(std::abs(a[i] - b[i]) <= kRelativeSpacingTolerance * a[i])) return false;
  }
  return true;
}

// A slice equal to the majority if there is one, otherwise any slice.
template <class IsSame>
const Slice& usual_slice(std::span<const Slice> slices, const IsSame& is_same) {
  const Slice* candidate = &slices.front();
  std::size_t votes = 0;
  for (const Slice& slice : slices) {
    if (votes == 0) candidate = &slice;
    votes = is_same(*candidate, slice) ? votes + 1 : votes - 1;
  }
  return *candidate;
}

template <class IsSame>
void refuse_others(std::span<const Slice> slices, const std::string& what, const IsSame& is_same) {
  const Slice& usual = usual_slice(slices, is_same);
  const auto is_other = [&](const Slice& slice) { return !is_same(usual, slice); };
  const auto count = static_cast<std::size_t>(std::ranges::count_if(slices, is_other));
  if (count == 0) return;
  const auto other = std::ranges::find_if(slices, is_other);
  throw_unusable("The series is not a single volume: " + std::to_string(count) + " of its " +
                 count_of(slices.size(), "slice") + (count == 1 ? " differs" : " differ") + " in " +
                 what + " from the others. For example, " + place_of(*other) + " differs from " +
                 place_of(usual) + ".");
}

// A factor that is missing in some slices is assumed there. That is safe only if the others have
// the assumed one.
void refuse_assumed(std::span<const Slice> slices, const std::string& what, double Rescale::*factor,
                    bool Frame::*has_factor) {
  const double first = slices.front().frame->rescale.*factor;
  const bool is_safe = std::ranges::all_of(slices, [&](const Slice& slice) {
    return !slice.image->table && slice.frame->rescale.*factor == first;
  });
  if (is_safe) return;
  refuse_others(slices, what, [&](const Slice& a, const Slice& b) {
    return a.frame->*has_factor == b.frame->*has_factor;
  });
}

}  // namespace

std::string count_of(std::size_t count, const std::string& what) {
  return std::to_string(count) + ' ' + what + (count == 1 ? "" : "s");
}

std::string place_of(const Slice& slice) {
  const std::string& file = slice.image->file_name;
  std::string text;
  if (slice.image->frames.size() > 1) text = "frame " + std::to_string(slice.frame->number + 1);
  if (!file.empty()) text += (text.empty() ? "" : " of ") + in_quotes(file);
  return text;
}

std::optional<double> usual_gap(const std::vector<double>& ascending) {
  if (ascending.size() < 2) return std::nullopt;
  std::vector<double> gaps;
  for (std::size_t at = 1; at < ascending.size(); ++at) {
    gaps.push_back(ascending[at] - ascending[at - 1]);
  }
  const auto middle = gaps.begin() + std::ssize(gaps) / 2;
  std::ranges::nth_element(gaps, middle);
  return *middle;
}

std::string in_mm(double value) { return to_text(std::round(value * 1000) / 1000) + " mm"; }

bool same_orientation(const Slice& a, const Slice& b) {
  const Plane& one = a.frame->plane;
  const Plane& other = b.frame->plane;
  return nearly_same(one.along_row, other.along_row) &&
         nearly_same(one.along_column, other.along_column);
}

bool same_size(const Slice& a, const Slice& b) {
  return a.image->layout.columns == b.image->layout.columns &&
         a.image->layout.rows == b.image->layout.rows;
}

bool same_spacing(const Slice& a, const Slice& b) {
  return nearly_same(a.frame->plane.spacing, b.frame->plane.spacing);
}

void refuse_mixtures(std::span<const Slice> slices) {
  refuse_others(slices, "orientation", same_orientation);
  refuse_others(slices, "size", same_size);
  refuse_others(slices, "pixel spacing", same_spacing);
  refuse_others(slices, "photometric interpretation", [](const Slice& a, const Slice& b) {
    return a.image->photometric == b.image->photometric;
  });
  refuse_others(slices, "modality", [](const Slice& a, const Slice& b) {
    return a.image->modality == b.image->modality;
  });
  refuse_assumed(slices, "having a rescale slope " + tag_name(kRescaleSlope), &Rescale::slope,
                 &Frame::has_slope);
  refuse_assumed(slices, "having a rescale intercept " + tag_name(kRescaleIntercept),
                 &Rescale::intercept, &Frame::has_intercept);
}

std::vector<Placed> placed_along_normal(std::span<const Slice> slices) {
  const Plane& plane = slices.front().frame->plane;
  const Vector3 normal = cross(plane.along_row, plane.along_column);
  std::vector<Placed> placed;
  placed.reserve(slices.size());
  for (const Slice& slice : slices) {
    placed.push_back({slice, dot(slice.frame->plane.position, normal)});
  }
  std::ranges::stable_sort(placed, {}, &Placed::along);
  return placed;
}

std::vector<std::size_t> position_starts(std::span<const Placed> placed) {
  std::vector<std::size_t> starts = {0};
  for (std::size_t i = 1; i < placed.size(); ++i) {
    if (placed[i].along - placed[i - 1].along > kSamePlaceMm) starts.push_back(i);
  }
  return starts;
}

Geometry lattice(const Plane& first, const Vector3& step) {
  const double distance = length(step);
  Geometry geometry;
  geometry.origin = first.position;
  geometry.spacing = {first.spacing[0], first.spacing[1], distance};
  for (std::size_t row = 0; row < 3; ++row) {
    geometry.direction[row * 3] = first.along_row[row];
    geometry.direction[row * 3 + 1] = first.along_column[row];
    geometry.direction[row * 3 + 2] = step[row] / distance;
  }
  return geometry;
}

}  // namespace isomesh::import::dicom
