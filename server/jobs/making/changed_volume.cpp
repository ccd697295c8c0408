#include "server/jobs/making/changed_volume.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <string>

#include "server/jobs/making/mesh_cost.h"

namespace isomesh::jobs {
namespace {

constexpr double kToldFrom = 0.05;  // of the extracted volume

// In percent, with one place.
std::string percent(double share) {
  std::array<char, 32> text = {};
  std::snprintf(text.data(), text.size(), "%.1f %%", 100 * std::abs(share));
  return text.data();
}

// The ways out, in the parameters' words.
std::string remedy_text(const MeshParameters& parameters) {
  if (parameters.smoothing != Smoothing::kLaplacian) return "Fewer passes change less.";
  const std::string keeping = "smoothing=taubin keeps the volume";
  return keeping + (is_regularized(parameters) ? "; regularize=false changes less of it." : ".");
}

}  // namespace

std::optional<Note> note_on_changed_volume(const MeshParameters& parameters,
                                           const MeshSummary& smoothed) {
  const MeshSummary::Enclosed& volume = smoothed.volume_mm3;
  if (!(volume.extracted > 0)) return std::nullopt;
  const double change = volume.smoothed / volume.extracted - 1;
  if (!(std::abs(change) > kToldFrom)) return std::nullopt;
  const double area_change = smoothed.area_mm2 / smoothed.area_extracted_mm2 - 1;
  return note_of(NoteCode::kVolumeChanged,
                 std::string("Smoothing made the volume ") + percent(change) +
                     (change < 0 ? " smaller" : " larger") + " and the area " +
                     percent(area_change) + (area_change < 0 ? " smaller. " : " larger. ") +
                     remedy_text(parameters));
}

}  // namespace isomesh::jobs
