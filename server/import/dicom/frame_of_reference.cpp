#include "server/import/dicom/frame_of_reference.h"

#include <algorithm>
#include <map>
#include <string>
#include <string_view>

#include "server/import/source.h"

namespace isomesh::import::dicom {
namespace {

// How many slices have each frame of reference.
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
  const std::string found = "The " + std::to_string(slices.size()) + " slices have " +
                            std::to_string(several) + " frames of reference" +
                            (counts.contains("") ? ", and some have none" : "");
  if (one_each) {
    return note_of(NoteCode::kFrameOfReference,
                   found +
                       ": each its own, as some anonymisers leave them. They lie on one even "
                       "line, so they were taken as one volume.");
  }
  if (options.accepts(NoteCode::kFrameOfReference)) {
    return note_of(NoteCode::kFrameOfReference,
                   found + ", which was accepted. They lie on one even line.");
  }
  throw_overridable(NoteCode::kFrameOfReference,
                    "The series is no single volume: " + found +
                        " (0020,0052), so they fall into groups that may lie anywhere to each "
                        "other.");
}

}  // namespace isomesh::import::dicom
