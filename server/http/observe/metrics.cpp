#include "server/http/observe/metrics.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <utility>
#include <vector>

#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>
#include <unistd.h>

#include "proto/fields.h"
#include "server/codec/mesher_version.h"

namespace isomesh::http {
namespace {

using prometheus::Counter;
using prometheus::Family;
using prometheus::Gauge;
using prometheus::Histogram;
using prometheus::Labels;

const Histogram::BucketBoundaries kRequestSeconds = {0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1,
                                                     0.25,  0.5,    1,     2.5,  10,    30,   300};
const Histogram::BucketBoundaries kStageSeconds = {
    0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60, 300, 1800};

constexpr std::array kPriorities = {Priority::kStat, Priority::kRoutine, Priority::kBulk};
constexpr std::array kEnds = {JobState::kSucceeded, JobState::kFailed, JobState::kCancelled};

constexpr std::array<std::string_view, 7> kMethods = {"GET",     "HEAD", "POST", "DELETE",
                                                      "OPTIONS", "PUT",  "PATCH"};
constexpr std::string_view kOtherMethod = "other";
constexpr int kFailure = 500;

std::string_view known_method(std::string_view method) {
  return std::ranges::count(kMethods, method) > 0 ? method : kOtherMethod;
}

std::string status_class(int status) {
  const int hundreds = status / 100;
  return hundreds >= 1 && hundreds <= 5 ? std::to_string(hundreds) + "xx" : "other";
}

Labels label(const std::string& name, std::string_view value) {
  return {{name, std::string(value)}};
}

// The number in a line such as "VmRSS: 4711 kB".
std::uint64_t process_status(std::string_view name) {
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with(name)) continue;
    std::istringstream words(line.substr(name.size()));
    std::uint64_t value = 0;
    words >> value;
    return value;
  }
  return 0;
}

std::uint64_t open_files() {
  std::error_code error;
  std::filesystem::directory_iterator file("/proc/self/fd", error);
  std::uint64_t count = 0;
  for (; !error && file != std::filesystem::directory_iterator(); file.increment(error)) ++count;
  return count;
}

prometheus::MetricFamily family_of(const MeasuredFamily& measured) {
  using prometheus::MetricType;
  prometheus::MetricFamily family;
  family.name = measured.name;
  family.help = measured.help;
  family.type = measured.is_counter ? MetricType::Counter : MetricType::Gauge;
  for (const auto& [labels, value] : measured.values) {
    prometheus::ClientMetric& metric = family.metric.emplace_back();
    for (const auto& [name, text] : labels) metric.label.push_back({name, text});
    (measured.is_counter ? metric.counter.value : metric.gauge.value) = value;
  }
  return family;
}

// The library writes the older form of the text, where a counter's family is called like its
// sample. In OpenMetrics the family lacks the suffix, and an end is marked.
std::string to_openmetrics(const std::string& text) {
  constexpr std::string_view kTotal = "_total";
  std::istringstream lines(text);
  std::string result;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("# ")) {
      const std::size_t begin = line.find(' ', 2) + 1;
      const std::size_t end = std::min(line.find(' ', begin), line.size());
      if (std::string_view(line).substr(begin, end - begin).ends_with(kTotal)) {
        line.erase(end - kTotal.size(), kTotal.size());
      }
    }
    result += line + '\n';
  }
  return result + "# EOF\n";
}

}  // namespace

std::string_view media_type_of(MetricsFormat format) {
  return format == MetricsFormat::kOpenMetrics
             ? "application/openmetrics-text; version=1.0.0; charset=utf-8"
             : "text/plain; version=0.0.4; charset=utf-8";
}

std::string_view name_of(callbacks::CallbackOutcome outcome) {
  switch (outcome) {
    case callbacks::CallbackOutcome::kDelivered:
      return "delivered";
    case callbacks::CallbackOutcome::kRetried:
      return "retried";
    case callbacks::CallbackOutcome::kGivenUp:
      break;
  }
  return "given_up";
}

struct Metrics::State {
  prometheus::Registry registry;

  Family<Counter>& counter(const char* name, const char* help) {
    return prometheus::BuildCounter().Name(name).Help(help).Register(registry);
  }
  Family<Gauge>& gauge(const char* name, const char* help) {
    return prometheus::BuildGauge().Name(name).Help(help).Register(registry);
  }
  Family<Histogram>& histogram(const char* name, const char* help) {
    return prometheus::BuildHistogram().Name(name).Help(help).Register(registry);
  }

  Family<Counter>& requests = counter("isomesh_http_requests_total", "Answered requests");
  Counter& answered(std::string_view method, std::string_view route, int status) {
    return requests.Add({{"method", std::string(known_method(method))},
                         {"route", std::string(route)},
                         {"status", status_class(status)}});
  }
  Family<Histogram>& request_seconds = histogram(
      "isomesh_http_request_seconds", "Time from a request's head to the end of its response");
  Counter& bytes_in =
      counter("isomesh_http_received_bytes_total", "Bytes of request bodies").Add({});
  Counter& bytes_out = counter("isomesh_http_sent_bytes_total", "Bytes of response bodies").Add({});
  Family<Counter>& ended = counter("isomesh_jobs_ended_total", "Ended jobs by final state");
  Family<Counter>& failures = counter("isomesh_job_failures_total", "Failed jobs by error code");
  Family<Histogram>& stages = histogram("isomesh_job_stage_seconds", "Stages of finished jobs");
  Counter& triangles =
      counter("isomesh_job_triangles_total", "Triangles of finished meshes").Add({});
  Family<Counter>& refused =
      counter("isomesh_imports_refused_total", "Rejected volumes by error code");
  Family<Counter>& callbacks =
      counter("isomesh_callback_attempts_total", "Attempts to deliver callbacks, by result");

  Family<Gauge>& queued = gauge("isomesh_queued_jobs", "Waiting jobs by priority");
  Gauge& running = gauge("isomesh_running_jobs", "Running jobs").Add({});
  Gauge& waiting_for_disk =
      gauge("isomesh_jobs_waiting_for_disk", "Waiting jobs that need more disk space").Add({});
  Gauge& uploads = gauge("isomesh_uploads_in_progress", "Uploads in progress").Add({});
  Gauge& waiting_callbacks =
      gauge("isomesh_waiting_callbacks", "Callbacks that are not delivered yet").Add({});
  Gauge& disk_used = gauge("isomesh_disk_used_bytes", "Bytes of volumes and meshes").Add({});
  Gauge& disk_free = gauge("isomesh_disk_free_bytes", "Free bytes on the same disk").Add({});
  Gauge& memory = gauge("process_resident_memory_bytes", "Resident memory").Add({});
  Gauge& threads = gauge("process_threads", "Threads of the process").Add({});
  Gauge& files = gauge("process_open_fds", "Open file descriptors").Add({});
};

Metrics::Metrics() : state_(std::make_unique<State>()) {
  state_->gauge("isomesh_build_info", "Running version as a label; always 1")
      .Add({{"version", ISOMESH_VERSION}, {"mesher", codec::kMesherVersion}})
      .Set(1);
  for (const JobState state : kEnds) state_->ended.Add(label("state", to_string(state)));
  const Timing none;
  visit(none, [&](const char* stage, double /*milliseconds*/) {
    state_->stages.Add(label("stage", stage), kStageSeconds);
  });
  for (const auto result :
       {callbacks::CallbackOutcome::kDelivered, callbacks::CallbackOutcome::kRetried,
        callbacks::CallbackOutcome::kGivenUp}) {
    state_->callbacks.Add(label("result", name_of(result)));
  }
  for (const ErrorDescription& error : error_descriptions()) {
    state_->failures.Add(label("reason", error.name));
    state_->refused.Add(label("reason", error.name));
  }
}

Metrics::~Metrics() = default;

void Metrics::expect(std::string_view method, std::string_view route) {
  state_->answered(method, route, kFailure);
}

void Metrics::count(const AnsweredRequest& request) {
  state_->answered(request.method, request.route, request.status).Increment();
  state_->request_seconds.Add(label("route", request.route), kRequestSeconds)
      .Observe(request.seconds);
  state_->bytes_in.Increment(static_cast<double>(request.bytes_in));
  state_->bytes_out.Increment(static_cast<double>(request.bytes_out));
}

void Metrics::count_ended(const Job& job) {
  state_->ended.Add(label("state", to_string(job.state))).Increment();
  if (job.error) {
    const ErrorCode code = to_error(*job.error).code();
    state_->failures.Add(label("reason", describe(code).name)).Increment();
  }
  if (!job.mesh) return;
  state_->triangles.Increment(static_cast<double>(job.mesh->triangles));
  constexpr double kMillisecondsPerSecond = 1000;
  visit(job.timing, [&](const char* stage, double milliseconds) {
    state_->stages.Add(label("stage", stage), kStageSeconds)
        .Observe(milliseconds / kMillisecondsPerSecond);
  });
}

void Metrics::count_refused(ErrorCode reason) {
  state_->refused.Add(label("reason", describe(reason).name)).Increment();
}

void Metrics::count(callbacks::CallbackOutcome outcome) {
  state_->callbacks.Add(label("result", name_of(outcome))).Increment();
}

std::string Metrics::text(const Levels& levels, MetricsFormat format) const {
  constexpr double kKibibyte = 1024;
  State& state = *state_;
  for (std::size_t i = 0; i < kPriorities.size(); ++i) {
    state.queued.Add(label("priority", to_string(kPriorities[i])))
        .Set(static_cast<double>(levels.queued[i]));
  }
  state.running.Set(static_cast<double>(levels.running));
  state.waiting_for_disk.Set(static_cast<double>(levels.waiting_for_disk));
  state.uploads.Set(static_cast<double>(levels.uploads));
  state.waiting_callbacks.Set(static_cast<double>(levels.callbacks));
  state.disk_used.Set(static_cast<double>(levels.disk_used_bytes));
  state.disk_free.Set(static_cast<double>(levels.disk_free_bytes));
  state.memory.Set(static_cast<double>(process_status("VmRSS:")) * kKibibyte);
  state.threads.Set(static_cast<double>(process_status("Threads:")));
  state.files.Set(static_cast<double>(open_files()));
  std::vector<prometheus::MetricFamily> families = state.registry.Collect();
  for (const MeasuredFamily& family : levels.others) families.push_back(family_of(family));
  std::string text = prometheus::TextSerializer().Serialize(families);
  return format == MetricsFormat::kOpenMetrics ? to_openmetrics(text) : text;
}

}  // namespace isomesh::http
