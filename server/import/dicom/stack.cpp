#include "server/import/dicom/stack.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "base/text.h"
#include "server/import/source.h"

namespace isomesh::import::dicom {
namespace {

// For direction cosines: a quarter of a millimetre at half a metre.
constexpr double kOrientationTolerance = 5e-4;
constexpr double kRelativeSpacingTolerance = 1e-3;
// A share of the distance between slices, because positions are often written with one or two
// decimals.
constexpr double kPlaceTolerance = 0.05;
// Slices that are nearer to each other than this are at one position.
constexpr double kSamePlace_mm = 1e-3;

double dot(const Vector3& a, const Vector3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Vector3 cross(const Vector3& a, const Vector3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

Vector3 difference(const Vector3& a, const Vector3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

double length(const Vector3& v) { return std::hypot(v[0], v[1], v[2]); }

std::string count_of(std::size_t count, const std::string& what) {
  return std::to_string(count) + ' ' + what + (count == 1 ? "" : "s");
}

std::string in_mm(double value) { return to_text(std::round(value * 1000) / 1000) + " mm"; }

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

// Names a slice whose place in the stack is not known yet.
std::string place_of(const Slice& slice) {
  const std::string& file = slice.image->file_name;
  std::string text;
  if (slice.image->frames.size() > 1) text = "frame " + std::to_string(slice.frame->number + 1);
  if (!file.empty()) text += (text.empty() ? "" : " of ") + in_quotes(file);
  return text;
}

template <class IsOther>
void refuse_others(std::span<const Slice> slices, const std::string& what, IsOther&& is_other) {
  const auto count = std::count_if(slices.begin(), slices.end(), is_other);
  if (count == 0) return;
  const auto other = std::find_if(slices.begin(), slices.end(), is_other);
  throw_unusable("The series is no single volume: " + std::to_string(count) + " of its " +
                 count_of(slices.size(), "slice") + " differ in " + what + " from the others: " +
                 place_of(*other) + " from " + place_of(slices.front()) + ", for one.");
}

void refuse_mixtures(std::span<const Slice> slices) {
  const Image& image = *slices.front().image;
  const Plane& plane = slices.front().frame->plane;
  refuse_others(slices, "orientation", [&](const Slice& slice) {
    return !nearly_same(slice.frame->plane.along_row, plane.along_row) ||
           !nearly_same(slice.frame->plane.along_column, plane.along_column);
  });
  refuse_others(slices, "size", [&](const Slice& slice) {
    return slice.image->layout.columns != image.layout.columns ||
           slice.image->layout.rows != image.layout.rows;
  });
  refuse_others(slices, "pixel spacing", [&](const Slice& slice) {
    return !nearly_same(slice.frame->plane.spacing, plane.spacing);
  });
  refuse_others(slices, "frame of reference", [&](const Slice& slice) {
    return slice.image->frame_of_reference_uid != image.frame_of_reference_uid;
  });
  refuse_others(slices, "photometric interpretation",
                [&](const Slice& slice) { return slice.image->photometric != image.photometric; });
  refuse_others(slices, "modality",
                [&](const Slice& slice) { return slice.image->modality != image.modality; });
}

// Slices with how far along the normal they lie.
struct Placed {
  Slice slice;
  double along = 0;

  const Vector3& position() const { return slice.frame->plane.position; }
};

std::vector<Placed> placed_along_normal(std::span<const Slice> slices) {
  const Plane& plane = slices.front().frame->plane;
  const Vector3 normal = cross(plane.along_row, plane.along_column);
  std::vector<Placed> placed;
  for (const Slice& slice : slices) {
    placed.push_back({slice, dot(slice.frame->plane.position, normal)});
  }
  std::stable_sort(placed.begin(), placed.end(),
                   [](const Placed& a, const Placed& b) { return a.along < b.along; });
  return placed;
}

bool falls(std::span<const Placed> placed) {
  for (std::size_t i = 1; i < placed.size(); ++i) {
    const Slice& a = placed[i - 1].slice;
    const Slice& b = placed[i].slice;
    const bool same_object = a.file == b.file;
    if (same_object
            ? b.frame->number >= a.frame->number
            : b.image->instance_number.value_or(0) >= a.image->instance_number.value_or(0)) {
      return false;
    }
  }
  return true;
}

// The attributes in which the slices at one position differ.
std::string differing_phases(const Slice& a, const Slice& b) {
  std::string names;
  const auto& first = a.frame->phases;
  const auto& second = b.frame->phases;
  for (std::size_t i = 0; i < std::min(first.size(), second.size()); ++i) {
    if (first[i] == second[i]) continue;
    names += (names.empty() ? "" : ", ") + std::string(first[i].name);
  }
  return names;
}

std::string number_of(std::size_t place, std::size_t count, bool from_end) {
  return std::to_string(from_end ? count - place : place + 1);
}

// The positions that hold more than one slice, each with how many.
void refuse_shared_positions(std::span<const Placed> placed, bool from_end) {
  std::vector<std::size_t> first_of_position = {0};
  for (std::size_t i = 1; i < placed.size(); ++i) {
    if (placed[i].along - placed[i - 1].along > kSamePlace_mm) first_of_position.push_back(i);
  }
  const std::size_t positions = first_of_position.size();
  if (positions == placed.size()) return;
  std::size_t place = 0;
  while (place + 1 < positions && first_of_position[place + 1] == first_of_position[place] + 1) {
    ++place;
  }
  const std::size_t first = first_of_position[place];
  const std::string names = differing_phases(placed[first].slice, placed[first + 1].slice);
  const std::string difference = names.empty() ? "" : ", which differ in " + names;
  if (placed.size() % positions == 0 && placed.size() / positions > 1) {
    throw_unusable("The series holds " + std::to_string(placed.size() / positions) +
                   " slices at each of its " + count_of(positions, "position") + difference +
                   ": a time series, several echoes or the like, where one volume is needed.");
  }
  throw_unusable("Slice " + number_of(place, positions, from_end) + " of " +
                 std::to_string(positions) + " is there more than once" + difference + ".");
}

double median_gap(std::span<const Placed> placed) {
  std::vector<double> gaps;
  for (std::size_t i = 1; i < placed.size(); ++i) {
    gaps.push_back(placed[i].along - placed[i - 1].along);
  }
  const auto middle = gaps.begin() + std::ssize(gaps) / 2;
  std::nth_element(gaps.begin(), middle, gaps.end());
  return *middle;
}

// "slice 41 of 93", "slices 41 and 42 of 93", "slices 3, 9 and 10 of 20", ...
std::string missing_slices(const std::vector<std::size_t>& places, std::size_t count,
                           bool from_end) {
  constexpr std::size_t kMostNamed = 10;
  std::vector<std::size_t> numbers;
  for (const std::size_t place : places) numbers.push_back(from_end ? count - place : place + 1);
  std::sort(numbers.begin(), numbers.end());
  std::string text = numbers.size() == 1 ? "slice " : "slices ";
  for (std::size_t i = 0; i < numbers.size() && i < kMostNamed; ++i) {
    const bool is_last = i + 1 == numbers.size();
    text += (i == 0 ? "" : is_last ? " and " : ", ") + std::to_string(numbers[i]);
  }
  if (numbers.size() > kMostNamed) text += ", ...";
  return text + " of " + std::to_string(count) + (numbers.size() == 1 ? " is" : " are") +
         " missing";
}

void refuse_gaps(std::span<const Placed> placed, bool from_end) {
  const double usual = median_gap(placed);
  std::vector<std::size_t> missing;
  std::size_t place = 0;
  std::size_t uneven = 0;
  for (std::size_t i = 1; i < placed.size(); ++i) {
    const double steps = (placed[i].along - placed[i - 1].along) / usual;
    const double whole = std::round(steps);
    if (whole < 1 || std::abs(steps - whole) > kPlaceTolerance || whole > 1e6) {
      if (uneven == 0) uneven = i;
      ++place;
      continue;
    }
    for (double skipped = 1; skipped < whole; ++skipped) missing.push_back(++place);
    ++place;
  }
  const std::size_t count = placed.size();
  if (uneven != 0) {
    const std::size_t one = from_end ? count - uneven : uneven;
    const std::size_t other = from_end ? one + 1 : uneven + 1;
    throw_unusable("The slices are unevenly spaced: slices " + std::to_string(one) + " and " +
                   std::to_string(other) + " of " + std::to_string(count) + " are " +
                   in_mm(placed[uneven].along - placed[uneven - 1].along) +
                   " apart, where others are " + in_mm(usual) + " apart.");
  }
  if (!missing.empty()) {
    throw_unusable("The series is incomplete: " +
                   missing_slices(missing, count + missing.size(), from_end) + '.');
  }
}

// Every slice must lie where steps of one length and direction lead. This also finds slices that
// are shifted within their planes.
void refuse_crooked(std::span<const Placed> placed, const Vector3& step, bool from_end) {
  const double tolerance = kPlaceTolerance * length(step);
  for (std::size_t i = 0; i < placed.size(); ++i) {
    Vector3 off = difference(placed[i].position(), placed.front().position());
    for (std::size_t axis = 0; axis < 3; ++axis) off[axis] -= step[axis] * static_cast<double>(i);
    if (length(off) <= tolerance) continue;
    throw_unusable("Slice " + number_of(i, placed.size(), from_end) + " of " +
                   std::to_string(placed.size()) + " lies " + in_mm(length(off)) +
                   " off the line on which the others are evenly spaced.");
  }
}

}  // namespace

std::string Stack::name(std::size_t place) const {
  return "slice " + number_of(place, slices.size(), numbered_from_end) + " of " +
         std::to_string(slices.size());
}

Stack make_stack(std::vector<Slice> slices) {
  if (slices.size() < 2) {
    throw_unusable("The upload is a single slice, and a volume needs at least two.");
  }
  refuse_mixtures(slices);
  const std::vector<Placed> placed = placed_along_normal(slices);
  Stack stack;
  stack.numbered_from_end = falls(placed);
  refuse_shared_positions(placed, stack.numbered_from_end);
  refuse_gaps(placed, stack.numbered_from_end);
  Vector3 step = difference(placed.back().position(), placed.front().position());
  for (double& part : step) part /= static_cast<double>(placed.size() - 1);
  refuse_crooked(placed, step, stack.numbered_from_end);

  const Plane& plane = placed.front().slice.frame->plane;
  const double distance = length(step);
  stack.geometry.origin = plane.position;
  stack.geometry.spacing = {plane.spacing[0], plane.spacing[1], distance};
  for (std::size_t row = 0; row < 3; ++row) {
    stack.geometry.direction[row * 3] = plane.along_row[row];
    stack.geometry.direction[row * 3 + 1] = plane.along_column[row];
    stack.geometry.direction[row * 3 + 2] = step[row] / distance;
  }
  for (const Placed& each : placed) stack.slices.push_back(each.slice);
  return stack;
}

}  // namespace isomesh::import::dicom
