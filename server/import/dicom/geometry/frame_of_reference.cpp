#include "server/import/dicom/geometry/frame_of_reference.h"

#include <algorithm>
#include <map>
#include <string>
#include <string_view>

#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

std::map<std::string_view, std::size_t> slices_by_uid(std::span<const Slice> slices) {
  std::map<std::string_view, std::size_t> counts;
  for (const Slice& slice : slices) ++counts[slice.image->frame_of_reference_uid];
  return counts;
}

}  // namespace

std::optional<Note> note_on_frames_of_reference(std::span<const Slice> slices,
                                                const ImportOptions& options) {
  const auto counts = slices_by_uid(slices);
  if (counts.size() == 1) return std::nullopt;
  const bool one_each = std::ranges::all_of(
      counts, [](const auto& entry) { return entry.first.empty() || entry.second == 1; });
  const std::size_t several = counts.size() - counts.count("");
  const std::string found = "the " + std::to_string(slices.size()) + " slices have " +
                            std::to_string(several) + " frames of reference (0020,0052)" +
                            (counts.contains("") ? ", and some have none." : ".");
  const std::string even_line =
      " The slices are evenly spaced on one line, so they were read as one volume.";
  if (one_each) {
    return note_of(NoteCode::kFrameOfReference,
                   "Each slice has its own frame of reference, as some anonymisers write it: " +
                       found + even_line);
  }
  if (options.accepts(NoteCode::kFrameOfReference)) {
    return note_of(NoteCode::kFrameOfReference,
                   "The request accepts several frames of reference: " + found + even_line);
  }
  throw_overridable(
      NoteCode::kFrameOfReference,
      "The series is not a single volume: " + found +
          " Slices with different frames of reference may not share one coordinate system." +
          begin_remedy(options, "Add") + "accept=frame-of-reference to read them as one volume.");
}

}  // namespace isomesh::import::dicom
