// What a worker and the process that makes its meshes tell each other, in lines of JSON over a
// socket. The worker sends one set-up, then orders, one after the other, and may ask to cancel the
// one that is under way. The process answers an order with lines of progress and one end.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/error.h"
#include "proto/types.h"
#include "server/jobs/make_mesh.h"

namespace isomesh::jobs {

// What holds for all jobs of a process.
struct JobSetup {
  std::filesystem::path readable;  // the folder of the volumes
  std::filesystem::path writable;  // the folder of the files that are made
  int threads = 1;                 // of the kernels
};

struct JobOrder {
  std::filesystem::path volume;  // its canonical file, which has been found intact
  Job job;                       // its parameters say which volume and what to make of it
  double iso = 0;                // whatever the parameters say of it
  std::uint64_t memory_bytes = 0;
  std::vector<std::filesystem::path> files;  // to be made, one for each format
};

struct JobProgress {
  Stage stage = Stage::kLoad;
  double share = 0;
  Timing timing;
};

// One answer: exactly one of these is there.
struct JobAnswer {
  std::optional<JobProgress> progress;
  std::optional<Job>
      made;  // with mesh and timing; the files have sizes and neither digest nor href
  std::optional<Error> error;
};

inline constexpr std::string_view kCancelMessage = "{\"cancel\":true}\n";

// Each is one line with its break. The readers throw Error kInternal for a line of another form.
std::string to_line(const JobSetup& setup);
std::string to_line(const JobOrder& order);
std::string to_line(const JobProgress& progress);
std::string made_line(const Job& job);
std::string error_line(const Error& error);
JobSetup setup_from(std::string_view line);
// Empty when the line asks to cancel.
std::optional<JobOrder> order_from(std::string_view line);
JobAnswer answer_from(std::string_view line);

}  // namespace isomesh::jobs
