// The library behind Python's isomesh_kernels, which calls it through ctypes: a C interface, so
// that one build serves every version of Python. library.py declares the same functions and
// structures.
//
// isomesh_start copies everything but the samples, which must live until isomesh_wait returns true.
// Each run has a thread of its own. Functions on one run are not to be called at the same time,
// except isomesh_cancel.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/mutex.h"
#include "proto/empty_surface.h"
#include "proto/error.h"
#include "proto/json.h"
#include "proto/types.h"
#include "server/codec/label_titles.h"
#include "server/import/source/ct_presets.h"
#include "server/jobs/library/defaults.h"
#include "server/jobs/making/make_mesh.h"
#include "server/jobs/making/make_samples.h"
#include "server/jobs/making/sample_array.h"
#include "server/jobs/making/stage_times.h"
#include "server/mesh/labels/label_surface.h"
#include "server/mesh/mesh.h"
#include "server/mesh/parallel.h"
#include "server/volume/geometry.h"
#include "server/volume/statistics.h"

// NOLINTBEGIN(readability-identifier-naming): names of C
extern "C" {

// `dims` are the samples along x, y and z, of which x runs fastest. Geometry is as in
// isomesh::Geometry.
struct isomesh_volume {
  const void* samples;
  const char* type;  // as in the API: "uint8"
  std::uint32_t dims[3];
  double origin[3];
  double spacing[3];
  double direction[9];
  std::uint64_t
      left_out;  // copies of the smallest sample that stand for others, for Otsu's threshold
  std::uint64_t memory_bytes;
  std::int32_t is_ct;
};

// Arrays are owned by the run. Labels and colours are null for a mesh at an iso-value: a label for
// each triangle, and red, green and blue for each vertex.
struct isomesh_made {
  const float* vertices;
  const std::uint32_t* triangles;
  const std::int64_t* labels;
  const std::uint8_t* colors;
  std::uint64_t vertex_count;
  std::uint64_t triangle_count;
  const char* job;    // JSON, as the API tells it, in full
  const char* error;  // the sentence, or null
  const char* kind;   // of the error: the end of a problem's type
};
}
// NOLINTEND(readability-identifier-naming)

namespace {

using namespace isomesh;

template <class T, std::size_t count>
std::array<T, count> array_of(const T (&values)[count]) {
  return std::to_array(values);
}

Geometry geometry_of(const isomesh_volume& volume) {
  return {array_of(volume.origin), array_of(volume.spacing), array_of(volume.direction)};
}

// Every label's own surface, one after the other, as a PLY file has them.
struct LabelArrays {
  mesh::Buffer<mesh::Vec3> vertices;
  mesh::Buffer<mesh::Triangle> triangles;
  mesh::Buffer<std::int64_t> labels;
  mesh::Buffer<std::array<std::uint8_t, 3>> colors;

  LabelArrays(const mesh::SeparatingSurface& walls, const std::vector<LabelSummary>& summaries) {
    reserve(summaries);
    const auto surfaces = label_surfaces(walls, {});
    std::size_t vertex = 0;
    std::size_t triangle = 0;
    for (std::size_t n = 0; n < summaries.size(); ++n) {
      const mesh::Mesh& own = surfaces[n].mesh;
      const auto first = static_cast<std::uint32_t>(vertex);
      const auto corners = [first](const mesh::Triangle& each) {
        return mesh::Triangle{first + each[0], first + each[1], first + each[2]};
      };
      std::ranges::copy(own.positions, vertices.begin() + vertex);
      std::ranges::transform(own.triangles, triangles.begin() + triangle, corners);
      std::fill_n(labels.begin() + triangle, own.triangles.size(), summaries[n].label);
      std::fill_n(colors.begin() + vertex, own.positions.size(), bytes_of(summaries[n]));
      vertex += own.positions.size();
      triangle += own.triangles.size();
    }
  }

 private:
  static std::array<std::uint8_t, 3> bytes_of(const LabelSummary& label) {
    std::array<std::uint8_t, 3> bytes;
    std::ranges::transform(codec::color_of(label), bytes.begin(), [](double channel) {
      return static_cast<std::uint8_t>(std::lround(channel * 255));
    });
    return bytes;
  }

  void reserve(const std::vector<LabelSummary>& summaries) {
    std::uint64_t vertex_count = 0;
    std::uint64_t triangle_count = 0;
    for (const LabelSummary& each : summaries) {
      vertex_count += each.vertices;
      triangle_count += each.triangles;
    }
    if (vertex_count > std::numeric_limits<std::uint32_t>::max()) {
      throw Error(ErrorCode::kTooLarge, "the labels have more vertices than 32 bits can number");
    }
    vertices.resize_for_overwrite(vertex_count);
    colors.resize_for_overwrite(vertex_count);
    triangles.resize_for_overwrite(triangle_count);
    labels.resize_for_overwrite(triangle_count);
  }
};

// Gives back what simplification left unused.
template <class T>
void fit(mesh::Buffer<T>& buffer) {
  if (buffer.capacity_bytes() <= 2 * buffer.size() * sizeof(T)) return;
  mesh::Buffer<T> smaller;
  smaller.resize_for_overwrite(buffer.size());
  std::ranges::copy(buffer, smaller.begin());
  buffer = std::move(smaller);
}

// One mesh on its way, and its arrays afterwards.
class Run {
 public:
  Run(const isomesh_volume& volume, std::string parameters)
      : given_(volume), type_(volume.type), text_(std::move(parameters)) {
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }

  // True if it has ended.
  bool wait(std::chrono::milliseconds longest, double& progress) {
    Lock lock(mutex_);
    const auto end = std::chrono::steady_clock::now() + longest;
    while (!has_ended_ && std::chrono::steady_clock::now() < end) ended_.wait_until(lock, end);
    progress = progress_;
    return has_ended_;
  }

  void cancel() { thread_.request_stop(); }

  isomesh_made made() const {
    isomesh_made made = {};
    made.job = job_.c_str();
    if (error_) {
      made.error = error_->what();
      made.kind = describe(error_->code()).name.data();
    } else if (labels_) {
      made.labels = labels_->labels.data();
      made.colors = reinterpret_cast<const std::uint8_t*>(labels_->colors.data());
      set(labels_->vertices, labels_->triangles, made);
    } else {
      set(workspace_.mesh.positions, workspace_.mesh.triangles, made);
    }
    return made;
  }

 private:
  static void set(const mesh::Buffer<mesh::Vec3>& vertices,
                  const mesh::Buffer<mesh::Triangle>& triangles, isomesh_made& made) {
    made.vertices = reinterpret_cast<const float*>(vertices.data());
    made.triangles = reinterpret_cast<const std::uint32_t*>(triangles.data());
    made.vertex_count = vertices.size();
    made.triangle_count = triangles.size();
  }

  // Every exception becomes an error here, because nothing else leaves this thread.
  void run(const std::stop_token& stop) {
    try {
      make(stop);
    } catch (const Error& error) {
      error_ = error;
    } catch (const std::bad_alloc&) {
      error_ = Error(ErrorCode::kTooLarge, "there is not enough memory for the mesh");
    } catch (const std::exception& error) {
      error_ = Error(ErrorCode::kInternal, error.what());
    }
    const Lock lock(mutex_);
    has_ended_ = true;
    ended_.notify_all();
  }

  void make(const std::stop_token& stop) {
    Volume volume = volume_of();
    const jobs::SampleArray samples = {volume.type, volume.dims, volume.geometry,
                                       static_cast<const std::byte*>(given_.samples)};
    JobParameters parameters = parse_job_parameters(text_);
    parameters.formats.clear();  // the mesh is the result
    parameters.normals = false;
    parameters.certify = false;  // which measures files
    const double iso = complete(samples, volume, parameters);
    const jobs::Report report = [this](Stage, double share, const Timing&) {
      const Lock lock(mutex_);
      progress_ = share;
    };
    jobs::Progress progress(stop, report, jobs::expected_times(volume, parameters, parameters));
    const jobs::MeshRequest request = {.volume = volume,
                                       .parameters = parameters,
                                       .iso = iso,
                                       .measures = parameters,
                                       .memory_bytes = given_.memory_bytes};
    auto made = jobs::make_from_samples(samples, request, {}, progress, workspace_);
    if (parameters.labels) {
      labels_.emplace(workspace_.walls, made.summary.labels);
      workspace_.walls = {};
    } else {
      fit(workspace_.mesh.positions);
      fit(workspace_.mesh.triangles);
    }
    progress.end_stage();
    Job job;
    job.state = JobState::kSucceeded;
    job.stage = Stage::kDone;
    job.progress = 1;
    job.parameters = std::move(parameters);
    job.timing = progress.timing();
    job.mesh = std::move(made.summary);
    if (job.mesh->empty) {
      job.mesh->empty_reason = why_empty(job.parameters, *job.mesh, values_of(samples, volume));
    }
    job_ = to_full_json(job);
  }

  SampleValues values_of(const jobs::SampleArray& samples, const Volume& volume) const {
    const auto statistics =
        volume::measure({samples.bytes, volume.bytes}, volume.type, given_.left_out);
    return {statistics.range, statistics.otsu};
  }

  Volume volume_of() const {
    const auto type = from_string<SampleType>(type_);
    if (!type) throw invalid_parameter("type", "must be one of " + names_of<SampleType>());
    Volume volume;
    volume.type = *type;
    volume.dims = array_of(given_.dims);
    volume.geometry = geometry_of(given_);
    if (const auto fault = volume::find_fault(volume.dims, volume.geometry)) {
      throw invalid_parameter(fault->field, fault->message);
    }
    volume.geometry = volume::normalised(volume.geometry);
    volume.bytes = volume.sample_count() * bytes_per_sample(volume.type);
    return volume;
  }

  // Returns the iso-value.
  double complete(const jobs::SampleArray& samples, Volume& volume,
                  MeshParameters& parameters) const {
    if (parameters.labels) {
      jobs::check_has_cells(volume);
      jobs::limit_displacement(volume, parameters);
      return 0;
    }
    if (parameters.iso) return *parameters.iso;
    const auto statistics =
        volume::measure({samples.bytes, volume.bytes}, volume.type, given_.left_out);
    volume.range = statistics.range;
    if (given_.is_ct != 0) import::add_ct_presets(volume);
    jobs::resolve_preset(parameters, volume);
    return parameters.iso.value_or(statistics.otsu);
  }

  const isomesh_volume given_;
  const std::string type_;
  const std::string text_;
  jobs::Workspace workspace_;
  std::optional<LabelArrays> labels_;
  std::string job_;
  std::optional<Error> error_;
  Mutex mutex_;
  Condition ended_;
  bool has_ended_ ISOMESH_GUARDED_BY(mutex_) = false;
  double progress_ ISOMESH_GUARDED_BY(mutex_) = 0;
  std::jthread thread_;  // the last member: it uses the others
};

}  // namespace

// NOLINTBEGIN(readability-identifier-naming, misc-use-internal-linkage)
#define ISOMESH_EXPORT extern "C"  // exports.map keeps all else inside

// Puts sizes and geometry into the order in which volumes are stored (server/volume/geometry.h).
// Axis n is then the axis |axes[n]| of before, from 1, and reversed if that is negative: the
// samples are to be put into that order, too. A geometry with a fault, which isomesh_start tells,
// stays as it is.
ISOMESH_EXPORT void isomesh_order(isomesh_volume* volume, std::int32_t (*axes)[3]) {
  auto dims = array_of(volume->dims);
  Geometry geometry = geometry_of(*volume);
  volume::AxisOrder order = volume::kFilesOrder;
  if (!volume::find_fault(dims, geometry)) {
    geometry = volume::normalised(geometry);
    order = volume::make_canonical(dims, geometry);
    std::ranges::copy(dims, volume->dims);
    std::ranges::copy(geometry.origin, volume->origin);
    std::ranges::copy(geometry.spacing, volume->spacing);
    std::ranges::copy(geometry.direction, volume->direction);
  }
  std::ranges::copy(order, *axes);
}

// Returns null if there is no memory or thread for it.
ISOMESH_EXPORT Run* isomesh_start(const isomesh_volume* volume, const char* parameters) {
  try {
    return std::make_unique<Run>(*volume, parameters).release();
  } catch (const std::exception&) {
    return nullptr;
  }
}

ISOMESH_EXPORT bool isomesh_wait(Run* run, std::int32_t longest_ms, double* progress) {
  return run->wait(std::chrono::milliseconds(longest_ms), *progress);
}

ISOMESH_EXPORT void isomesh_cancel(Run* run) { run->cancel(); }

// A run that has ended owns these arrays, which live as long as it does.
ISOMESH_EXPORT isomesh_made isomesh_result(const Run* run) { return run->made(); }

// Cancels the run if it has not ended, and waits for its end.
ISOMESH_EXPORT void isomesh_free(Run* run) { delete run; }

// While no run is there.
ISOMESH_EXPORT void isomesh_set_threads(std::int32_t threads) { mesh::set_thread_count(threads); }
// NOLINTEND(readability-identifier-naming, misc-use-internal-linkage)
