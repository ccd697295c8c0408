// The service's metrics as text, in OpenMetrics or in the older format of Prometheus.
//
// Every label has few values, known in advance: routes are patterns, rejections are error codes. No
// label ever holds data of a client.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "proto/error.h"
#include "proto/types.h"
#include "server/callbacks/callbacks.h"

namespace isomesh::http {

struct AnsweredRequest {
  std::string_view method;
  std::string_view route;  // its pattern, or kNoRoute
  int status = 0;
  double seconds = 0;
  std::uint64_t bytes_in = 0;   // of its body
  std::uint64_t bytes_out = 0;  // of the response's body
};

std::string_view name_of(callbacks::CallbackOutcome outcome);

// A family of metrics that a part of the service measures when somebody asks.
struct MeasuredFamily {
  struct Value {
    std::map<std::string, std::string> labels;
    double value = 0;
  };

  std::string name;
  std::string help;
  bool is_counter = false;  // otherwise it is a gauge
  std::vector<Value> values = {};
};

// Values measured on each scrape.
struct Levels {
  std::array<std::uint64_t, 3> queued = {};  // by Priority
  std::uint64_t running = 0;
  std::uint64_t waiting_for_disk = 0;  // of the queued jobs
  std::uint64_t uploads = 0;           // in progress
  std::uint64_t callbacks = 0;         // waiting for delivery
  std::uint64_t disk_used_bytes = 0;
  std::uint64_t disk_free_bytes = 0;
  std::vector<MeasuredFamily> others = {};
};

enum class MetricsFormat {
  kOpenMetrics,     // 1.0
  kPrometheusText,  // 0.0.4
};

std::string_view media_type_of(MetricsFormat format);

// Counters begin at 0 and not with their first event, because rates need a first sample. Thread
// safe.
class Metrics {
 public:
  Metrics();
  ~Metrics();
  Metrics(const Metrics&) = delete;
  Metrics& operator=(const Metrics&) = delete;

  // Begins to count the failures of a route.
  void expect(std::string_view method, std::string_view route);

  void count(const AnsweredRequest& request);
  // A job in a final state.
  void count_ended(const Job& job);
  // A rejected volume.
  void count_refused(ErrorCode reason);
  void count(callbacks::CallbackOutcome outcome);

  // All metrics, including `levels` and the process's memory, threads and files.
  std::string text(const Levels& levels, MetricsFormat format) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace isomesh::http
