#include "proto/empty_surface.h"

namespace isomesh {
namespace {

std::string why_iso(const MeshParameters& parameters, double iso, const SampleValues& samples) {
  const auto [low, high] = samples.range;
  const bool is_cropped = parameters.crop.has_value();
  std::string reason = "the iso-value " + number_text(iso) + " separates none of the samples";
  reason += is_cropped ? " in the box of crop; those of the volume" : " of the volume, which";
  reason += " range from " + number_text(low) + " to " + number_text(high);
  const double suggested = samples.suggested_iso;
  const bool can_help = suggested != iso && suggested > low && suggested <= high;
  return can_help ? reason + "; its suggested iso-value is " + number_text(suggested) : reason;
}

}  // namespace

std::string why_empty(const MeshParameters& parameters, const MeshSummary& mesh,
                      const SampleValues& samples) {
  const std::uint64_t dropped = mesh.dropped.components;
  if (dropped > 0) {
    const std::string all =
        dropped == 1 ? "its only connected component was dropped"
                     : "all " + std::to_string(dropped) + " connected components were dropped";
    return all + "; keep more of them, or smaller ones";
  }
  if (mesh.iso) return why_iso(parameters, *mesh.iso, samples);
  std::string reason = "the chosen labels have no boundary";
  if (parameters.crop) reason += " in the box of crop";
  return parameters.close ? reason : reason + "; close adds the border of the volume to it";
}

Error empty_surface(const MeshSummary& mesh, const std::string& way_out) {
  std::string detail = "the surface is empty";
  if (mesh.empty_reason) detail += ": " + *mesh.empty_reason;
  if (!way_out.empty()) detail += "; " + way_out;
  return {ErrorCode::kEmptySurface, detail};
}

}  // namespace isomesh
