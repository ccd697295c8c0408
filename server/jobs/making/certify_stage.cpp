#include "server/jobs/making/certify_stage.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "proto/parameters.h"
#include "server/codec/formats.h"
#include "server/jobs/making/error_budget.h"
#include "server/mesh/measure/distance.h"
#include "server/mesh/measure/join_equal.h"
#include "server/mesh/measure/self_intersections.h"
#include "server/mesh/parallel.h"

namespace isomesh::jobs {
namespace {

// Decodes the file of this format, or all labels' files of it, as other programs do.
codec::DecodedSurface decoded(const KeptFiles& files, MeshFormat format,
                              const MeshParameters& parameters,
                              const std::vector<LabelSummary>& labels,
                              const mesh::Context& context) {
  const Space space = space_of(format, parameters);
  if (!parameters.labels || holds_all_labels(format)) {
    return codec::decode(files.bytes(format), format, space, context);
  }
  const std::span<const std::byte> zip = files.bytes(MeshFormat::kZip);
  std::vector<codec::DecodedSurface> parts(labels.size());
  mesh::parallel_for(context, parts.size(), [&](std::size_t n) {
    const LabelFile& file = labels[n].files.at(format);
    parts[n] = codec::decode(zip.subspan(file.offset, file.bytes), format, space, context);
  });
  return codec::join(std::move(parts), context);
}

SelfIntersections summary_of(const mesh::SelfIntersections& found) {
  SelfIntersections summary = {.pairs = found.pairs, .triangles = found.triangles};
  for (const mesh::IntersectingPair& pair : found.places) summary.places.push_back(pair.place);
  return summary;
}

ErrorBudget budget_of(const MeshParameters& parameters, const mesh::Mesh& mesh,
                      const MeshSummary& summary) {
  ErrorBudget budget = {.quantisation = quantisation_mm(parameters, mesh)};
  if (error_reference(parameters) == MeshCertificate::Reference::kExtracted) {
    budget.smoothing = summary.displacement_mm.max;
  }
  budget.simplification = *parameters.max_error_mm - budget.smoothing - budget.quantisation;
  return budget;
}

}  // namespace

KeptFiles::KeptFiles(const MeshRequest& request, std::span<const codec::Sink> sinks)
    : sinks_(sinks.begin(), sinks.end()) {
  if (!request.measures.certify) return;
  const std::vector<MeshFormat> files = files_of(request.parameters);
  for (std::size_t i = 0; i < sinks.size(); ++i) {
    if (!codec::rounds(files[i], request.parameters)) continue;
    sinks_[i] = [&kept = bytes_[files[i]], &sink = sinks[i]](std::span<const std::byte> bytes) {
      kept.insert(kept.end(), bytes.begin(), bytes.end());
      sink(bytes);
    };
  }
}

void certify_stage(const MeshRequest& request, const KeptSurface& reference, const KeptFiles& files,
                   Progress& progress, const mesh::Mesh& mesh, MeshSummary& summary) {
  if (!request.measures.certify) return;
  const MeshParameters& parameters = request.parameters;
  progress.enter(Stage::kCertify);
  const mesh::Context stage = progress.context();
  const std::vector<MeshFormat> formats = measured_formats(parameters);
  const double part = 1.0 / static_cast<double>(formats.size());
  if (!summary.certificate) {
    summary.certificate.emplace().why_unproven = "A proof needs max_error_mm.";
  }
  constexpr double kDistances = 0.7;  // of the time; the rest is for intersections
  constexpr double kUnbounded = std::numeric_limits<double>::infinity();
  MeshCertificate& certificate = *summary.certificate;
  certificate.reference = error_reference(parameters);
  mesh::SelfIntersections crossings;
  const auto count_crossings = [&](const mesh::SurfaceView& surface, const mesh::Context& context) {
    mesh::SelfIntersections found = find_self_intersections(surface, context);
    if (found.pairs >= crossings.pairs) crossings = std::move(found);
  };
  for (std::size_t i = 0; i < formats.size(); ++i) {
    std::optional<codec::DecodedSurface> file;
    if (codec::rounds(formats[i], parameters)) {
      file = decoded(files, formats[i], parameters, summary.labels, progress.quiet());
    }
    const double begin = part * static_cast<double>(i);
    const mesh::Certificate measured =
        mesh::certify(file ? file->view() : mesh::SurfaceView(mesh), reference.view(),
                      stage.part(begin, begin + kDistances * part),
                      certificate.bound_mm ? kMostPointsBesideAProof : mesh::kAllPoints,
                      certificate.bound_mm.value_or(kUnbounded));
    if (!parameters.labels) {
      // Blocks and cuts of encoders duplicate vertices.
      if (file) mesh::join_equal(file->positions.span(), file->triangles.span());
      count_crossings(file ? file->view() : mesh::SurfaceView(mesh),
                      stage.part(begin + kDistances * part, begin + part));
    }
    if (i > 0 && measured.max_mm() <= certificate.found_mm) continue;
    certificate.file = formats[i];
    certificate.found_mm = measured.max_mm();
    certificate.from_mesh = measured.from_mesh;
    certificate.from_extracted = measured.from_reference;
  }
  if (parameters.max_error_mm) {
    const double largest = std::max(certificate.found_mm, certificate.bound_mm.value_or(0));
    if (largest > *parameters.max_error_mm) {
      throw Error(ErrorCode::kInternal, "the " + std::string(to_string(certificate.file)) +
                                            " file is " + number_text(largest) + " mm from the " +
                                            std::string(to_string(certificate.reference)) +
                                            " surface, which is more than max_error_mm");
    }
    certificate.budget_mm = budget_of(parameters, mesh, summary);
  }
  // Files of labels have each wall twice.
  if (parameters.labels) count_crossings(mesh, progress.quiet());
  summary.quality.self_intersections = summary_of(crossings);
}

}  // namespace isomesh::jobs
