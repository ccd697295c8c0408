#include "server/jobs/certify_stage.h"

#include <algorithm>
#include <string>
#include <utility>

#include "proto/parameters.h"
#include "server/codec/decode/decode.h"
#include "server/jobs/error_budget.h"
#include "server/mesh/distance.h"
#include "server/mesh/self_intersections.h"

namespace isomesh::jobs {
namespace {

// The files as a stranger decodes them, with their formats: those in a ZIP, format by format.
std::vector<std::pair<MeshFormat, codec::DecodedSurface>> decoded(std::span<const std::byte> file,
                                                                  MeshFormat format,
                                                                  const MeshParameters& parameters,
                                                                  const mesh::Context& context) {
  const Space space = space_of(format, parameters);
  std::vector<std::pair<MeshFormat, codec::DecodedSurface>> surfaces;
  if (format != MeshFormat::kZip) {
    surfaces.emplace_back(format, codec::decode(file, format, space, context));
    return surfaces;
  }
  for (auto& [inner, surface] : codec::decode_zip(file, space, context)) {
    surfaces.emplace_back(inner, std::move(surface));
  }
  return surfaces;
}

SelfIntersections summary_of(const mesh::SelfIntersections& found) {
  SelfIntersections summary = {.pairs = found.pairs, .triangles = found.triangles};
  for (const mesh::IntersectingPair& pair : found.places) summary.places.push_back(pair.place);
  return summary;
}

ErrorBudget budget_of(const MeshParameters& parameters, const mesh::Mesh& mesh,
                      const MeshSummary& summary) {
  ErrorBudget budget = {.smoothing = summary.displacement_mm.max,
                        .quantisation = quantisation_mm(parameters, mesh)};
  budget.simplification = *parameters.max_error_mm - budget.smoothing - budget.quantisation;
  return budget;
}

}  // namespace

KeptFiles::KeptFiles(const MeshRequest& request, std::span<const codec::Sink> sinks)
    : bytes_(sinks.size()), sinks_(sinks.begin(), sinks.end()) {
  if (!request.certify) return;
  for (std::size_t i = 0; i < sinks.size(); ++i) {
    sinks_[i] = [&kept = bytes_[i], &sink = sinks[i]](std::span<const std::byte> bytes) {
      kept.insert(kept.end(), bytes.begin(), bytes.end());
      sink(bytes);
    };
  }
}

void certify_stage(const MeshRequest& request, const ExtractedSurface& extracted,
                   const KeptFiles& files, Progress& progress, const mesh::Mesh& mesh,
                   MeshSummary& summary) {
  if (!request.certify) return;
  const MeshParameters& parameters = request.parameters;
  progress.enter(Stage::kCertify, shares_of(request).certify, &Timing::certify);
  const std::vector<MeshFormat> formats = files_of(parameters);
  const double part = 1.0 / static_cast<double>(formats.size() + 1);
  const mesh::SurfaceView reference = extracted.view();
  MeshCertificate& certificate = summary.certificate.emplace();
  bool is_first = true;
  for (std::size_t i = 0; i < formats.size(); ++i) {
    const double begin = part * static_cast<double>(i);
    for (const auto& [format, surface] :
         decoded(files.bytes(i), formats[i], parameters, progress.quiet())) {
      const mesh::Certificate measured =
          mesh::certify(surface.view(), reference, progress.context(begin, begin + part));
      if (!is_first && measured.max_mm() <= certificate.max_mm) continue;
      is_first = false;
      certificate.file = format;
      certificate.max_mm = measured.max_mm();
      certificate.from_mesh = measured.from_mesh;
      certificate.from_extracted = measured.from_reference;
    }
  }
  if (parameters.max_error_mm) {
    if (certificate.max_mm > *parameters.max_error_mm) {
      throw Error(ErrorCode::kInternal,
                  "the " + std::string(to_string(certificate.file)) + " file is " +
                      number_text(certificate.max_mm) +
                      " mm from the extracted surface, which is more than max_error_mm");
    }
    certificate.budget_mm = budget_of(parameters, mesh, summary);
  }
  summary.quality.self_intersections =
      summary_of(find_self_intersections(mesh, progress.context(1 - part, 1)));
}

}  // namespace isomesh::jobs
