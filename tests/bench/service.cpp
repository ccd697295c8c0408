#include "tests/bench/service.h"

#include <chrono>
#include <functional>
#include <stdexcept>
#include <string>
#include <thread>

#include "client/isomesh/client.h"
#include "tests/api/http.h"
#include "tests/bench/daemon.h"
#include "tests/bench/peers.h"
#include "tests/bench/samples.h"
#include "tests/bench/stages.h"
#include "tests/bench/timing.h"

namespace isomesh::bench {
namespace {

constexpr int kPasses = 5;
constexpr Goal kExtractGoal = {0.7};
constexpr Goal kDrcGoal = {0.2};
constexpr Goal kGlbGoal = {0.15};
constexpr Goal kSmallJobGoal = {8};  // milliseconds
constexpr Goal kUploadGoal = {10};   // milliseconds
constexpr std::uint32_t kSmallSize = 32;
constexpr std::uint32_t kUploadSize = 128;  // 2 MiB of uint8
constexpr int kSmallRuns = 51;

// Iso-values whose jobs do the same work and are yet not the same job, so that no mesh is taken
// from an earlier one: so little below a value that no sample lies between.
class IsoValues {
 public:
  explicit IsoValues(double iso) : iso_(iso) {}
  double next() {
    constexpr double kStep = 1e-6;
    return iso_ - kStep * ++count_;
  }

 private:
  double iso_;
  int count_ = 0;
};

// One kind of job against a peer, in pairs; `measured` picks what of the job's own times counts.
using Measured = std::function<double(const Timing&)>;

double without_queue(const Timing& timing) {
  return timing.load + timing.extract + timing.smooth + timing.encode;
}

class Jobs {
 public:
  Jobs(const Daemon& daemon, const std::filesystem::path& volume, double iso)
      : client_({.server = daemon.url()}), volume_(client_.upload(volume).id), isos_(iso) {}

  double run(MeshFormat format, const Measured& measured) {
    JobParameters parameters;
    parameters.volume = volume_;
    parameters.iso = isos_.next();
    parameters.passes = kPasses;
    parameters.formats = {format};
    const Job job = client_.wait(client_.submit(parameters).id);
    if (job.state != JobState::kSucceeded || job.reused) {
      throw std::runtime_error("a job of the benchmark was not run to its end");
    }
    return measured(job.timing);
  }

 private:
  Client client_;
  std::string volume_;
  IsoValues isos_;
};

std::string raw_query(std::uint32_t size) {
  const std::string n = std::to_string(size);
  return "dims=" + n + ',' + n + ',' + n + "&type=uint8";
}

// The field's bytes, and a place in them where a change makes another volume of the same work.
std::string bytes_of(const Samples& field) {
  return {reinterpret_cast<const char*>(field.bytes.data()), field.bytes.size()};
}

void expect(const test::Answer& answer, int status) {
  if (answer.status == status) return;
  throw std::runtime_error("the daemon answered " + std::to_string(answer.status) + ": " +
                           answer.body.substr(0, 200));
}

Finding small_request(const Daemon& daemon) {
  const std::string body = bytes_of(synthetic_field(kSmallSize));
  IsoValues isos(kFieldIso);
  std::vector<double> times;
  for (int run = 0; run <= kSmallRuns; ++run) {
    const std::string target =
        "/v1/mesh?" + raw_query(kSmallSize) + "&format=glb&iso=" + std::to_string(isos.next());
    const double ms = time_ms(
        {[&] { expect(test::answer_to(daemon.url(), test::request("POST", target, body)), 200); }});
    if (run > 0) times.push_back(ms);
  }
  return timed("32^3 samples in, mesh out, one request", median(times), kSmallJobGoal);
}

Finding small_upload(const Daemon& daemon) {
  std::string body = bytes_of(synthetic_field(kUploadSize));
  std::vector<double> times;
  for (int run = 0; run <= kSmallRuns; ++run) {
    ++body.front();  // another volume
    const double ms = time_ms({[&] {
      expect(test::answer_to(daemon.url(),
                             test::request("POST", "/v1/volumes?" + raw_query(kUploadSize), body)),
             201);
    }});
    if (run > 0) times.push_back(ms);
  }
  return timed("upload of 2 MiB", median(times), kUploadGoal);
}

void compare_with_peers(const Daemon& daemon, const ServicePlan& plan,
                        std::vector<Finding>& findings) {
  const LoadedVolume loaded = load_volume(plan.volume);
  const std::string name = loaded.samples.name;
  Jobs jobs(daemon, plan.volume, plan.iso);
  Peers peers(loaded.samples, plan.iso);
  const auto pipeline = [&] {
    return time_ms({[&] { peers.pipeline(); }, [&] { peers.release(); }});
  };
  const auto flying_edges = [&] {
    return time_ms({[&] { peers.flying_edges(); }, [&] { peers.release(); }});
  };
  const auto add = [&](const std::string& what, MeshFormat format, const Measured& measured,
                       const std::function<double()>& peer, Goal goal) {
    const auto ours = [&] { return jobs.run(format, measured); };
    ours();
    peer();
    findings.push_back(compared(what + ", " + name, pair_times(ours, peer, kPairs), goal));
  };
  const std::string pipeline_name = " / Flying Edges + windowed sinc (20) + Draco";
  add("job to drc" + pipeline_name, MeshFormat::kDrc, without_queue, pipeline, kDrcGoal);
  add("job to glb" + pipeline_name, MeshFormat::kGlb, without_queue, pipeline, kGlbGoal);
  const auto extract = [](const Timing& timing) { return timing.extract; };
  add("extraction as the job reports it / Flying Edges", MeshFormat::kGlb, extract, flying_edges,
      kExtractGoal);
}

}  // namespace

std::vector<Finding> measure_service(const ServicePlan& plan) {
  set_threads(plan.threads > 0 ? plan.threads
                               : static_cast<int>(std::thread::hardware_concurrency()));
  if (plan.threads > 0) Peers::set_threads(plan.threads);
  std::vector<Finding> findings;
  const Daemon daemon(plan.daemon, {"--workers", "1", "--threads", std::to_string(plan.threads)});
  if (peers_available()) compare_with_peers(daemon, plan, findings);
  findings.push_back(small_request(daemon));
  findings.push_back(small_upload(daemon));
  return findings;
}

}  // namespace isomesh::bench
