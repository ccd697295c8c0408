// Jobs run in a process of their own, which is kept from one job to the next so that its memory is
// mapped already.
#pragma once

#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>

#include "server/jobs/job_message.h"
#include "server/jobs/make_mesh.h"
#include "server/process/child.h"

namespace isomesh::jobs {

// One worker's process. Not thread safe; the thread that calls run() must live as long as this,
// because the process dies with it.
class JobProcess {
 public:
  JobProcess(const std::filesystem::path& program, const JobSetup& setup)
      : program_(program), setup_(setup) {}

  // Runs a job in the process, which is started when there is none. Returns the job with its mesh
  // and timing; the files are where the order wants them, and not on disk yet. Throws what
  // make_mesh throws, and Error kInternal when the process ends: then this job ended it, and the
  // next one gets a new process.
  Job run(const JobOrder& order, const std::stop_token& stop, const Report& report);

  // Of the process; none before the first job and after one that ended it.
  std::optional<pid_t> pid() const { return child_ ? std::optional(child_->pid()) : std::nullopt; }

 private:
  // The next whole line; empty when the process has ended.
  std::optional<std::string> next_line(const std::stop_token& stop);
  [[noreturn]] void throw_ended();

  const std::filesystem::path program_;
  const JobSetup setup_;
  std::optional<process::Child> child_;
  std::string heard_;  // beyond the last line that was taken
  bool is_cancelled_ = false;
};

}  // namespace isomesh::jobs
