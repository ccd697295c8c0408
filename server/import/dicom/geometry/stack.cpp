#include "server/import/dicom/geometry/stack.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <string>

#include "base/text.h"
#include "server/import/dicom/geometry/even_line.h"
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

// Empty for nothing.
std::string in_brackets(const std::string& text) {
  return text.empty() || text == ", " ? "" : " (" + text + ')';
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
                   ". Nothing shows which slices belong to the same volume. For example, " +
                   place_of(placed[0].slice) + " and " + place_of(placed[1].slice) +
                   " lie at one position.");
  }
  const std::size_t first = first_of_position[place];
  throw_unusable("Slice " + number_of(place, positions, from_end) + " of " +
                 std::to_string(positions) + " occurs more than once: " +
                 place_of(placed[first].slice) + " and " + place_of(placed[first + 1].slice) + ".");
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

// The distances between neighbours along the normal, and missing slices.
struct Gaps {
  double usual = 0;
  std::vector<double> steps;         // each slice's number of usual gaps from the first, whole
  std::vector<std::size_t> missing;  // places without a slice, among all places
  std::size_t uneven = 0;            // the first slice that is no whole number of usual gaps away
};

// The median, or the smallest gap if all others are a few times that: most slices may be missing.
double distance_of(const std::vector<double>& along) {
  constexpr double kMostTimes = 8;
  double smallest = along[1] - along[0];
  for (std::size_t i = 2; i < along.size(); ++i) {
    smallest = std::min(smallest, along[i] - along[i - 1]);
  }
  for (std::size_t i = 1; i < along.size(); ++i) {
    const double times = (along[i] - along[i - 1]) / smallest;
    if (std::abs(times - std::round(times)) > kPlaceTolerance || times > kMostTimes) {
      return usual_gap(along).value();
    }
  }
  return smallest;
}

Gaps gaps_of(std::span<const Placed> placed) {
  // Gaps of more slices than any series has are uneven instead.
  constexpr double kMostMissing = 1e6;
  std::vector<double> along;
  for (const Placed& each : placed) along.push_back(each.along);
  Gaps gaps;
  gaps.usual = distance_of(along);
  gaps.steps.push_back(0);
  for (std::size_t i = 1; i < placed.size(); ++i) {
    const double steps = (along[i] - along[i - 1]) / gaps.usual;
    const double whole = std::max(std::round(steps), 1.0);
    const double before = gaps.steps.back();
    const bool is_plausible = static_cast<double>(gaps.missing.size()) + whole <= kMostMissing;
    const bool is_even = is_plausible && std::abs(steps - whole) <= kPlaceTolerance;
    if (!is_even && gaps.uneven == 0) gaps.uneven = i;
    for (double skipped = 1; is_plausible && skipped < whole; ++skipped) {
      gaps.missing.push_back(static_cast<std::size_t>(before + skipped));
    }
    gaps.steps.push_back(before + whole);
  }
  return gaps;
}

std::string incomplete_reason(std::span<const Placed> placed, const Gaps& gaps, bool from_end) {
  std::size_t behind = 1;
  while (gaps.steps[behind] - gaps.steps[behind - 1] < 2) ++behind;
  const std::string one = place_of(placed[behind - 1].slice);
  const std::string other = place_of(placed[behind].slice);
  return "The series is incomplete: " +
         missing_slices(gaps.missing, placed.size() + gaps.missing.size(), from_end) +
         (one.empty() ? "." : ". There is a gap between " + one + " and " + other + ".");
}

std::string uneven_reason(std::span<const Placed> placed, const Gaps& gaps, bool from_end) {
  const std::size_t count = placed.size();
  const std::size_t one = from_end ? count - gaps.uneven : gaps.uneven;
  const std::size_t other = from_end ? one + 1 : gaps.uneven + 1;
  const Placed& before = placed[gaps.uneven - 1];
  const Placed& behind = placed[gaps.uneven];
  const std::string names =
      in_brackets(from_end ? place_of(behind.slice) + ", " + place_of(before.slice)
                           : place_of(before.slice) + ", " + place_of(behind.slice));
  return "The slices are unevenly spaced: slices " + std::to_string(one) + " and " +
         std::to_string(other) + " of " + std::to_string(count) + names + " are " +
         in_mm(behind.along - before.along) + " apart, but others are " + in_mm(gaps.usual) +
         " apart.";
}

// The first slice that does not lie at equal steps along one line; empty if all do. This also finds
// slices that are shifted within their planes.
std::optional<std::string> crooked_reason(std::span<const Placed> placed, const Vector3& step,
                                          bool from_end) {
  const double tolerance = kPlaceTolerance * length(step);
  for (std::size_t i = 0; i < placed.size(); ++i) {
    const Vector3 place = moved(placed.front().position(), step, static_cast<double>(i));
    const double off = length(difference(placed[i].position(), place));
    if (off <= tolerance) continue;
    return "Slice " + number_of(i, placed.size(), from_end) + " of " +
           std::to_string(placed.size()) + in_brackets(place_of(placed[i].slice)) + " lies " +
           in_mm(off) + " away from its place in a line of evenly spaced slices.";
  }
  return std::nullopt;
}

// True if rounding could hide that a slice is missing: the widest gap may be two steps of a line
// that has one step more.
bool may_hide_a_slice(std::span<const Placed> placed, const Vector3& rounding) {
  const Plane& plane = placed.front().slice.frame->plane;
  const Vector3 normal = cross(plane.along_row, plane.along_column);
  double along_normal = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    along_normal += std::abs(normal[axis]) * rounding[axis];
  }
  double widest = 0;
  for (std::size_t i = 1; i < placed.size(); ++i) {
    widest = std::max(widest, placed[i].along - placed[i - 1].along);
  }
  const double span = placed.back().along - placed.front().along;
  return widest + along_normal >= 2 * span / static_cast<double>(placed.size());
}

// The line of slices that are not evenly spaced, if they are so by rounding, or if the options
// accept it. `reason` says how they are not even.
EvenLine evened_line(std::span<const Placed> placed, const Gaps& gaps, const std::string& reason,
                     bool from_end, const ImportOptions& options, std::vector<Note>& notes) {
  std::vector<Vector3> places;
  for (const Placed& each : placed) places.push_back(each.position());
  std::vector<double> steps(placed.size());
  std::iota(steps.begin(), steps.end(), 0);
  const EvenLine line = nearest_line(places, steps);
  const double distance = length(line.step);
  // Rounding of gaps to one and two units looks as if slices were missing.
  const bool is_whole = gaps.steps == steps;
  if (!is_whole && !line.explains_places()) {
    const bool is_incomplete =
        gaps.uneven == 0 || nearest_line(places, gaps.steps).explains_places();
    throw_unusable(is_incomplete ? incomplete_reason(placed, gaps, from_end) : reason);
  }
  if (line.farthest >= distance / 2) throw_unusable(reason);
  const std::string evenly = "evenly spaced slices, " + in_mm(distance) + " apart";
  if (is_whole && line.explains_places() && !may_hide_a_slice(placed, line.rounding)) {
    notes.push_back(note_of(NoteCode::kPositionsRounded,
                            "The positions of the slices are rounded to " +
                                in_mm(std::ranges::max(line.rounding)) + ". They are those of " +
                                evenly + ", which were used."));
    return line;
  }
  if (!options.accepts(NoteCode::kPositionsRounded)) {
    throw_overridable(NoteCode::kPositionsRounded,
                      reason + (is_whole ? "" : " Or its positions are rounded, and none is.") +
                          begin_remedy(options, "Add") + "accept=positions-rounded to read " +
                          evenly + ": they lie up to " + in_mm(line.farthest) +
                          " away from the positions of the file.");
  }
  notes.push_back(
      note_of(NoteCode::kPositionsRounded, "The slices are unevenly spaced. The request accepts " +
                                               evenly + ": they lie up to " + in_mm(line.farthest) +
                                               " away from the positions of the file."));
  return line;
}

}  // namespace

std::string Stack::name(std::size_t place) const {
  return "slice " + number_of(place, slices.size(), numbered_from_end) + " of " +
         std::to_string(slices.size());
}

Stack make_stack(std::vector<Slice> slices, const ImportOptions& options,
                 std::vector<Note>& notes) {
  const PixelLayout& layout = slices.front().image->layout;
  if (slices.size() == 1) refuse_flat("The series", {layout.columns, layout.rows, 1});
  refuse_mixtures(slices);
  const std::vector<Placed> placed = placed_along_normal(slices);
  Stack stack;
  stack.numbered_from_end = falls(placed);
  refuse_shared_positions(placed, stack.numbered_from_end);
  const Gaps gaps = gaps_of(placed);
  Plane first = placed.front().slice.frame->plane;
  Vector3 step = difference(placed.back().position(), placed.front().position());
  for (double& part : step) part /= static_cast<double>(placed.size() - 1);
  const bool from_end = stack.numbered_from_end;
  const auto reason = gaps.uneven != 0 ? std::optional(uneven_reason(placed, gaps, from_end))
                      : !gaps.missing.empty()
                          ? std::optional(incomplete_reason(placed, gaps, from_end))
                          : crooked_reason(placed, step, from_end);
  if (reason) {
    const EvenLine line = evened_line(placed, gaps, *reason, from_end, options, notes);
    first.position = line.origin;
    step = line.step;
  }

  stack.geometry = lattice(first, step);
  for (const Placed& each : placed) stack.slices.push_back(each.slice);
  stack.is_distance_assumed = stack.slices.front().image->is_distance_assumed;
  return stack;
}

}  // namespace isomesh::import::dicom
