// isomesh-job: makes the meshes of one worker, one after the other, in memory that stays mapped.
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <memory>
#include <new>
#include <optional>
#include <thread>
#include <typeinfo>

#include <sys/prctl.h>
#include <unistd.h>

#include "base/mutex.h"
#include "server/jobs/job_message.h"
#include "server/jobs/memory.h"
#include "server/jobs/pipeline.h"
#include "server/mesh/parallel.h"
#include "server/process/child.h"
#include "server/process/sandbox.h"
#include "server/store/files/files.h"
#include "server/volume/canonical.h"

namespace {

using namespace isomesh;
using namespace isomesh::jobs;

constexpr std::size_t kWorkspaceBudgetBytes = std::size_t{1} << 30;

void say(std::string_view message) {
  while (!message.empty()) {
    const ssize_t count = ::write(process::kChildDescriptor, message.data(), message.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) std::_Exit(EXIT_FAILURE);  // the daemon is gone
    message.remove_prefix(static_cast<std::size_t>(count));
  }
}

// The lines that come. At the end of the other side, the process ends.
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
      const ssize_t count = ::read(process::kChildDescriptor, piece.data(), piece.size());
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) std::_Exit(EXIT_SUCCESS);
      text_.append(piece.data(), static_cast<std::size_t>(count));
    }
  }

 private:
  std::string text_;
};

// What the thread that reads has for the one that works.
class Desk {
 public:
  void put(JobOrder order) {
    const Lock lock(mutex_);
    order_ = std::move(order);
    stop_ = std::stop_source();
    came_.notify_one();
  }
  void cancel() {
    const Lock lock(mutex_);
    stop_.request_stop();
  }
  std::pair<JobOrder, std::stop_token> take() {
    Lock lock(mutex_);
    came_.wait(lock, [this]() ISOMESH_REQUIRES(mutex_) { return order_.has_value(); });
    std::pair<JobOrder, std::stop_token> taken = {*std::move(order_), stop_.get_token()};
    order_.reset();
    return taken;
  }

 private:
  Mutex mutex_;
  Condition came_;
  std::optional<JobOrder> order_ ISOMESH_GUARDED_BY(mutex_);
  std::stop_source stop_ ISOMESH_GUARDED_BY(mutex_);
};

Job make(const JobOrder& order, const std::stop_token& stop, Workspace& workspace) {
  const Report report = [](Stage stage, double share, const Timing& timing) {
    say(to_line(JobProgress{stage, share, timing}));
  };
  Progress progress(stop, report);
  progress.enter(Stage::kLoad, kLoadShare, &Timing::load);
  const volume::CanonicalVolume canonical(order.volume);
  canonical.preload();
  std::vector<std::unique_ptr<store::File>> files;
  std::vector<codec::Sink> sinks;
  for (const auto& path : order.files) {
    store::File& file =
        *files.emplace_back(std::make_unique<store::File>(store::File::create(path)));
    sinks.emplace_back([&file](std::span<const std::byte> bytes) { file.write(bytes); });
  }
  const volume::CanonicalHeader& header = canonical.header();
  Job job = order.job;
  job.mesh = make_mesh({header.type, header.dims, header.geometry, canonical.samples().data()},
                       {job.parameters.volume, job.parameters, order.iso, order.memory_bytes},
                       sinks, progress, workspace.mesh);
  for (std::size_t i = 0; i < files.size(); ++i) {
    job.mesh->files[job.parameters.formats[i]] = {files[i]->size(), "", ""};
  }
  progress.end_stage();
  job.timing = progress.timing();
  return job;
}

// Every exception becomes a message here, because nothing else leaves this process.
std::string answer_to(const JobOrder& order, const std::stop_token& stop, Workspace& workspace) {
  try {
    process::limit_memory(order.memory_bytes);
    return made_line(make(order, stop, workspace));
  } catch (const Error& error) {
    return error_line(error);
  } catch (const std::bad_alloc&) {
    return error_line({ErrorCode::kTooLarge, "the job took more memory than the " +
                                                 std::to_string(order.memory_bytes) +
                                                 " bytes that it may have"});
  } catch (const std::exception& error) {
    return error_line({ErrorCode::kInternal,
                       std::string("A job ended with an exception: ") + typeid(error).name()});
  }
}

}  // namespace

int main() {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  keep_freed_memory();
  Lines lines;
  const JobSetup setup = setup_from(lines.next());
  process::confine_job(setup.readable, setup.writable);
  mesh::set_thread_count(setup.threads);
  Desk desk;
  const std::jthread reader([&] {
    for (;;) {
      if (auto order = order_from(lines.next())) {
        desk.put(*std::move(order));
      } else {
        desk.cancel();
      }
    }
  });
  Workspace workspace;
  for (;;) {
    const auto [order, stop] = desk.take();
    const std::string answer = answer_to(order, stop, workspace);
    workspace.trim(kWorkspaceBudgetBytes);
    say(answer);
  }
}
