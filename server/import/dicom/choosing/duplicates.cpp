#include "server/import/dicom/choosing/duplicates.h"

#include <algorithm>
#include <limits>
#include <span>
#include <string>
#include <tuple>

#include "server/import/dicom/geometry/placement.h"
#include "server/import/dicom/geometry/vectors.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

bool is_before(const Placed& a, const Placed& b) {
  const auto key = [](const Slice& slice) {
    constexpr std::int64_t kLast = std::numeric_limits<std::int64_t>::max();
    return std::tuple(slice.image->instance_number.value_or(kLast), slice.image->file_name,
                      slice.file, slice.frame->number);
  };
  return key(a.slice) < key(b.slice);
}

// The slices of one position after another, by the indices of their first.
std::vector<std::span<Placed>> positions_of(std::span<Placed> placed) {
  const std::vector<std::size_t> starts = position_starts(placed);
  std::vector<std::span<Placed>> positions;
  for (std::size_t at = 0; at < starts.size(); ++at) {
    const std::size_t end = at + 1 < starts.size() ? starts[at + 1] : placed.size();
    positions.push_back(placed.subspan(starts[at], end - starts[at]));
  }
  return positions;
}

struct Duplicates {
  std::size_t same = 0;
  std::size_t different = 0;
  std::size_t doubled = 0;        // positions with several slices
  std::size_t doubtful = 0;       // positions with slices that differ
  std::size_t positions = 0;      // all
  const Placed* first = nullptr;  // of those that differ
  const Placed* second = nullptr;
};

// "at 2 of 93 positions"
std::string share_of(const Duplicates& found) {
  return "at " + std::to_string(found.doubtful) + " of " + std::to_string(found.positions) +
         " positions";
}

// If half of the positions have several slices, and half of these differ, they are rather two
// volumes, one of which lacks some. One slice of each position would mix both.
bool may_be_mixed(const Duplicates& found) {
  return found.doubled * 2 >= found.positions && found.doubtful * 2 >= found.doubled;
}

[[noreturn]] void throw_different(const Duplicates& found, const ImportOptions& options) {
  const std::string first = place_of(found.first->slice);
  const std::string what = "A slice occurs more than once, with other samples, " + share_of(found) +
                           ": " + first + " and " + place_of(found.second->slice) +
                           " lie at one position.";
  if (may_be_mixed(found)) {
    throw_unusable(what +
                   " So the series seems to hold several volumes, of which one is incomplete, and "
                   "nothing shows which slices belong together. Upload the slices of one volume.");
  }
  throw_overridable(
      NoteCode::kDuplicateSlice,
      what + begin_remedy(options, "Add") + "accept=duplicate-slice to use " + first +
          (found.different > 1 ? " and, of the others, the one with the lowest instance number."
                               : "."));
}

Note note_on(const Duplicates& found) {
  std::string detail;
  if (found.same > 0) {
    detail = count_of(found.same, "slice") + (found.same == 1 ? " was" : " were") +
             " left out, with the position and the samples of another one.";
  }
  if (found.different > 0) {
    detail += (detail.empty() ? "" : " ") + count_of(found.different, "slice") +
              (found.different == 1 ? " was" : " were") +
              " left out, with the position of another one and other samples, " + share_of(found) +
              ". The request accepts that: the lowest instance number was used, or else the first "
              "name.";
  }
  return note_of(NoteCode::kDuplicateSlice, std::move(detail));
}

}  // namespace

DistinctSlices without_duplicates(std::vector<Slice> slices, const SameSamples& same_samples,
                                  const ImportOptions& options, std::vector<Note>& notes) {
  refuse_mixtures(slices);
  std::vector<Placed> placed = placed_along_normal(slices);
  const std::vector<std::span<Placed>> positions = positions_of(placed);
  const bool are_alike = std::ranges::all_of(
      positions, [&](const auto& each) { return each.size() == positions.front().size(); });
  if (are_alike && (positions.size() == 1 || positions.front().size() == 1)) {
    return {std::move(slices), {}};
  }
  DistinctSlices distinct;
  Duplicates found;
  found.positions = positions.size();
  for (const std::span<Placed> position : positions) {
    std::ranges::sort(position, is_before);
    const Placed& first = position.front();
    distinct.slices.push_back(first.slice);
    const std::size_t different_before = found.different;
    const std::size_t left_out_before = distinct.left_out.size();
    for (const Placed& other : position.subspan(1)) {
      // Beside the first one in its plane; make_stack refuses it.
      if (length(difference(other.position(), first.position())) > kSamePlaceMm) {
        distinct.slices.push_back(other.slice);
        continue;
      }
      distinct.left_out.push_back(other.slice);
      if (same_samples(first.slice, other.slice)) {
        ++found.same;
      } else if (are_alike) {
        return {std::move(slices), {}};
      } else if (++found.different == 1) {
        found.first = &first;
        found.second = &other;
      }
    }
    if (found.different > different_before) ++found.doubtful;
    if (distinct.left_out.size() > left_out_before) ++found.doubled;
  }
  if (found.different > 0 && (may_be_mixed(found) || !options.accepts(NoteCode::kDuplicateSlice))) {
    throw_different(found, options);
  }
  if (!distinct.left_out.empty()) notes.push_back(note_on(found));
  return distinct;
}

}  // namespace isomesh::import::dicom
