#include "server/hospital/orders/make_objects.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "base/sha256.h"
#include "base/text.h"
#include "proto/empty_surface.h"
#include "proto/error.h"
#include "proto/json.h"
#include "proto/parameters.h"
#include "server/hospital/objects/derived_object.h"
#include "server/hospital/objects/encapsulated_document.h"
#include "server/hospital/objects/measurement_report.h"
#include "server/hospital/objects/segmentation.h"
#include "server/hospital/objects/uid.h"
#include "server/hospital/orders/measure_surfaces.h"
#include "server/jobs/library/label_pages.h"

namespace isomesh::orders {
namespace {

// The document of one object: a text, or the bytes of a file within a blob.
struct Document {
  dicom::DocumentKind kind = dicom::DocumentKind::kStl;
  SendFormat format = SendFormat::kStl;
  std::optional<std::int64_t> label = {};
  std::string name = {};                     // name of the label
  std::optional<std::int64_t> segment = {};  // the label, also of an OBJ that has no other
  std::string text = {};
  std::string blob = {};  // empty: the text is all
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
  std::string sha256;  // of the mesh or the materials
  std::string materials_uid = {};
  std::int64_t number = 1;  // in its series

  std::uint64_t size() const { return text.size() + bytes; }
};

std::vector<Document> stl_documents(const Job& job, const store::BlobStore& blobs) {
  std::vector<Document> documents;
  const auto& stored = job.mesh->files;
  if (const auto stl = stored.find(MeshFormat::kStl); stl != stored.end()) {
    documents.push_back(
        {.blob = stl->second.sha256, .bytes = stl->second.bytes, .sha256 = stl->second.sha256});
  }
  const auto zip = stored.find(MeshFormat::kZip);
  if (zip == stored.end()) return documents;
  jobs::JobLabels(job, blobs).for_each([&](const LabelSummary& label) {
    const auto stl = label.files.find(MeshFormat::kStl);
    if (stl == label.files.end() || label.triangles == 0) return;
    documents.push_back({.label = label.label,
                         .name = label.name.value_or("Label " + std::to_string(label.label)),
                         .segment = label.label,
                         .blob = zip->second.sha256,
                         .offset = stl->second.offset,
                         .bytes = stl->second.bytes,
                         .sha256 = stl->second.sha256,
                         .number = static_cast<std::int64_t>(documents.size()) + 1});
  });
  return documents;
}

// The materials first: the OBJ refers to them.
std::vector<Document> obj_documents(const Job& job, const store::BlobStore& blobs) {
  const auto obj = job.mesh->files.find(MeshFormat::kObj);
  if (obj == job.mesh->files.end()) return {};
  Document mesh = {.kind = dicom::DocumentKind::kObj,
                   .format = SendFormat::kObj,
                   .blob = obj->second.sha256,
                   .bytes = obj->second.bytes,
                   .sha256 = obj->second.sha256};
  if (!job.parameters.labels) return {mesh};
  Document materials = {
      .kind = dicom::DocumentKind::kMtl, .format = SendFormat::kObj, .sha256 = {}, .number = 2};
  const jobs::JobLabels labels(job, blobs);
  if (labels.count() == 1) mesh.segment = labels.after(std::nullopt).front().label;
  materials.text = jobs::materials_of(labels);
  materials.sha256 = sha256_of(materials.text);
  mesh.sha256 += materials.sha256;
  return {materials, mesh};
}

bool is_sent_as(const store::OrderRecord& record, SendFormat format) {
  return std::ranges::find(record.order.send, format, &SendTarget::format) !=
         record.order.send.end();
}

// Only the parameters that determine the mesh, not the other requested files.
std::string canonical_parameters(MeshParameters parameters, SendFormat format) {
  parameters.formats = {file_for(format)};
  parameters.draco = {};
  parameters.normals = false;
  return to_json(parameters);
}

std::string series_uid_of(const DicomIdentity& identity, const Job& job, const Making& making,
                          SendFormat format) {
  std::string kind = format == SendFormat::kSr    ? "series of reports\n"
                     : format == SendFormat::kSeg ? "series of segmentations\n"
                                                  : "series\n";
  if (making.labels) kind += "labels " + making.labels->samples + '\n';
  return dicom::name_based_uid(kind + identity.study_uid + '\n' + identity.series_uid + '\n' +
                               canonical_parameters(job.parameters, format) + '\n' +
                               ISOMESH_VERSION);
}

// `content` tells what else the instance depends on.
std::string instance_uid_of(const MadeObject& object, const DicomIdentity& identity,
                            const std::string& content) {
  std::vector<std::string> sources;
  for (const DicomInstance& instance : identity.instances) {
    sources.push_back(instance.sop_instance_uid);
  }
  std::ranges::sort(sources);
  std::string name = "instance\n" + object.series_uid + '\n' + object.sop_class_uid + '\n';
  for (const std::string& source : sources) name += source + '\n';
  // Two labels may have the same surface.
  if (object.label) name += "label " + std::to_string(*object.label) + '\n';
  return dicom::name_based_uid(name + content);
}

// Truncates to 64 characters, the limit of LO.
std::string in_short(const std::string& text) {
  constexpr std::size_t kLongest = 64;
  return std::string(beginning(text, kLongest));
}

std::string without_backslashes(std::string text) {
  std::ranges::replace(text, '\\', '/');
  return text;
}

// Rounded up to three decimals, so that it is still an upper bound.
double rounded_up(double mm) {
  constexpr double kThousandths = 1000;
  return std::ceil(mm * kThousandths) / kThousandths;
}

// As an object tells them: AlgorithmParameters has at most 10 240 characters (LT). The names and
// colours of labels stand elsewhere in the objects.
std::string told_parameters(MeshParameters parameters, SendFormat format) {
  constexpr std::size_t kLongest = 10'240;
  constexpr std::string_view kMore = "...";
  parameters.label_names.clear();
  parameters.label_colors.clear();
  std::string text = without_backslashes(canonical_parameters(std::move(parameters), format));
  if (text.size() <= kLongest) return text;
  return std::string(beginning(text, kLongest - kMore.size())) + std::string(kMore);
}

// The largest distance from the extracted surface: proven, or as it was found. The displacement
// by smoothing adds to a distance from the smoothed surface.
double deviation_mm(const MeshSummary& mesh) {
  const MeshCertificate& certificate = *mesh.certificate;
  const double simplified = certificate.bound_mm.value_or(certificate.found_mm);
  const bool is_smoothed = certificate.reference == MeshCertificate::Reference::kSmoothed;
  return is_smoothed ? simplified + mesh.displacement_mm.max : simplified;
}

std::optional<DicomSegment> segment_of(const DicomIdentity& identity, const Document& document) {
  if (!document.segment) return std::nullopt;
  if (auto known = find_segment(identity, *document.segment)) return known;
  DicomSegment uncoded;
  uncoded.label = *document.segment;
  return uncoded;
}

void copy(const store::BlobReader& from, const Document& document, store::BlobWriter& to) {
  std::vector<std::byte> buffer(std::size_t{1} << 20);
  for (std::uint64_t at = 0; at < document.bytes;) {
    const auto piece =
        std::span(buffer).first(std::min<std::uint64_t>(buffer.size(), document.bytes - at));
    const std::size_t count = from.read_at(document.offset + at, piece);
    if (count == 0) throw Error(ErrorCode::kInternal, "a stored mesh became shorter");
    to.write(piece.first(count));
    at += count;
  }
}

void write(const std::string& text, store::BlobWriter& to) {
  to.write(std::as_bytes(std::span(text)));
}

// The documents that the order sends. Throws if the surface is empty.
std::vector<Document> documents_of(const store::OrderRecord& record, const Job& job,
                                   const store::BlobStore& blobs) {
  std::vector<Document> documents;
  if (job.mesh && job.mesh->triangles > 0) {
    if (is_sent_as(record, SendFormat::kStl)) documents = stl_documents(job, blobs);
    if (is_sent_as(record, SendFormat::kObj)) {
      std::ranges::move(obj_documents(job, blobs), std::back_inserter(documents));
    }
    const bool has_others =
        is_sent_as(record, SendFormat::kSr) || is_sent_as(record, SendFormat::kSeg);
    if (!documents.empty() || has_others) return documents;
  }
  throw empty_surface(job.mesh.value_or(MeshSummary{}), "");
}

dicom::DerivedObject common_of(const store::OrderRecord& record, const Making& making,
                               const MadeObject& object, const std::string& title) {
  return {.identity = record.work.identity.value(),
          .sop_instance_uid = object.sop_instance_uid,
          .series_uid = object.series_uid,
          .series_number = record.work.series_number.value_or(0),
          .title = in_short(without_backslashes(title)),
          .made = making.made,
          .station_name = making.station_name};
}

// Also sets the UIDs of `object`.
dicom::Envelope envelope_of(const store::OrderRecord& record, const Job& job,
                            const Document& document, const Making& making, MadeObject& object) {
  const DicomIdentity& identity = record.work.identity.value();
  object.format = document.format;
  object.label = document.label;
  object.sop_class_uid = dicom::sop_class_of(document.kind);
  object.series_uid = series_uid_of(identity, job, making, document.format);
  object.sop_instance_uid = instance_uid_of(object, identity, document.sha256);
  const std::string title =
      document.label ? record.work.label + ' ' + document.name : record.work.label;
  dicom::DerivedObject common = common_of(record, making, object, title);
  common.instance_number = document.number;
  return dicom::make_envelope(
      {.kind = document.kind,
       .common = std::move(common),
       .content_description = description_of(job),
       .algorithm_parameters = told_parameters(job.parameters, document.format),
       .segment = segment_of(identity, document),
       .materials_uid = document.materials_uid},
      document.size());
}

std::optional<dicom::Deviation> deviation_of(const Job& job) {
  const auto& certificate = job.mesh->certificate;
  if (!certificate) return std::nullopt;
  return dicom::Deviation{.mm = deviation_mm(*job.mesh),
                          .is_bound = certificate->bound_mm.has_value()};
}

// The bytes of the report. Also sets the UIDs of `object`.
std::string report_of(const store::OrderRecord& record, const Job& job, const Making& making,
                      const store::BlobStore& blobs, MadeObject& object) {
  const DicomIdentity& identity = record.work.identity.value();
  object.format = SendFormat::kSr;
  object.sop_class_uid = dicom::kEnhancedSrStorage;
  object.series_uid = series_uid_of(identity, job, making, object.format);
  auto surfaces = measure_surfaces(job, identity, record.work.label, blobs, making.stop);
  object.sop_instance_uid = instance_uid_of(object, identity, text_of(surfaces));
  return dicom::make_report({.common = common_of(record, making, object, record.work.label),
                             .segmented_series_uid = record.work.segmented_series,
                             .algorithm_parameters = told_parameters(job.parameters, object.format),
                             .deviation = deviation_of(job),
                             .surfaces = std::move(surfaces)});
}

[[noreturn]] void throw_too_large(std::uint64_t bytes, std::uint64_t most_bytes,
                                  const OrderWork& work) {
  std::string text = "the object has " + std::to_string(bytes) +
                     " bytes, but the PACS accepts at most " + std::to_string(most_bytes) +
                     " (max-send-bytes)";
  if (work.max_error_mm) {
    text += "; within " + number_text(*work.max_error_mm) +
            " mm of the surface (max-error-mm) it cannot be made smaller";
  }
  throw Error(ErrorCode::kTooLarge, text);
}

dicom::SegmentationObject segmentation_of(const store::OrderRecord& record, const Job& job,
                                          const Making& making, const store::BlobStore& blobs,
                                          MadeObject& object) {
  const LabelGrid& grid = making.labels.value();
  const DicomIdentity& identity = record.work.identity.value();
  std::vector<dicom::SegmentationSegment> segments;
  std::string content = "labels " + grid.samples + '\n';
  jobs::JobLabels(job, blobs).for_each([&](const LabelSummary& label) {
    if (label.voxels == 0) return;
    const std::string name = label.name.value_or("Label " + std::to_string(label.label));
    segments.push_back(
        {.label = label.label, .name = in_short(without_backslashes(name)), .color = label.color});
    content += std::to_string(label.label) + ' ' + name + ' ' + label.color.value_or("") + '\n';
  });
  object.format = SendFormat::kSeg;
  object.sop_class_uid = dicom::kSegmentationStorage;
  object.series_uid = series_uid_of(identity, job, making, object.format);
  object.sop_instance_uid = instance_uid_of(object, identity, content);
  return {.common = common_of(record, making, object, record.work.label),
          .dims = grid.dims,
          .origin = grid.origin,
          .steps = grid.steps,
          .segments = std::move(segments),
          .frames = {}};
}

// Writes the segmentation piece by piece.
MadeObject make_segmentation(const store::OrderRecord& record, const Job& job, const Making& making,
                             store::BlobWriter& writer, const store::BlobStore& blobs) {
  MadeObject object;
  dicom::SegmentationObject segmentation = segmentation_of(record, job, making, blobs, object);
  std::vector<std::int64_t> labels;
  for (const auto& segment : segmentation.segments) labels.push_back(segment.label);
  const LabelGrid& grid = *making.labels;
  segmentation.frames = frames_of(grid, labels, blobs, making.stop);
  const std::string head = dicom::segmentation_head(segmentation);
  const std::uint64_t bytes = head.size() + dicom::segmentation_pixel_bytes(segmentation);
  if (bytes > making.most_bytes) throw_too_large(bytes, making.most_bytes, record.work);
  write(head, writer);
  write_frames(grid, labels, segmentation.frames, blobs, making.stop,
               [&](std::span<const std::byte> piece) { writer.write(piece); });
  return object;
}

std::uint64_t bytes_of(const dicom::Envelope& envelope, const Document& document) {
  return envelope.before.size() + document.size() + envelope.after.size();
}

// Additional text in the object of a simplified mesh.
constexpr std::uint64_t kGrowthOfText = 400;

}  // namespace

std::string description_of(const Job& job) {
  const MeshParameters& parameters = job.parameters;
  const std::string side = parameters.inside == Inside::kBelow ? "below " : "iso ";
  const std::string what = parameters.labels ? "label"
                           : parameters.iso  ? side + to_text(*parameters.iso)
                                             : side + "otsu";
  std::string text = what + ", scheme " + std::string(to_string(parameters.scheme)) + ", " +
                     std::to_string(parameters.passes) + " passes";
  // Distance of the object's vertices and triangles from the extracted surface.
  if (job.mesh->certificate) {
    text += ", within " + number_text(rounded_up(deviation_mm(*job.mesh))) + " mm";
  }
  return in_short(text);
}

std::vector<MadeObject> make_objects(const store::OrderRecord& record, const Job& job,
                                     const Making& making, store::BlobStore& blobs,
                                     std::vector<std::string>& stored) {
  std::vector<MadeObject> objects;
  const auto commit = [&](store::BlobWriter& writer, MadeObject object) {
    object.blob = writer.commit();
    stored.push_back(object.blob.key);
    objects.push_back(std::move(object));
  };
  std::string materials_uid;
  for (Document& document : documents_of(record, job, blobs)) {
    if (document.kind == dicom::DocumentKind::kObj) document.materials_uid = materials_uid;
    MadeObject object;
    const dicom::Envelope envelope = envelope_of(record, job, document, making, object);
    if (document.kind == dicom::DocumentKind::kMtl) materials_uid = object.sop_instance_uid;
    const std::uint64_t bytes = bytes_of(envelope, document);
    if (bytes > making.most_bytes) throw_too_large(bytes, making.most_bytes, record.work);
    const auto writer = blobs.begin(record.owner);
    write(envelope.before, *writer);
    write(document.text, *writer);
    if (!document.blob.empty()) copy(*blobs.open(document.blob), document, *writer);
    write(envelope.after, *writer);
    commit(*writer, std::move(object));
  }
  if (is_sent_as(record, SendFormat::kSr)) {
    MadeObject object;
    const std::string report = report_of(record, job, making, blobs, object);
    if (report.size() > making.most_bytes) {
      throw_too_large(report.size(), making.most_bytes, record.work);
    }
    const auto writer = blobs.begin(record.owner);
    write(report, *writer);
    commit(*writer, std::move(object));
  }
  if (is_sent_as(record, SendFormat::kSeg)) {
    const auto writer = blobs.begin(record.owner);
    commit(*writer, make_segmentation(record, job, making, *writer, blobs));
  }
  return objects;
}

std::optional<std::uint32_t> triangles_that_fit(const store::OrderRecord& record, const Job& job,
                                                const Making& making,
                                                const store::BlobStore& blobs) {
  constexpr std::uint64_t kTriangleBytes = 50;
  const std::uint64_t most_bytes = making.most_bytes;
  double share = 1;
  for (const Document& document : documents_of(record, job, blobs)) {
    MadeObject object;
    const dicom::Envelope envelope = envelope_of(record, job, document, making, object);
    const std::uint64_t bytes = bytes_of(envelope, document);
    if (bytes <= most_bytes) continue;
    const std::uint64_t over = bytes - most_bytes + kGrowthOfText;
    if (over + kTriangleBytes > document.bytes) throw_too_large(bytes, most_bytes, record.work);
    share = std::min(
        share, static_cast<double>(document.bytes - over) / static_cast<double>(document.bytes));
  }
  if (share == 1) return std::nullopt;
  // With labels, the largest one must fit, and simplification may keep a larger fraction of it than
  // of all labels together.
  constexpr double kOfLabels = 0.95;
  if (job.parameters.labels) share *= kOfLabels;
  return std::max<std::uint32_t>(
      1, static_cast<std::uint32_t>(share * static_cast<double>(job.mesh->triangles)));
}

bool can_make_objects(const Job& job, const store::BlobStore& blobs, const std::stop_token& stop) {
  if (!job.mesh) return true;
  const auto is_intact = [&](const std::string& key) {
    return store::is_there_and_intact(blobs, key, stop);
  };
  const auto& list = job.mesh->label_list;
  return (!list || is_intact(list->sha256)) &&
         std::ranges::all_of(job.mesh->files, [&](const auto& file) {
           const auto& [format, entry] = file;
           const bool is_used = format == MeshFormat::kStl || format == MeshFormat::kObj ||
                                format == MeshFormat::kZip;
           return !is_used || is_intact(entry.sha256);
         });
}

}  // namespace isomesh::orders
