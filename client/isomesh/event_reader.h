#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "proto/types.h"

namespace isomesh {

// Reads a job's stream of server-sent events, which comes in pieces. Not thread safe.
class EventReader {
 public:
  using Listener = std::function<void(const JobEvent& event)>;

  explicit EventReader(Listener listener) : listener_(std::move(listener)) {}

  // Calls the listener for each event that is complete. Throws Error kInternal for what is no
  // stream of a job's events.
  void take(std::string_view piece);

  // Another stream follows, from after last_id().
  void restart();

  const std::string& last_id() const { return last_id_; }
  // The job, once it is over.
  const std::optional<Job>& job() const { return job_; }

 private:
  void take_line(std::string_view line);
  void finish_event();

  Listener listener_;
  std::string line_;  // what has come of one
  std::string name_;
  std::string data_;
  std::string id_;
  std::string last_id_;
  std::optional<Job> job_;
};

}  // namespace isomesh
