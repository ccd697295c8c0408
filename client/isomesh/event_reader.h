#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "proto/types.h"

namespace isomesh {

// Parses a job's stream of server-sent events incrementally. Not thread safe.
class EventReader {
 public:
  using Listener = std::function<void(const JobEvent& event)>;

  explicit EventReader(Listener listener) : listener_(std::move(listener)) {}

  // Calls the listener for each complete event. Throws Error kInternal for anything other than a
  // job's events.
  void take(std::string_view piece);

  // Call before the bytes of another stream, which continues after last_id().
  void restart();

  const std::string& last_id() const { return last_id_; }
  // The job, once it has ended.
  const std::optional<Job>& job() const { return job_; }

 private:
  void take_line(std::string_view line);
  void finish_event();

  Listener listener_;
  std::string line_;
  std::string name_;
  std::string data_;
  std::string id_;
  std::string last_id_;
  std::optional<Job> job_;
};

}  // namespace isomesh
