// Meshes are made in a process that makes nothing else meanwhile, so that whatever ends it is known
// to have been the job's doing. It is kept from one job to the next: its memory is mapped already.
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

// The processes that make meshes.
struct JobProgram {
  std::filesystem::path file;  // isomesh-job
  JobSetup setup;
};

// The process ended in the middle of an order. The text says how, without anything of the machine,
// and may be shown to a client.
class ProcessEnded : public Error {
 public:
  explicit ProcessEnded(const std::string& text) : Error(ErrorCode::kInternal, text) {}
};

// One process. Not thread safe.
class JobProcess {
 public:
  explicit JobProcess(const JobProgram& program);

  // Makes a mesh in the process, which is started where there is none. `sinks` has one for each of
  // files_of(the parameters), and gets its bytes on this thread. When `stop` is requested or a sink
  // throws, the process is asked to stop, and is killed when it has not done so soon. Throws what
  // make_mesh and the sinks throw, ProcessEnded, and Error kInternal or kUnavailable when no
  // process can be started.
  MadeMesh make(const JobOrder& order, std::span<const codec::Sink> sinks,
                const std::stop_token& stop, const Report& report);

  // Counts a surface in the same way.
  CountedSurface count(const JobOrder& order, const std::stop_token& stop);

 private:
  struct Talk;

  JobAnswer end_of(const JobOrder& order, std::span<const codec::Sink> sinks,
                   const std::stop_token& stop, const Report& report);
  void start();
  // Empty when the process had ended before it began.
  std::optional<JobAnswer> follow(Talk& talk);
  void pass_on(const JobPiece& piece, Talk& talk);
  void pass_on(const JobProgress& progress, Talk& talk);
  // Empty when the process has ended.
  std::optional<std::string_view> next_line(Talk& talk);
  // Adds to what was heard; false when the process has ended.
  bool hear(Talk& talk);
  // Asks the process to stop when it is to; throws when it does not.
  void look_at_stop(Talk& talk);
  [[noreturn]] void throw_ended(const Talk& talk);

  const JobProgram program_;
  std::optional<process::Child> child_;
  std::vector<char> heard_;
  std::size_t begin_ = 0;  // of what was heard and is not taken yet
  std::size_t end_ = 0;
};

}  // namespace isomesh::jobs
