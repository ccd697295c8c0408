// Requests and responses of the HTTP API as C++ values. json.h has their JSON, openapi.yaml the
// contract. Plain values: safe to copy and to read from several threads.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/error.h"
#include "proto/labels.h"
#include "proto/mesh_summary.h"
#include "proto/notes.h"
#include "proto/parameters.h"
#include "proto/stages.h"

namespace isomesh {

// Stored little-endian.
enum class SampleType {
  kUint8,
  kInt8,
  kUint16,
  kInt16,
  kUint32,
  kInt32,
  kFloat32,
  kFloat64,
};

std::size_t bytes_per_sample(SampleType type);
bool is_integer(SampleType type);

// True for text in the form of all ids of the API: 1 to 64 ASCII letters, digits and hyphens, with
// no hyphen first. So an id is one word of a shell and no option, and can be in a file's name.
bool is_id(std::string_view text);

// The position of sample (i,j,k) is origin + direction * diag(spacing) * (i,j,k), in millimetres,
// LPS. `direction` is row-major; its columns are the unit vectors of the axes i, j, k.
struct Geometry {
  std::array<double, 3> origin = {0, 0, 0};
  std::array<double, 3> spacing = {1, 1, 1};
  std::array<double, 9> direction = {1, 0, 0, 0, 1, 0, 0, 0, 1};

  bool operator==(const Geometry&) const = default;
};

// A request's description of raw samples, which have no header.
struct RawDescription {
  std::array<std::uint32_t, 3> dims = {0, 0, 0};
  SampleType type = SampleType::kUint8;
  Geometry geometry;
  bool big_endian = false;

  bool operator==(const RawDescription&) const = default;
};

struct Preset {
  std::string name;
  double iso = 0;  // in the volume's units

  bool operator==(const Preset&) const = default;
};

// An object of an upload that is not part of the volume.
struct IgnoredObject {
  std::string name;  // of the file or archive member, without folders
  std::string reason;

  bool operator==(const IgnoredObject&) const = default;
};

// A DICOM object that contributed samples.
struct DicomInstance {
  std::string sop_class_uid;
  std::string sop_instance_uid;

  bool operator==(const DicomInstance&) const = default;
};

// An entry of a coding scheme (PS3.3, 8.8); empty if nothing was coded.
struct DicomCode {
  std::string value;
  std::string scheme;
  std::string meaning;

  bool operator==(const DicomCode&) const = default;
};

// A segment's number and codes.
struct DicomSegment {
  std::int64_t label = 0;  // the segment's number, and its label in the volume
  DicomCode category;      // such as "Anatomical Structure"
  DicomCode type;          // such as "Liver"
  DicomCode region;        // anatomic region, if coded separately

  bool operator==(const DicomSegment&) const = default;
};

struct DicomEquipment {
  std::string manufacturer;
  std::string model_name;
  std::string station_name;
  std::string device_serial_number;
  std::string software_versions;

  bool operator==(const DicomEquipment&) const = default;
};

// The patient and the source images of a volume, as DICOM tells them, in UTF-8; unknown members are
// empty. A mesh needs them to be stored in a PACS. Only for the volume's owner, and never in a log.
struct DicomIdentity {
  std::string patient_name;
  std::string patient_id;
  std::string patient_birth_date;
  std::string patient_sex;
  std::string study_uid;
  std::string study_date;
  std::string study_time;
  std::string study_id;
  std::string study_description;
  std::string accession_number;
  std::string referring_physician;
  std::string series_uid;
  std::string series_description;
  std::string modality;
  std::string frame_of_reference_uid;
  std::vector<DicomInstance> instances;  // in the order of the slices
  std::string issuer_of_patient_id;
  std::string patient_identity_removed;  // "YES", "NO" or empty
  std::string deidentification_method;
  std::string acquisition_datetime;
  std::string position_reference_indicator;
  DicomEquipment equipment;
  std::vector<DicomSegment> segments;  // of a segmentation, ascending

  bool operator==(const DicomIdentity&) const = default;
};

// The modalities that an upload may say of a file that has none: samples are Hounsfield units.
enum class SaidModality { kCt };

// The two transformations of a NIfTI header.
enum class NiftiForm { kSform, kQform };

struct Volume {
  // Hex digest of what the upload says: samples and all else but facts of its files: name, format,
  // order of axes and what was ignored.
  std::string id;
  // Hex SHA-256 of samples and geometry. Volumes with the same ones share their bytes and meshes.
  std::string samples;
  // Initially the name of the uploaded series or file; the owner may rename it. May name a patient,
  // so it is in no log. UTF-8; empty if unknown.
  std::optional<std::string> name = {};
  std::string format;                             // of the upload; see proto/volume_formats.h
  std::array<std::uint32_t, 3> dims = {0, 0, 0};  // samples along x, y, z; x runs fastest
  SampleType type = SampleType::kUint8;
  Geometry geometry;
  // The directions in which the first, second and third index of the uploaded file increase, such
  // as "RAS". The volume's own are in the canonical order (volume/geometry.h). Empty for volumes of
  // before it was told.
  std::optional<std::string> stored_axes = {};
  std::array<double, 2> range = {0, 0};  // smallest and largest sample
  double suggested_iso = 0;              // Otsu's threshold
  std::uint64_t bytes = 0;               // of the samples
  std::string created;                   // RFC 3339, UTC
  std::optional<std::string> modality;   // DICOM's: "CT", "MR", ...; empty if unknown
  std::vector<Preset> presets;           // within `range`
  std::vector<IgnoredObject> ignored;
  // Decisions, corrections and assumptions of the import, each code once.
  std::vector<Note> notes = {};
  std::optional<DicomIdentity> dicom;  // if it came as DICOM
  // The labels that the upload declares, ascending, at most kMostLabels. In records and import
  // results, never in responses (json.h).
  std::vector<LabelEntry> labels = {};
  static constexpr std::size_t kMostLabels = 65535;

  std::uint64_t sample_count() const { return std::uint64_t{dims[0]} * dims[1] * dims[2]; }
  bool operator==(const Volume&) const = default;
};

struct UploadedVolume {
  std::string member;
  int status = 0;  // as for a single upload: 201, 200, or the problem's
  std::optional<Volume> volume = {};
  std::optional<Problem> problem = {};

  bool operator==(const UploadedVolume&) const = default;
};

// Databases contain the numbers, so a new one comes last.
enum class JobState { kQueued, kRunning, kSucceeded, kFailed, kCancelled };

// The reason, beside busy workers, that a job is still queued.
enum class WaitingFor { kDisk };  // space for its files

// True for the three states that a job does not leave again.
bool is_final(JobState state);

// The path of a job's mesh, or of one label's file, on its server.
std::string mesh_path(const std::string& job, MeshFormat format,
                      std::optional<std::int64_t> label = std::nullopt);

struct Job {
  std::string id;
  JobState state = JobState::kQueued;
  Stage stage = Stage::kQueue;
  double progress = 0;  // 0..1 over the whole job
  JobParameters parameters;
  std::string created;  // RFC 3339, UTC
  std::optional<std::string> started;
  std::optional<std::string> finished;
  Timing timing;
  std::optional<MeshSummary> mesh;
  std::optional<Problem> error;
  bool reused = false;  // took the mesh of an equal job
  std::optional<WaitingFor> waiting_for = {};

  bool operator==(const Job&) const = default;
};

// A volume's sample values in bins of equal width over its range.
struct Histogram {
  std::string volume;
  std::array<double, 2> range = {0, 0};  // start of the first bin and end of the last
  std::vector<std::uint64_t> counts;

  bool operator==(const Histogram&) const = default;
};

// The expected result and cost of a job with these parameters.
struct Estimate {
  struct Queue {
    std::uint64_t queued = 0;
    std::uint64_t running = 0;

    bool operator==(const Queue&) const = default;
  };

  // One label's own surface.
  struct Label {
    std::int64_t label = 0;
    std::uint64_t triangles = 0;  // exact

    bool operator==(const Label&) const = default;
  };

  std::string volume;
  std::optional<double> iso = {};  // also if it is Otsu's threshold; none by labels
  SchemeName scheme = SchemeName::kSix;
  std::uint64_t triangles = 0;  // exact, like `vertices`, for the surface as extracted
  std::uint64_t vertices = 0;
  // The approximate number after simplification, if the job asks for it.
  std::optional<std::uint64_t> simplified_triangles = {};
  std::map<MeshFormat, std::uint64_t> bytes;
  std::uint64_t memory_bytes = 0;  // the job's peak, without its mapped volume
  bool fits = false;               // true if one job may use that much memory
  double milliseconds = 0;         // of the run, without the time in the queue
  Queue queue;
  // Ascending, of a job by labels; only their number above MeshSummary::kMostListedLabels.
  std::vector<Label> labels = {};
  std::optional<std::uint64_t> labels_count = {};

  bool operator==(const Estimate&) const = default;
};

// A job's progress, as a stream of events reports it.
struct JobEvent {
  JobState state = JobState::kQueued;
  Stage stage = Stage::kQueue;
  double progress = 0;

  bool operator==(const JobEvent&) const = default;
};

// The API's names of the values.
std::string_view to_string(SampleType value);
std::string_view to_string(SaidModality value);
std::string_view to_string(NiftiForm value);
std::string_view to_string(SchemeName value);
std::string_view to_string(Inside value);
std::string_view to_string(Interpolation value);
std::string_view to_string(Smoothing value);
std::string_view to_string(MeshFormat value);
std::string_view to_string(GlbCodec value);
std::string_view to_string(Space value);
std::string_view to_string(Priority value);
std::string_view to_string(JobState value);
std::string_view to_string(Stage value);
std::string_view to_string(WaitingFor value);
std::string_view to_string(Simplification::Bound value);
std::string_view to_string(MeshCertificate::Reference value);

// The inverse; empty for an unknown name. types.cpp instantiates these templates.
template <class Enum>
std::optional<Enum> from_string(std::string_view name);

template <class Enum>
std::vector<Enum> values_of();

template <class Enum>
std::vector<std::string> name_list() {
  std::vector<std::string> names;
  for (const Enum value : values_of<Enum>()) names.emplace_back(to_string(value));
  return names;
}

// All names of an enumeration as prose: `"stat", "routine" or "bulk"`.
template <class Enum>
std::string names_of();

}  // namespace isomesh
