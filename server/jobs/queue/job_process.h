// Runs jobs in a separate process, one at a time, so that a crash can be attributed to its job. The
// process is reused for later jobs, because its memory is already mapped.
#pragma once

#include <chrono>
#include <exception>
#include <filesystem>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "server/codec/encode.h"
#include "server/jobs/making/job_message.h"
#include "server/jobs/making/make_mesh.h"
#include "server/process/child.h"

namespace isomesh::jobs {

struct JobProgram {
  process::Program file;  // isomesh-job
  JobSetup setup;
};

// The process ended during an order. The text says how, without details of the machine, so clients
// may see it.
class ProcessEnded : public Error {
 public:
  explicit ProcessEnded(const std::string& text) : Error(ErrorCode::kInternal, text) {}
};

// One process. Not thread safe.
class JobProcess {
 public:
  explicit JobProcess(const JobProgram& program);

  // Makes a mesh in the process, and starts the process if there is none. `sinks` has one element
  // for each of files_of(parameters) and one more for the list of labels; they are called on this
  // thread. If `stop` is requested or a sink throws, the process is asked to stop, and killed if it
  // does not stop soon. Throws what make_mesh and the sinks throw, ProcessEnded, and Error
  // kInternal or kUnavailable if no process can be started.
  MadeMesh make(const JobOrder& order, std::span<const codec::Sink> sinks,
                const std::stop_token& stop, const Report& report);

  // Counts a surface in the same way.
  CountedSurface count(const JobOrder& order, const std::stop_token& stop);

 private:
  struct Talk;

  JobAnswer end_of(const JobOrder& order, std::span<const codec::Sink> sinks,
                   const std::stop_token& stop, const Report& report);
  void start();
  // Returns nothing if the process ended before it began the order.
  std::optional<JobAnswer> follow(Talk& talk);
  void pass_on(const JobPiece& piece, Talk& talk);
  void pass_on(const JobProgress& progress, Talk& talk);
  // Returns nothing if the process has ended.
  std::optional<std::string_view> next_line(Talk& talk);
  // Appends received bytes to received_. Returns false if the process has ended.
  bool hear(Talk& talk);
  // If the order should stop, asks the process to; kills the process and throws if it does not stop
  // in time.
  void look_at_stop(Talk& talk);
  [[noreturn]] void throw_ended(const Talk& talk);

  const JobProgram program_;
  std::optional<process::Child> child_;
  std::vector<char> received_;
  std::size_t begin_ = 0;  // start of the unread bytes in received_
  std::size_t end_ = 0;
};

}  // namespace isomesh::jobs
