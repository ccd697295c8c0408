#include "tests/bench/cluster.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include "client/isomesh/client.h"
#include "server/store/files/blob_store.h"
#include "server/store/postgresql/database.h"
#include "server/store/postgresql/job_store.h"
#include "server/store/sql/volume_store.h"
#include "tests/bench/daemon.h"
#include "tests/bench/samples.h"
#include "tests/bench/timing.h"
#include "tests/support/files.h"
#include "tests/support/postgres.h"

namespace isomesh::bench {
namespace {

using test::Postgres;
using Clock = std::chrono::steady_clock;

constexpr int kSubmitters = 8;
constexpr int kSmallJobs = 600;
constexpr std::uint32_t kSmallSize = 32;
constexpr std::uint32_t kLargeSize = 256;
constexpr std::chrono::milliseconds kBetweenLooks{10};
constexpr std::size_t kQueueConnections = 64;
constexpr int kSubmissions = 3000;
constexpr int kWakes = 200;
constexpr int kTakeovers = 5;
constexpr int kLeaseSeconds = 5;
constexpr const char* kVolume = "some-volume";

double ms_since(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

// Runs act(n) for n below `count`, on so many threads; returns how long each call took.
std::vector<double> side_by_side(std::size_t threads, int count,
                                 const std::function<void(std::size_t thread, int n)>& act) {
  std::atomic<int> next = 0;
  std::vector<std::vector<double>> times(threads);
  std::vector<std::exception_ptr> errors(threads);
  {
    std::vector<std::jthread> running;
    for (std::size_t thread = 0; thread < threads; ++thread) {
      running.emplace_back([&, thread] {
        try {
          for (int n = next++; n < count; n = next++) {
            const auto begin = Clock::now();
            act(thread, n);
            times[thread].push_back(ms_since(begin));
          }
        } catch (...) {
          errors[thread] = std::current_exception();
        }
      });
    }
  }
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
  std::vector<double> all;
  for (const auto& some : times) all.insert(all.end(), some.begin(), some.end());
  return all;
}

std::string half_and_most(std::vector<double> times) {
  std::ranges::sort(times);
  return milliseconds(times[times.size() / 2]) + ", 99 of 100 within " +
         milliseconds(times[times.size() * 99 / 100]);
}

std::string counted(std::size_t count, const std::string& what) {
  return std::to_string(count) + ' ' + what + (count == 1 ? "" : "s");
}

std::string a_second(double count, double ms) { return fixed(count * 1000 / ms, 0) + " a second"; }

// --- Daemons

std::vector<std::string> one_worker() { return {"--workers", "1", "--threads", "1"}; }

// Each of one worker, and all on one database and one folder.
class Cluster {
 public:
  Cluster(std::filesystem::path program, std::string store, std::size_t nodes)
      : program_(std::move(program)), store_(std::move(store)) {
    for (std::size_t node = 0; node < nodes; ++node) add();
  }

  void add() {
    std::vector<std::string> arguments = one_worker();
    for (const std::string& word :
         {std::string("--store"), store_, std::string("--blobs"), shared_.path().string(),
          std::string("--lease-seconds"), std::to_string(kLeaseSeconds)}) {
      arguments.push_back(word);
    }
    nodes_.push_back(std::make_unique<Daemon>(program_, arguments));
  }
  void kill(std::size_t node) { nodes_.at(node).reset(); }
  Client client(std::size_t node) const { return Client({.server = nodes_.at(node)->url()}); }

 private:
  const std::filesystem::path program_;
  const std::string store_;
  test::TemporaryFolder shared_;
  std::vector<std::unique_ptr<Daemon>> nodes_;
};

// A gyroid of so many samples a side, as a file that the client sends.
std::filesystem::path volume_file(const test::TemporaryFolder& folder, std::uint32_t size) {
  const Samples field = synthetic_field(size);
  const std::string side = std::to_string(size);
  std::string header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: " + side + ' ' + side + ' ' +
                       side + "\nencoding: raw\n\n";
  header.append(reinterpret_cast<const char*>(field.bytes.data()), field.bytes.size());
  const auto path = folder / (side + ".nrrd");
  test::write_file(path, header);
  return path;
}

JobParameters unlike(const std::string& volume, int n, int passes) {
  JobParameters parameters;
  parameters.volume = volume;
  parameters.iso = kFieldIso - 1e-6 * n;
  parameters.passes = passes;
  return parameters;
}

// Small jobs from their first submission to the last end, in milliseconds.
double run_small_jobs(const std::vector<Client*>& clients, const std::string& volume, int first) {
  std::vector<std::string> ids(kSmallJobs);
  const auto begin = Clock::now();
  side_by_side(clients.size(), kSmallJobs, [&](std::size_t thread, int n) {
    ids[static_cast<std::size_t>(n)] = clients[thread]->submit(unlike(volume, first + n, 5)).id;
  });
  for (const std::string& id : ids) {
    if (clients.front()->wait(id).state != JobState::kSucceeded) {
      throw std::runtime_error("a job of the benchmark did not succeed");
    }
  }
  return ms_since(begin);
}

// Submitters that spread over the nodes.
double time_small_jobs(const std::function<Client(std::size_t node)>& client, std::size_t nodes) {
  const test::TemporaryFolder folder;
  std::vector<Client> clients;
  for (int n = 0; n < kSubmitters; ++n) {
    clients.push_back(client(static_cast<std::size_t>(n) % nodes));
  }
  std::vector<Client*> each;
  for (Client& one : clients) each.push_back(&one);
  const std::string volume = clients.front().upload(volume_file(folder, kSmallSize)).id;
  run_small_jobs(each, volume, 0);
  std::vector<double> times;
  for (int run = 1; run <= 3; ++run) {
    times.push_back(run_small_jobs(each, volume, run * kSmallJobs));
  }
  return median(times);
}

// Measures the job throughput of one to three daemons on PostgreSQL, relative to one daemon on
// SQLite.
void measure_daemons(Postgres& postgres, const std::filesystem::path& program,
                     std::vector<Finding>& findings) {
  const double alone = [&] {
    const Daemon sqlite(program, one_worker());
    return time_small_jobs([&](std::size_t) { return Client({.server = sqlite.url()}); }, 1);
  }();
  for (const std::size_t count : {1U, 2U, 3U}) {
    const Cluster cluster(program, postgres.new_place(), count);
    const double ms = time_small_jobs([&](std::size_t n) { return cluster.client(n); }, count);
    findings.push_back({"jobs of 32^3 samples, " + counted(count, "daemon") +
                            " of one worker on PostgreSQL / one on SQLite",
                        a_second(kSmallJobs, ms),
                        a_second(kSmallJobs, alone),
                        ms / alone,
                        {}});
  }
}

// From the kill of a daemon until another one runs its job. The victim does not come back, so its
// lease has to run out.
Finding measure_takeover(Postgres& postgres, const std::filesystem::path& program) {
  const test::TemporaryFolder folder;
  const auto file = volume_file(folder, kLargeSize);
  std::vector<double> times;
  for (int round = 0; round < kTakeovers; ++round) {
    Cluster cluster(program, postgres.new_place(), 1);
    Client victim = cluster.client(0);
    const std::string id = victim.submit(unlike(victim.upload(file).id, round, 1000)).id;
    while (victim.job(id).state != JobState::kRunning) std::this_thread::sleep_for(kBetweenLooks);
    const auto before = victim.job(id).started;
    cluster.add();
    Client other = cluster.client(1);
    // Until then it leaves leases that run out to their holders.
    std::this_thread::sleep_for(store::JobStoreOptions{}.grace + kBetweenLooks);
    const auto killed = Clock::now();
    cluster.kill(0);
    for (Job now = other.job(id); now.started == before || now.state != JobState::kRunning;
         now = other.job(id)) {
      std::this_thread::sleep_for(kBetweenLooks);
    }
    times.push_back(ms_since(killed));
    other.cancel(id);
  }
  return timed("a killed daemon's job runs at another, with --lease-seconds " +
                   std::to_string(kLeaseSeconds) + ", the slowest of " + std::to_string(kTakeovers),
               *std::ranges::max_element(times));
}

// --- The queue alone

// A process's stores, in this one.
struct Node {
  Node(const std::string& url, const std::string& name, store::BlobStore& blobs,
       std::size_t connections)
      : database({.url = url, .node = name, .connections = connections}),
        volumes(database),
        jobs(database, blobs, {.max_queued = 1'000'000, .mesher_version = "bench"}) {}

  store::postgresql::Database database;
  store::SqlVolumeStore volumes;
  store::postgresql::PostgresJobStore jobs;
};

store::JobSpec spec(int n) {
  store::JobSpec spec;
  spec.parameters = unlike(kVolume, n, 5);
  return spec;
}

// As a mesh whose blob is there already.
store::Outcome mesh() {
  store::Outcome outcome;
  MeshFile& file = outcome.mesh.emplace().files[MeshFormat::kDrc];
  file.sha256 = std::string(64, 'a');
  file.bytes = 1000;
  return outcome;
}

void claim_and_finish(store::JobStore& jobs, std::size_t worker) {
  const auto lease = jobs.claim("worker " + std::to_string(worker), std::chrono::seconds(60));
  if (!lease || !jobs.finish(*lease, mesh())) {
    throw std::runtime_error("the queue has lost a job of the benchmark");
  }
}

Finding measure_submit(Node& node, std::size_t connections, int first) {
  const auto begin = Clock::now();
  const auto times = side_by_side(connections, kSubmissions, [&](std::size_t, int n) {
    if (node.jobs.submit(spec(first + n)).kind != store::Submission::Kind::kNew) {
      throw std::runtime_error("the queue has refused a job of the benchmark");
    }
  });
  const double ms = ms_since(begin);
  return {"submission, " + counted(connections, "connection"),
          a_second(kSubmissions, ms) + ", " + half_and_most(times),
          "",
          ms / kSubmissions,
          {}};
}

Finding measure_queue(Node& node, std::size_t connections, int count) {
  const auto begin = Clock::now();
  const auto times = side_by_side(
      connections, count, [&](std::size_t thread, int) { claim_and_finish(node.jobs, thread); });
  const double ms = ms_since(begin);
  return {"claim and finish, " + counted(connections, "connection"),
          a_second(count, ms) + ", " + half_and_most(times),
          "",
          ms / count,
          {}};
}

// From a submission's answer at one node until another has claimed it.
Finding measure_wake(Node& one, Node& other, int first) {
  std::vector<double> times;
  for (int n = 0; n < kWakes; ++n) {
    Clock::time_point claimed;
    std::jthread worker([&] {
      while (!other.jobs.wait_for_work({}, std::chrono::seconds(60))) continue;
      claim_and_finish(other.jobs, 0);
      claimed = Clock::now();
    });
    std::this_thread::sleep_for(kBetweenLooks);
    one.jobs.submit(spec(first + n));
    const auto submitted = Clock::now();
    worker.join();
    times.push_back(std::chrono::duration<double, std::milli>(claimed - submitted).count());
  }
  return {"from a submission at one daemon to its end at another without work",
          half_and_most(times),
          "",
          median(times),
          {}};
}

void measure_stores(Postgres& postgres, std::vector<Finding>& findings) {
  const std::string url = postgres.new_place();
  const test::TemporaryFolder folder;
  const store::DataFolder data(folder / "data");
  store::FileBlobStore blobs(data);
  Node node(url, "one", blobs, kQueueConnections);
  Volume volume;
  volume.id = kVolume;
  volume.samples = kVolume;
  volume.created = "2024-01-01T00:00:00.000Z";
  node.volumes.add("", volume);
  int submitted = 0;
  for (const std::size_t connections : {std::size_t{1}, std::size_t{16}, kQueueConnections}) {
    findings.push_back(measure_submit(node, connections, submitted));
    submitted += kSubmissions;
  }
  findings.push_back(measure_queue(node, 1, kSubmissions));
  findings.push_back(measure_queue(node, kQueueConnections, submitted - kSubmissions));
  Node other(url, "two", blobs, 2);
  findings.push_back(measure_wake(node, other, submitted));
}

}  // namespace

std::vector<Finding> measure_cluster(const std::filesystem::path& daemon) {
  if (!Postgres::is_here()) {
    throw std::runtime_error("PostgreSQL is not installed: there is nothing to measure");
  }
  Postgres postgres(Postgres::Disk::kDurable);
  std::vector<Finding> findings;
  measure_stores(postgres, findings);
  measure_daemons(postgres, daemon, findings);
  findings.push_back(measure_takeover(postgres, daemon));
  return findings;
}

}  // namespace isomesh::bench
