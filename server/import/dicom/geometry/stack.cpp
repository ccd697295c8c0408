#include "server/import/dicom/geometry/stack.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/text.h"
#include "server/import/dicom/geometry/placement.h"
#include "server/import/dicom/geometry/vectors.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

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

std::string number_of(std::size_t place, std::size_t count, bool from_end) {
  return std::to_string(from_end ? count - place : place + 1);
}

void refuse_shared_positions(std::span<const Placed> placed, bool from_end) {
  const std::vector<std::size_t> first_of_position = position_starts(placed);
  const std::size_t positions = first_of_position.size();
  if (positions == placed.size()) return;
  std::size_t place = 0;
  while (place + 1 < positions && first_of_position[place + 1] == first_of_position[place] + 1) {
    ++place;
  }
  if (placed.size() % positions == 0) {
    throw_unusable("The series holds " + std::to_string(placed.size() / positions) + " slices at " +
                   (positions == 1 ? "its only position"
                                   : "each of its " + std::to_string(positions) + " positions") +
                   ". Nothing shows which slices belong to the same volume.");
  }
  throw_unusable("Slice " + number_of(place, positions, from_end) + " of " +
                 std::to_string(positions) + " occurs more than once.");
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
  std::vector<double> places;
  for (const Placed& each : placed) places.push_back(each.along);
  const double usual = usual_gap(places).value();
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
                   " apart, but others are " + in_mm(usual) + " apart.");
  }
  if (!missing.empty()) {
    throw_unusable("The series is incomplete: " +
                   missing_slices(missing, count + missing.size(), from_end) + '.');
  }
}

// Every slice must lie at equal steps along one line. This also finds slices that are shifted
// within their planes.
void refuse_crooked(std::span<const Placed> placed, const Vector3& step, bool from_end) {
  const double tolerance = kPlaceTolerance * length(step);
  for (std::size_t i = 0; i < placed.size(); ++i) {
    Vector3 off = difference(placed[i].position(), placed.front().position());
    for (std::size_t axis = 0; axis < 3; ++axis) off[axis] -= step[axis] * static_cast<double>(i);
    if (length(off) <= tolerance) continue;
    throw_unusable("Slice " + number_of(i, placed.size(), from_end) + " of " +
                   std::to_string(placed.size()) + " lies " + in_mm(length(off)) +
                   " away from its place in a line of evenly spaced slices.");
  }
}

}  // namespace

std::string Stack::name(std::size_t place) const {
  return "slice " + number_of(place, slices.size(), numbered_from_end) + " of " +
         std::to_string(slices.size());
}

Stack make_stack(std::vector<Slice> slices) {
  const PixelLayout& layout = slices.front().image->layout;
  if (slices.size() == 1) refuse_flat("The series", {layout.columns, layout.rows, 1});
  refuse_mixtures(slices);
  const std::vector<Placed> placed = placed_along_normal(slices);
  Stack stack;
  stack.numbered_from_end = falls(placed);
  refuse_shared_positions(placed, stack.numbered_from_end);
  refuse_gaps(placed, stack.numbered_from_end);
  Vector3 step = difference(placed.back().position(), placed.front().position());
  for (double& part : step) part /= static_cast<double>(placed.size() - 1);
  refuse_crooked(placed, step, stack.numbered_from_end);

  stack.geometry = lattice(placed.front().slice.frame->plane, step);
  for (const Placed& each : placed) stack.slices.push_back(each.slice);
  stack.is_distance_assumed = stack.slices.front().image->is_distance_assumed;
  return stack;
}

}  // namespace isomesh::import::dicom
