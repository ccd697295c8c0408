#include "server/hospital/orders/measure_surfaces.h"

#include <algorithm>
#include <cstring>
#include <span>

#include "base/text.h"
#include "proto/error.h"
#include "server/jobs/library/label_pages.h"
#include "server/mesh/measure/diameter.h"

namespace isomesh::orders {
namespace {

constexpr std::size_t kHeadBytes = 84;  // of a binary STL file
constexpr std::size_t kFacetBytes = 50;

// Sorted, without duplicates.
void make_unique(std::vector<mesh::Vec3>& points) {
  std::sort(points.begin(), points.end());
  points.erase(std::unique(points.begin(), points.end()), points.end());
}

// The vertices of the STL file of so many bytes at that offset, each once.
std::vector<mesh::Vec3> vertices_of(const store::BlobReader& blob, std::uint64_t offset,
                                    std::uint64_t bytes, const std::stop_token& stop) {
  constexpr std::size_t kFacetsAtOnce = 20'000;
  std::vector<std::byte> buffer(kFacetsAtOnce * kFacetBytes);
  std::vector<mesh::Vec3> points;
  // A vertex is in about six facets, so duplicates are removed whenever the list has doubled.
  std::size_t most = std::size_t{1} << 20;
  const std::uint64_t end = offset + bytes;
  for (std::uint64_t at = offset + kHeadBytes; at < end;) {
    if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "the order was cancelled");
    const auto piece = std::span(buffer).first(std::min<std::uint64_t>(buffer.size(), end - at));
    for (std::size_t have = 0; have < piece.size();) {
      const std::size_t count = blob.read_at(at + have, piece.subspan(have));
      if (count == 0) throw Error(ErrorCode::kInternal, "a stored mesh became shorter");
      have += count;
    }
    for (std::size_t facet = 0; facet + kFacetBytes <= piece.size(); facet += kFacetBytes) {
      std::array<mesh::Vec3, 4> vectors;  // the normal, and the corners
      std::memcpy(vectors.data(), piece.data() + facet, sizeof vectors);
      points.insert(points.end(), vectors.begin() + 1, vectors.end());
    }
    at += piece.size();
    if (points.size() >= most) {
      make_unique(points);
      most = std::max(most, 2 * points.size());
    }
  }
  make_unique(points);
  return points;
}

double diameter_of(const store::BlobReader& blob, std::uint64_t offset, std::uint64_t bytes,
                   const std::stop_token& stop) {
  std::vector<mesh::Vec3> points = vertices_of(blob, offset, bytes, stop);
  return mesh::largest_distance(points, stop);
}

// Says why a surface has no volume, if it has none.
std::string volume_text(const dicom::MeasuredSurface& surface) {
  if (surface.volume_mm3) return number_text(*surface.volume_mm3);
  return surface.is_inside_out ? "inside out" : "open";
}

}  // namespace

std::optional<DicomSegment> find_segment(const DicomIdentity& identity, std::int64_t label) {
  const auto found = std::ranges::find(identity.segments, label, &DicomSegment::label);
  return found == identity.segments.end() ? std::nullopt : std::optional(*found);
}

std::vector<dicom::MeasuredSurface> measure_surfaces(const Job& job, const DicomIdentity& identity,
                                                     const std::string& title,
                                                     const store::BlobStore& blobs,
                                                     const std::stop_token& stop) {
  const MeshSummary& mesh = job.mesh.value();
  if (!job.parameters.labels) {
    const MeshFile& stl = mesh.files.at(MeshFormat::kStl);
    dicom::MeasuredSurface whole = {
        .name = title,
        .area_mm2 = mesh.area_mm2,
        .diameter_mm = diameter_of(*blobs.open(stl.sha256), 0, stl.bytes, stop)};
    if (mesh.quality.encloses_volume)
      whole.volume_mm3 = mesh.volume_mm3.smoothed;
    else
      whole.is_inside_out = mesh.quality.closed && mesh.quality.oriented;
    return {whole};
  }
  const jobs::JobLabels labels(job, blobs);
  if (labels.count() > kMostReportedLabels) {
    throw Error(ErrorCode::kTooLarge, "the mesh has " + std::to_string(labels.count()) +
                                          " labels, but a report has at most " +
                                          std::to_string(kMostReportedLabels) +
                                          "; order fewer labels");
  }
  const auto zip = blobs.open(mesh.files.at(MeshFormat::kZip).sha256);
  std::vector<dicom::MeasuredSurface> surfaces;
  labels.for_each([&](const LabelSummary& label) {
    const auto stl = label.files.find(MeshFormat::kStl);
    if (stl == label.files.end() || label.triangles == 0) return;
    const LabelFile& file = stl->second;
    dicom::MeasuredSurface surface = {
        .name = label.name.value_or("Label " + std::to_string(label.label)),
        .label = label.label,
        .segment = find_segment(identity, label.label),
        .area_mm2 = label.area_mm2,
        .diameter_mm = diameter_of(*zip, file.offset, file.bytes, stop)};
    if (label.encloses_volume())
      surface.volume_mm3 = label.volume_mm3;
    else
      surface.is_inside_out = label.closed && label.oriented;
    surfaces.push_back(std::move(surface));
  });
  return surfaces;
}

std::string text_of(const std::vector<dicom::MeasuredSurface>& surfaces) {
  std::string text;
  for (const dicom::MeasuredSurface& each : surfaces) {
    text += (each.label ? std::to_string(*each.label) : "") + ' ' + each.name + ' ' +
            volume_text(each) + ' ' + number_text(each.area_mm2) + ' ' +
            number_text(each.diameter_mm) + '\n';
  }
  return text;
}

}  // namespace isomesh::orders
