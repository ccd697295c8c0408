// The parsed command line.
#pragma once

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "client/cli/added.h"
#include "client/isomesh/client.h"
#include "proto/types.h"

namespace isomesh::cli {

enum class Command {
  kMesh,
  kUpload,
  kEstimate,
  kSubmit,
  kStatus,
  kWait,
  kFetch,
  kCancel,
  kRename,
  kReorient,
  kErase,
  kList,
  kInfo,
  kLabels,
  kWalls,
  kReport,
  kIds,
  kAdded,
};

// A file to write a mesh to, in the format that its suffix names. "-" is standard output; "{name}"
// in it stands for the input's name, and "{folder}" for its folder.
struct Output {
  std::filesystem::path path;
  MeshFormat format = MeshFormat::kDrc;

  bool is_stdout() const { return path == "-"; }
  bool operator==(const Output&) const = default;
};

struct Options {
  Command command = Command::kMesh;
  std::string server = "http://127.0.0.1:8080";
  std::string token;
  std::filesystem::path authorities;  // certificate authorities; empty: the system's
  int retry_seconds = 600;            // how long a request waits for a busy server
  bool json = false;
  bool allow_empty = false;  // an empty surface is a success
  bool quiet = false;

  std::vector<std::filesystem::path> files;  // mesh, upload; "-" is standard input
  UploadOptions upload;                      // mesh, upload; without progress
  std::string id;                            // of a job, a volume and so on; may be shortened
  JobParameters parameters;                  // mesh, submit, estimate
  bool dry_run = false;                      // mesh: only an estimate
  bool skip_existing = false;                // mesh: not if its outputs are newer than the input
  int jobs = 1;                              // mesh: inputs processed concurrently
  bool is_local = false;                     // mesh: with a daemon of its own
  std::filesystem::path daemon;              // its program; empty: searched for
  std::string key;                           // submit
  std::vector<Output> outputs;               // mesh, fetch
  std::filesystem::path report;              // report: the file to write; empty: standard output
  JobFilter filter;                          // list
  std::string cursor;                        // list
  bool volumes = false;                      // list
  std::string name;                          // rename
  std::string axes;                          // reorient
  std::vector<std::string> ids;              // erase
  bool are_jobs = false;                     // erase: `ids` are of jobs
  bool with_jobs = false;                    // erase: also the ended jobs on the volumes
  std::optional<std::int64_t> label;         // fetch
  std::int64_t background = 0;               // labels
  bool edge_contacts = false;                // walls
  std::string kind;                          // ids: volumes, jobs, or an added kind
  const AddedCommand* added = nullptr;       // if it is one
  const AddedIds* added_ids = nullptr;       // ids: of an added kind
};

// True for a pipe or a device, which is written to; any other file is replaced.
bool is_pipe(const std::filesystem::path& path);

// Ends the program before any command runs: help, the version, or wrong usage. `text` belongs on
// standard output if the status is 0, otherwise on standard error.
class EarlyExit : public std::runtime_error {
 public:
  EarlyExit(int status, const std::string& text) : std::runtime_error(text), status_(status) {}

  int status() const { return status_; }

 private:
  int status_;
};

// Throws EarlyExit with kWrongUsage and "isomesh: `message`", printable but for line breaks.
[[noreturn]] void wrong_usage(const std::string& message);

// Reads the arguments, and ISOMESH_SERVER and ISOMESH_TOKEN of the environment. `added` must
// outlive the result. Throws EarlyExit.
Options parse_options(int argc, const char* const* argv, const Added& added = {});

}  // namespace isomesh::cli
