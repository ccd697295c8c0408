// Requests and answers of the HTTP API as C++ values. Their JSON is in json.h; the contract that
// both follow is openapi.yaml. Plain values: safe to copy and to read from several threads.
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

namespace isomesh {

// The type of one sample as it is stored, little-endian.
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

// Where the samples lie: sample (i,j,k) is at origin + direction * diag(spacing) * (i,j,k), in
// millimetres, in DICOM's patient space (LPS). `direction` is row-major, its columns are the unit
// vectors of the axes i, j, k.
struct Geometry {
  std::array<double, 3> origin = {0, 0, 0};
  std::array<double, 3> spacing = {1, 1, 1};
  std::array<double, 9> direction = {1, 0, 0, 0, 1, 0, 0, 0, 1};

  bool operator==(const Geometry&) const = default;
};

// What a request says about raw samples, which say nothing about themselves.
struct RawDescription {
  std::array<std::uint32_t, 3> dims = {0, 0, 0};
  SampleType type = SampleType::kUint8;
  Geometry geometry;
  bool big_endian = false;

  bool operator==(const RawDescription&) const = default;
};

// An iso-value that is known to suit volumes of a kind.
struct Preset {
  std::string name;
  double iso = 0;  // in the volume's units

  bool operator==(const Preset&) const = default;
};

// Something in an upload that is no part of the volume.
struct IgnoredObject {
  std::string name;  // of the file or archive member, without folders
  std::string reason;

  bool operator==(const IgnoredObject&) const = default;
};

// A DICOM object that samples came from.
struct DicomInstance {
  std::string sop_class_uid;
  std::string sop_instance_uid;

  bool operator==(const DicomInstance&) const = default;
};

// An entry of a coding scheme (PS3.3, 8.8); empty where nothing was coded.
struct DicomCode {
  std::string value;
  std::string scheme;
  std::string meaning;

  bool operator==(const DicomCode&) const = default;
};

// What a segment of a segmentation is, by its codes.
struct DicomSegment {
  std::int64_t label = 0;  // the volume's label that it became: its number
  DicomCode category;      // such as "Anatomical Structure"
  DicomCode type;          // such as "Liver"
  DicomCode region;        // where it lies, where that is told besides

  bool operator==(const DicomSegment&) const = default;
};

// The device that made the images.
struct DicomEquipment {
  std::string manufacturer;
  std::string model_name;
  std::string station_name;
  std::string device_serial_number;
  std::string software_versions;

  bool operator==(const DicomEquipment&) const = default;
};

// Whose volume it is and what it was made from, as DICOM tells it, in UTF-8; empty where it does
// not tell. What a mesh needs to be sent back with. Only for the volume's owner, and never in a
// log.
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
  std::string patient_identity_removed;  // "YES" or "NO" where it is told
  std::string deidentification_method;
  std::string acquisition_datetime;
  std::string position_reference_indicator;
  DicomEquipment equipment;
  std::vector<DicomSegment> segments;  // of a segmentation, ascending

  bool operator==(const DicomIdentity&) const = default;
};

// The two ways in which a NIfTI header may say where its samples lie.
enum class NiftiForm { kSform, kQform };

struct Volume {
  std::string id;  // hex SHA-256 of the canonical samples and geometry
  // What its owner calls it: the series or file that it came as, until it is renamed. May name a
  // patient, so it is in no log. UTF-8; empty where nothing told one.
  std::optional<std::string> name = {};
  std::string format;  // what was uploaded: "raw", "nifti", "nrrd", "metaimage", "dicom"
  std::array<std::uint32_t, 3> dims = {0, 0, 0};  // samples along x, y, z; x runs fastest
  SampleType type = SampleType::kUint8;
  Geometry geometry;
  std::array<double, 2> range = {0, 0};  // smallest and largest sample
  double suggested_iso = 0;              // Otsu's threshold
  std::uint64_t bytes = 0;               // of the samples
  std::string created;                   // RFC 3339, UTC
  std::optional<std::string> modality;   // DICOM's: "CT", "MR", ...; empty when it is not told
  std::vector<Preset> presets;           // within `range`
  std::vector<IgnoredObject> ignored;
  // What was decided, corrected or left open when the upload was read; each code once. Of the
  // upload that came first, as all but samples and geometry is.
  std::vector<Note> notes = {};
  std::optional<DicomIdentity> dicom;  // of a volume that came as DICOM
  // What the upload told of its labels, ascending, at most kMostLabels. In records and in what an
  // import tells, never in answers (json.h).
  std::vector<LabelEntry> labels = {};
  static constexpr std::size_t kMostLabels = 65535;

  std::uint64_t sample_count() const { return std::uint64_t{dims[0]} * dims[1] * dims[2]; }
  bool operator==(const Volume&) const = default;
};

// What became of one volume of an upload that holds several.
struct UploadedVolume {
  std::string member;  // of the archive
  int status = 0;      // as if it had come alone: 201, 200, or that of the problem
  std::optional<Volume> volume = {};
  std::optional<Problem> problem = {};

  bool operator==(const UploadedVolume&) const = default;
};

enum class Scheme { kFive = 5, kSix = 6 };  // tetrahedra per cell
enum class Interpolation { kLinear, kMidpoint };
enum class Smoothing { kLaplacian, kTaubin };
enum class GlbCodec { kDraco, kMeshopt };  // KHR_draco_mesh_compression, EXT_meshopt_compression
enum class Space { kLps, kRas };           // which ways x, y and z of a file's coordinates run
enum class Priority { kStat, kRoutine, kBulk };  // claimed in this order

struct DracoParameters {
  int position_bits = 14;  // per coordinate
  int speed = 7;           // 0 smallest .. 10 fastest

  bool operator==(const DracoParameters&) const = default;
};

// Which parts of the surface a job keeps. All when empty; with several members, those nearest to
// the places that are large enough, and the largest of them.
struct ComponentFilter {
  std::optional<std::uint32_t> keep;              // so many of the largest; at least 1
  std::optional<std::uint32_t> min_triangles;     // those of so many triangles; at least 1
  std::vector<std::array<double, 3>> nearest_to;  // those at these places, in mm, LPS
  static constexpr std::size_t kMostPlaces = 1000;

  bool keeps_all() const { return !keep && !min_triangles && nearest_to.empty(); }
  bool operator==(const ComponentFilter&) const = default;
};

// A box along the axes of LPS: its smallest and its largest corner, in millimetres.
using Box = std::array<std::array<double, 3>, 2>;

// Whom to tell that a job has ended.
struct Callback {
  std::string url;

  bool operator==(const Callback&) const = default;
};

// What determines a mesh's bytes beside its volume, and nothing else: files carry it, and jobs that
// agree in it share their result. What each member means and may be is in parameters.h.
struct MeshParameters {
  std::optional<double> iso;  // in the volume's units; empty: Otsu's threshold
  Scheme scheme = Scheme::kSix;
  Interpolation interpolation = Interpolation::kLinear;
  bool regularize = false;
  int passes = 5;
  Smoothing smoothing = Smoothing::kLaplacian;
  std::optional<double> lambda;               // empty: default_lambda(smoothing)
  double pass_band = 0.1;                     // of Taubin's smoothing
  std::optional<double> max_displacement_mm;  // empty: no vertex is held back
  bool close = false;
  ComponentFilter components;
  std::vector<MeshFormat> formats = {MeshFormat::kDrc};
  DracoParameters draco;
  bool normals = true;     // in glb
  bool distances = false;  // in glb: each vertex's to the surface as it was extracted
  // How far the files may be from the surface as it was extracted; empty: as far as the other
  // parameters let them.
  std::optional<double> max_error_mm = {};
  std::optional<std::uint32_t> triangles = {};  // at most so many; empty: all
  std::vector<double> lods = {};  // in glb: levels of detail, as shares of the triangles
  static constexpr std::size_t kMostLods = 8;
  bool merge = false;  // in glb: one primitive for each surface and level
  GlbCodec glb_codec = GlbCodec::kDraco;
  Space space = Space::kLps;     // of files whose format leaves it open
  std::optional<Box> crop = {};  // empty: the whole volume
  bool fill_cavities = false;
  // Of a job by labels, which has no iso-value and no interpolation: its vertices lie half-way.
  // label_parameters() has its defaults.
  std::optional<LabelChoice> labels = {};
  std::int64_t background = 0;  // the value of what is no label
  LabelTexts label_names = {};
  LabelTexts label_colors = {};   // "#rrggbb"
  LabelValues label_values = {};  // of labels that are more than the samples of their own value

  bool operator==(const MeshParameters&) const = default;
};

// What a job is asked to do: a mesh of a volume, when, and whom to tell.
struct JobParameters : MeshParameters {
  std::string volume;
  Priority priority = Priority::kRoutine;
  std::optional<Callback> callback = {};
  bool certify = false;  // measures how far the files are from the surface as it was extracted

  bool operator==(const JobParameters&) const = default;
};

// A job by labels with the defaults that such a job has; those of a job at an iso-value are the
// structure's own.
JobParameters label_parameters(LabelChoice labels);

// The space of the coordinates in a file of that format: GIFTI's is RAS, GLB has its own node for
// it, and the others follow the parameter.
Space space_of(MeshFormat format, const MeshParameters& parameters);

// Whether one file of that format holds all labels.
bool holds_all_labels(MeshFormat format);

// The files that a job makes, in order: its formats; of a job by labels those that hold all labels,
// and a ZIP of the others.
std::vector<MeshFormat> files_of(const MeshParameters& parameters);

// The formats of the files in a ZIP of labels, in order.
std::vector<MeshFormat> zipped_formats(const MeshParameters& parameters);

// The share of the way to the mean of its neighbours that a vertex goes, unless the client says.
double default_lambda(Smoothing smoothing);
double default_lambda(const MeshParameters& parameters);  // which labels have a say in

enum class JobState { kQueued, kRunning, kSucceeded, kFailed, kCancelled };
enum class Stage { kQueue, kLoad, kExtract, kSmooth, kSimplify, kEncode, kCertify, kDone };

// What a queued job waits for besides a worker.
enum class WaitingFor { kDisk };  // room for its files

// True for the three states that a job does not leave again.
bool is_final(JobState state);

// The path of a job's mesh, or of one of its labels, on its server.
std::string mesh_path(const std::string& job, MeshFormat format,
                      std::optional<std::int64_t> label = std::nullopt);

// Wall-clock milliseconds of each stage; a stage that has not run yet is 0.
struct Timing {
  double queue = 0;
  double load = 0;
  double extract = 0;
  double smooth = 0;
  double simplify = 0;
  double encode = 0;
  double certify = 0;
  double total = 0;  // from acceptance to the end

  bool operator==(const Timing&) const = default;
};

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
  std::optional<MeshSummary> mesh;  // of a job that succeeded
  std::optional<Problem> error;     // of a job that failed
  bool reused = false;              // took the mesh of a job like it instead of making one
  std::optional<WaitingFor> waiting_for = {};

  bool operator==(const Job&) const = default;
};

// How often samples have which values: bins of equal width over the volume's range.
struct Histogram {
  std::string volume;
  std::array<double, 2> range = {0, 0};  // where the first bin begins and the last one ends
  std::vector<std::uint64_t> counts;     // of each bin

  bool operator==(const Histogram&) const = default;
};

// What a job with these parameters would make and take.
struct Estimate {
  struct Queue {
    std::uint64_t queued = 0;
    std::uint64_t running = 0;

    bool operator==(const Queue&) const = default;
  };

  // Of one label's own surface.
  struct Label {
    std::int64_t label = 0;
    std::uint64_t triangles = 0;  // exact

    bool operator==(const Label&) const = default;
  };

  std::string volume;
  std::optional<double> iso = {};  // Otsu's threshold where that was asked for; none by labels
  Scheme scheme = Scheme::kSix;
  std::uint64_t triangles = 0;  // exact, as `vertices`, of the surface as it is extracted
  std::uint64_t vertices = 0;
  // About how many are left where the job asks for fewer, by an error or a number.
  std::optional<std::uint64_t> simplified_triangles = {};
  std::map<MeshFormat, std::uint64_t> bytes;  // of each file
  std::uint64_t memory_bytes = 0;             // at the job's peak, beside its mapped volume
  bool fits = false;                          // whether one job may take that much
  double milliseconds = 0;                    // of the run, without the time in the queue
  Queue queue;
  std::vector<Label> labels = {};  // ascending; of a job by labels

  bool operator==(const Estimate&) const = default;
};

// How far a job is, as a stream of events tells it.
struct JobEvent {
  JobState state = JobState::kQueued;
  Stage stage = Stage::kQueue;
  double progress = 0;

  bool operator==(const JobEvent&) const = default;
};

// The names that the API uses for the values of the enumerations above.
std::string_view to_string(SampleType value);
std::string_view to_string(NiftiForm value);
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

// The inverse: empty for a name that is none of them.
template <class Enum>
std::optional<Enum> from_string(std::string_view name);

extern template std::optional<SampleType> from_string(std::string_view);
extern template std::optional<NiftiForm> from_string(std::string_view);
extern template std::optional<Interpolation> from_string(std::string_view);
extern template std::optional<Smoothing> from_string(std::string_view);
extern template std::optional<MeshFormat> from_string(std::string_view);
extern template std::optional<GlbCodec> from_string(std::string_view);
extern template std::optional<Space> from_string(std::string_view);
extern template std::optional<Priority> from_string(std::string_view);
extern template std::optional<JobState> from_string(std::string_view);
extern template std::optional<Stage> from_string(std::string_view);
extern template std::optional<WaitingFor> from_string(std::string_view);
extern template std::optional<Simplification::Bound> from_string(std::string_view);

// All values that have a name, in the order of the contract.
template <class Enum>
std::vector<Enum> values_of();

extern template std::vector<NiftiForm> values_of();
extern template std::vector<Interpolation> values_of();
extern template std::vector<Smoothing> values_of();
extern template std::vector<MeshFormat> values_of();
extern template std::vector<GlbCodec> values_of();
extern template std::vector<Space> values_of();
extern template std::vector<Priority> values_of();

// All names of an enumeration as a person reads them: `"stat", "routine" or "bulk"`.
template <class Enum>
std::string names_of();

extern template std::string names_of<NiftiForm>();
extern template std::string names_of<SampleType>();
extern template std::string names_of<Interpolation>();
extern template std::string names_of<Smoothing>();
extern template std::string names_of<MeshFormat>();
extern template std::string names_of<GlbCodec>();
extern template std::string names_of<Space>();
extern template std::string names_of<Priority>();
extern template std::string names_of<JobState>();
extern template std::string names_of<WaitingFor>();

}  // namespace isomesh
