// isomesh-job: makes the meshes of one worker, one after the other, in memory that stays mapped. It
// reads volumes that it receives open, and results go to the daemon over the socket. The one file
// that it writes has no name, and is for what it sets aside.
#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <typeinfo>
#include <utility>
#include <vector>

#include <unistd.h>

#include "base/descriptor.h"
#include "base/files.h"
#include "base/mutex.h"
#include "base/niceness.h"
#include "server/jobs/library/label_pages.h"
#include "server/jobs/making/crop.h"
#include "server/jobs/making/job_message.h"
#include "server/jobs/making/make_mesh.h"
#include "server/jobs/making/make_samples.h"
#include "server/jobs/making/memory.h"
#include "server/jobs/making/spool_file.h"
#include "server/mesh/parallel.h"
#include "server/process/child.h"
#include "server/process/passing.h"
#include "server/process/sandbox.h"
#include "server/volume/canonical.h"

namespace {

using namespace isomesh;
using namespace isomesh::jobs;

// The memory that is kept between jobs: enough for a surface of some twenty million triangles, but
// at most a quarter of what a job may use.
std::uint64_t kept_bytes(std::uint64_t memory_bytes) {
  return std::min(std::uint64_t{1} << 30, memory_bytes / 4);
}

// Beside a job's memory: for the C library, and for each thread's stack and the like.
constexpr std::uint64_t kHeadroomBytes = std::uint64_t{64} << 20;
constexpr std::uint64_t kThreadBytes = std::uint64_t{16} << 20;
constexpr std::chrono::milliseconds kBetweenReports{20};

// The daemon's end of the socket. Lines and pieces are sent whole, from any thread. Thread safe.
class Speaker {
 public:
  void say(const JobAnswer& answer, std::span<const std::byte> piece = {}) {
    const std::string line = to_line(answer);
    const Lock lock(mutex_);
    process::respond(line);
    process::respond(piece);
  }

 private:
  Mutex mutex_;
};

// The received lines and their files. When the other side ends, so with the daemon in any case, the
// process ends. Not thread safe.
class Lines {
 public:
  std::string next() {
    std::array<char, 4096> piece;
    for (;;) {
      if (const std::size_t end = text_.find('\n'); end != std::string::npos) {
        std::string line = text_.substr(0, end);
        text_.erase(0, end + 1);
        return line;
      }
      process::Received received = process::receive(process::kChildDescriptor, piece);
      if (received.count < 0 && errno == EINTR) continue;
      if (received.count <= 0) std::_Exit(EXIT_SUCCESS);
      text_.append(piece.data(), static_cast<std::size_t>(received.count));
      if (received.passed.number() >= 0) file_ = std::move(received.passed);
    }
  }

  // The last received file, once.
  Descriptor take_file() { return std::move(file_); }

 private:
  std::string text_;
  Descriptor file_;
};

// An order and its volume.
struct Task {
  JobOrder order;
  Descriptor file;
};

// The order must outlive the request.
MeshRequest request_of(const JobOrder& order) {
  return {.volume = order.volume,
          .parameters = order.parameters,
          .iso = order.iso,
          .measures = order.measures,
          .memory_bytes = order.memory_bytes,
          .disk_bytes = order.disk_bytes};
}

// Passes orders from the reading thread to the working thread. Thread safe.
class Desk {
 public:
  void put(Task task) {
    const Lock lock(mutex_);
    task_ = std::move(task);
    stop_ = std::stop_source();
    came_.notify_one();
  }
  void cancel() {
    const Lock lock(mutex_);
    stop_.request_stop();
  }
  std::pair<Task, std::stop_token> take() {
    Lock lock(mutex_);
    came_.wait(lock, [this]() ISOMESH_REQUIRES(mutex_) { return task_.has_value(); });
    std::pair<Task, std::stop_token> taken = {*std::move(task_), stop_.get_token()};
    task_.reset();
    return taken;
  }

 private:
  Mutex mutex_;
  Condition came_;
  std::optional<Task> task_ ISOMESH_GUARDED_BY(mutex_);
  std::stop_source stop_ ISOMESH_GUARDED_BY(mutex_);
};

// Reports each stage, and the progress within a stage a few times a second. Thread safe.
class Reporter {
 public:
  explicit Reporter(Speaker& speaker) : speaker_(speaker) {}

  void tell(Stage stage, double share, const Timing& timing) {
    const auto now = std::chrono::steady_clock::now();
    {
      const Lock lock(mutex_);
      if (stage == stage_ && now - told_ < kBetweenReports) return;
      stage_ = stage;
      told_ = now;
    }
    speaker_.say(JobProgress{stage, share, timing});
  }

 private:
  Speaker& speaker_;
  Mutex mutex_;
  Stage stage_ ISOMESH_GUARDED_BY(mutex_) = Stage::kQueue;
  std::chrono::steady_clock::time_point told_ ISOMESH_GUARDED_BY(mutex_);
};

SampleArray array_of(const volume::CanonicalVolume& canonical) {
  const volume::CanonicalHeader& header = canonical.header();
  return {header.type, header.dims, header.geometry, canonical.samples().data()};
}

codec::Sink sink_of(Speaker& speaker, std::size_t file) {
  return [&speaker, file](std::span<const std::byte> bytes) {
    speaker.say(JobPiece{file, bytes.size()}, bytes);
  };
}

// Sends walls and many labels as files, since a job's record is read often.
void send_lists(Speaker& speaker, std::size_t file, const std::vector<mesh::WallArea>& walls,
                MeshSummary& summary) {
  if (!walls.empty()) write_walls(walls, sink_of(speaker, file + 1));
  if (summary.labels.size() <= MeshSummary::kMostListedLabels) return;
  write_label_pages(summary.labels, sink_of(speaker, file));
  summary.labels_count = summary.labels.size();
  summary.labels.clear();
}

// The memory and the disk that orders use one after the other.
struct Place {
  Workspace workspace;
  std::optional<SpoolFile> spool;

  // Without a spool, as on a disk that is full, orders keep in memory what they would set aside,
  // and are rejected if that is too much.
  void open_spool(const std::filesystem::path& folder) {
    try {
      spool.emplace(folder);
    } catch (const Error&) {
      spool.reset();
    }
  }
};

MadeMesh make(Task task, const std::stop_token& stop, Speaker& speaker, Place& place) {
  const JobOrder& order = task.order;
  Reporter reporter(speaker);
  const Report report = [&reporter](Stage stage, double share, const Timing& timing) {
    reporter.tell(stage, share, timing);
  };
  Progress progress(stop, report, order.expected);
  progress.enter(Stage::kLoad);
  const volume::CanonicalVolume canonical(InputFile(std::move(task.file)));
  canonical.preload();
  std::vector<codec::Sink> sinks;
  for (std::size_t i = 0; i < files_of(order.parameters).size(); ++i) {
    sinks.push_back(sink_of(speaker, i));
  }
  MeshRequest request = request_of(order);
  if (place.spool) request.spool = &*place.spool;
  MadeLabels labels =
      make_from_samples(array_of(canonical), request, sinks, progress, place.workspace);
  MadeMesh made = {.summary = std::move(labels.summary), .timing = {}};
  if (order.parameters.labels) send_lists(speaker, sinks.size(), labels.walls, made.summary);
  progress.end_stage();
  made.timing = progress.timing();
  return made;
}

CountedSurface count(Task task, const std::stop_token& stop, Speaker& speaker) {
  speaker.say(JobProgress{});  // it has begun
  const volume::CanonicalVolume canonical(InputFile(std::move(task.file)));
  const MeshParameters& parameters = task.order.parameters;
  const CroppedSamples cropped(array_of(canonical), parameters);
  const SampleArray& samples = cropped.array();
  if (parameters.labels) return count_labels(samples, parameters, {stop, nullptr});
  return count_surface(samples, request_of(task.order), {stop, nullptr});
}

struct Ending {
  JobAnswer answer;
  bool is_last = false;  // after such an error the process must not run another job
};

// Every exception becomes a message here, because nothing else leaves this process.
Ending work(Task task, const std::stop_token& stop, Speaker& speaker, Place& place) {
  const std::uint64_t memory_bytes = task.order.memory_bytes;
  try {
    const bool is_count = task.order.work == JobOrder::Work::kCount;
    if (is_count) return {count(std::move(task), stop, speaker)};
    return {make(std::move(task), stop, speaker, place)};
  } catch (const Error& error) {
    return {error};
  } catch (const std::bad_alloc&) {
    constexpr std::uint64_t kMebibyte = 1 << 20;
    return {Error(ErrorCode::kTooLarge, "the job needs more than the " +
                                            std::to_string(memory_bytes / kMebibyte) +
                                            " MiB of memory that it may use"),
            true};
  } catch (const std::exception& error) {
    return {Error(ErrorCode::kInternal,
                  std::string("A job ended with an exception: ") + typeid(error).name()),
            true};
  }
}

void read_orders(Lines& lines, Desk& desk) {
  for (;;) {
    if (auto order = order_from(lines.next())) {
      desk.put({*std::move(order), lines.take_file()});
    } else {
      desk.cancel();
    }
  }
}

}  // namespace

#if defined(__SANITIZE_THREAD__)
// Nobody here reads the sanitizer's reports, so they have to end the process.
extern "C" const char* __tsan_default_options();  // NOLINT: the name that it looks for

const char* __tsan_default_options() { return "halt_on_error=1"; }
#endif

int main() {
  process::show_name();
  be_nicer(kJobNiceness);
  keep_freed_memory();
  Lines lines;
  const JobSetup setup = setup_from(lines.next());
  const std::uint64_t headroom =
      kHeadroomBytes + kThreadBytes * static_cast<std::uint64_t>(setup.threads);
  const process::MemoryLimit memory(setup.memory_bytes + kept_bytes(setup.memory_bytes) + headroom);
  Place place;
  if (!setup.scratch.empty()) place.open_spool(setup.scratch);
  process::confine_job(setup.memory_bytes);
  mesh::set_thread_count(setup.threads);
  Desk desk;
  const std::jthread reader([&] { read_orders(lines, desk); });
  Speaker speaker;
  for (;;) {
    auto [task, stop] = desk.take();
    const std::uint64_t memory_bytes = task.order.memory_bytes;
    memory.set(memory_bytes + headroom);
    const Ending ending = work(std::move(task), stop, speaker, place);
    if (!ending.is_last) place.workspace.trim(kept_bytes(memory_bytes));
    if (place.spool) place.spool->clear();
    speaker.say(ending.answer);
    if (ending.is_last) std::_Exit(EXIT_SUCCESS);
  }
}
