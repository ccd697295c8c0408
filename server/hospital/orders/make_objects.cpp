#include "server/hospital/orders/make_objects.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "base/text.h"
#include "proto/error.h"
#include "proto/json.h"
#include "proto/parameters.h"
#include "server/hospital/objects/encapsulated_stl.h"
#include "server/hospital/objects/uid.h"
#include "server/jobs/library/label_pages.h"

namespace isomesh::orders {
namespace {

// The bytes of one STL file within a blob.
struct StlFile {
  std::optional<std::int64_t> label = {};
  std::string name = {};  // name of the label
  std::string blob;
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
  std::string sha256;
};

std::vector<StlFile> stl_files_of(const Job& job, const store::BlobStore& blobs) {
  std::vector<StlFile> files;
  if (!job.mesh) return files;
  const auto& stored = job.mesh->files;
  if (const auto stl = stored.find(MeshFormat::kStl); stl != stored.end()) {
    files.push_back(
        {.blob = stl->second.sha256, .bytes = stl->second.bytes, .sha256 = stl->second.sha256});
  }
  const auto zip = stored.find(MeshFormat::kZip);
  if (zip == stored.end()) return files;
  const jobs::JobLabels labels(job, blobs);
  std::vector<LabelSummary> page = labels.after(std::nullopt);
  for (; !page.empty(); page = labels.after(page.back().label)) {
    for (const LabelSummary& label : page) {
      const auto stl = label.files.find(MeshFormat::kStl);
      if (stl == label.files.end() || label.triangles == 0) continue;
      files.push_back({.label = label.label,
                       .name = label.name.value_or("Label " + std::to_string(label.label)),
                       .blob = zip->second.sha256,
                       .offset = stl->second.offset,
                       .bytes = stl->second.bytes,
                       .sha256 = stl->second.sha256});
    }
  }
  return files;
}

// Only the parameters that determine the mesh, not the other requested files.
std::string canonical_parameters(MeshParameters parameters) {
  parameters.formats = {MeshFormat::kStl};
  parameters.draco = {};
  parameters.normals = false;
  return to_json(parameters);
}

std::string series_uid_of(const DicomIdentity& identity, const Job& job) {
  return dicom::name_based_uid("series\n" + identity.study_uid + '\n' + identity.series_uid + '\n' +
                               canonical_parameters(job.parameters) + '\n' + ISOMESH_VERSION);
}

std::string instance_uid_of(const std::string& series_uid, const DicomIdentity& identity,
                            const StlFile& file) {
  std::vector<std::string> sources;
  for (const DicomInstance& instance : identity.instances) {
    sources.push_back(instance.sop_instance_uid);
  }
  std::ranges::sort(sources);
  std::string name =
      "instance\n" + series_uid + '\n' + std::string(dicom::kEncapsulatedStlStorage) + '\n';
  for (const std::string& source : sources) name += source + '\n';
  // Two labels may have the same surface.
  if (file.label) name += "label " + std::to_string(*file.label) + '\n';
  return dicom::name_based_uid(name + file.sha256);
}

// Truncates to 64 characters, the limit of LO.
std::string in_short(const std::string& text) {
  constexpr std::size_t kLongest = 64;
  if (text.size() <= kLongest) return text;
  std::size_t end = kLongest;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;
  return text.substr(0, end);
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

std::string description_of(const Job& job) {
  const MeshParameters& parameters = job.parameters;
  const std::string what = parameters.labels ? "label"
                           : parameters.iso  ? "iso " + to_text(*parameters.iso)
                                             : "iso otsu";
  std::string text = what + ", scheme " + std::string(to_string(parameters.scheme)) + ", " +
                     std::to_string(parameters.passes) + " passes";
  // Distance of the object's vertices and triangles from the extracted surface.
  if (const auto& certificate = job.mesh->certificate) {
    const double within = certificate->bound_mm.value_or(certificate->found_mm);
    text += ", within " + number_text(rounded_up(within)) + " mm";
  }
  return in_short(text);
}

std::optional<DicomSegment> segment_of(const DicomIdentity& identity, const StlFile& file) {
  if (!file.label) return std::nullopt;
  const auto found = std::ranges::find(identity.segments, *file.label, &DicomSegment::label);
  if (found != identity.segments.end()) return *found;
  DicomSegment uncoded;
  uncoded.label = *file.label;
  return uncoded;
}

void copy(const store::BlobReader& from, const StlFile& file, store::BlobWriter& to) {
  std::vector<std::byte> buffer(std::size_t{1} << 20);
  for (std::uint64_t at = 0; at < file.bytes;) {
    const auto piece =
        std::span(buffer).first(std::min<std::uint64_t>(buffer.size(), file.bytes - at));
    const std::size_t count = from.read_at(file.offset + at, piece);
    if (count == 0) throw Error(ErrorCode::kInternal, "a stored mesh became shorter");
    to.write(piece.first(count));
    at += count;
  }
}

void write(const std::string& text, store::BlobWriter& to) {
  to.write(std::as_bytes(std::span(text)));
}

// Throws if there is none.
std::vector<StlFile> files_of_surface(const Job& job, const store::BlobStore& blobs) {
  std::vector<StlFile> files = stl_files_of(job, blobs);
  if (job.mesh && job.mesh->triangles > 0 && !files.empty()) return files;
  throw Error(ErrorCode::kUnusableVolume, "the surface is empty");
}

// Also sets the UIDs of `object`.
dicom::StlEnvelope envelope_of(const store::OrderRecord& record, const Job& job,
                               const StlFile& file, const std::string& station_name,
                               std::chrono::system_clock::time_point made, MadeObject& object) {
  const DicomIdentity& identity = record.work.identity.value();
  object.label = file.label;
  object.series_uid = series_uid_of(identity, job);
  object.sop_instance_uid = instance_uid_of(object.series_uid, identity, file);
  const std::string title = file.label ? record.work.label + ' ' + file.name : record.work.label;
  return dicom::make_envelope(
      {.identity = identity,
       .series_uid = object.series_uid,
       .sop_instance_uid = object.sop_instance_uid,
       .series_number = record.work.series_number.value_or(0),
       .title = in_short(without_backslashes(title)),
       .made = made,
       .station_name = station_name,
       .content_description = description_of(job),
       .algorithm_parameters = without_backslashes(canonical_parameters(job.parameters)),
       .segment = segment_of(identity, file)},
      file.bytes);
}

std::uint64_t bytes_of(const dicom::StlEnvelope& envelope, const StlFile& file) {
  return envelope.before.size() + file.bytes + envelope.after.size();
}

// Additional text in the object of a simplified mesh.
constexpr std::uint64_t kGrowthOfText = 400;

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

}  // namespace

Error empty_surface(const MeshSummary& mesh, const std::array<double, 2>& range) {
  const auto because = [](const std::string& why) {
    return Error(ErrorCode::kUnusableVolume, "the surface is empty: " + why);
  };
  if (mesh.dropped.components > 0) return because("none of its connected components was kept");
  if (!mesh.iso) return because("the labels have no boundary");
  const auto [low, high] = range;
  const std::string iso = "the iso-value " + number_text(*mesh.iso);
  const std::string samples =
      "the samples, which range from " + number_text(low) + " to " + number_text(high);
  const bool is_outside = *mesh.iso <= low || *mesh.iso > high;
  return because(iso + (is_outside ? " is outside " : " separates none of ") + samples);
}

std::vector<MadeObject> make_objects(const store::OrderRecord& record, const Job& job,
                                     const std::string& station_name, std::uint64_t most_bytes,
                                     std::chrono::system_clock::time_point made,
                                     store::BlobStore& blobs) {
  std::vector<MadeObject> objects;
  for (const StlFile& file : files_of_surface(job, blobs)) {
    MadeObject object;
    const dicom::StlEnvelope envelope = envelope_of(record, job, file, station_name, made, object);
    const std::uint64_t bytes = bytes_of(envelope, file);
    if (bytes > most_bytes) throw_too_large(bytes, most_bytes, record.work);
    const auto writer = blobs.begin();
    write(envelope.before, *writer);
    copy(*blobs.open(file.blob), file, *writer);
    write(envelope.after, *writer);
    object.blob = writer->commit();
    objects.push_back(std::move(object));
  }
  return objects;
}

std::optional<std::uint32_t> triangles_that_fit(const store::OrderRecord& record, const Job& job,
                                                const std::string& station_name,
                                                std::uint64_t most_bytes,
                                                const store::BlobStore& blobs) {
  constexpr std::uint64_t kTriangleBytes = 50;
  double share = 1;
  for (const StlFile& file : files_of_surface(job, blobs)) {
    MadeObject object;
    const dicom::StlEnvelope envelope = envelope_of(record, job, file, station_name, {}, object);
    const std::uint64_t bytes = bytes_of(envelope, file);
    if (bytes <= most_bytes) continue;
    const std::uint64_t over = bytes - most_bytes + kGrowthOfText;
    if (over + kTriangleBytes > file.bytes) throw_too_large(bytes, most_bytes, record.work);
    share =
        std::min(share, static_cast<double>(file.bytes - over) / static_cast<double>(file.bytes));
  }
  if (share == 1) return std::nullopt;
  // With labels, the largest one must fit, and simplification may keep a larger fraction of it than
  // of all labels together.
  constexpr double kOfLabels = 0.95;
  if (job.parameters.labels) share *= kOfLabels;
  return std::max<std::uint32_t>(
      1, static_cast<std::uint32_t>(share * static_cast<double>(job.mesh->triangles)));
}

bool can_make_objects(const Job& job, const store::BlobStore& blobs) {
  if (!job.mesh) return true;
  const auto is_intact = [&](const std::string& key) {
    return store::is_there_and_intact(blobs, key, {});
  };
  const auto& list = job.mesh->label_list;
  return (!list || is_intact(list->sha256)) &&
         std::ranges::all_of(job.mesh->files, [&](const auto& file) {
           const auto& [format, entry] = file;
           return (format != MeshFormat::kStl && format != MeshFormat::kZip) ||
                  is_intact(entry.sha256);
         });
}

}  // namespace isomesh::orders
