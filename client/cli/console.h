// Shared by the commands: a client, and messages to users. Private to this folder.
#pragma once

#include <array>
#include <chrono>
#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>

#include "base/error.h"
#include "client/cli/options.h"
#include "client/cli/progress_bar.h"
#include "client/isomesh/client.h"

namespace isomesh::cli {

inline double milliseconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

Client client_of(const Options& options, const std::stop_token& stop);

// A line on standard error. Safe to call from several threads.
void complain(const std::string& message);
// The error, and the options that would resolve it. `subject` is the input that it is about; empty
// if there is only one.
void complain(const Error& error, const std::string& subject = {});

// The server was lost after it had accepted a job; the text says how to resume.
class Lost : public Error {
 public:
  explicit Lost(const std::string& detail) : Error(ErrorCode::kUnreachable, detail) {}
};

// The hint for a user if no server responds.
void suggest_local();

int status_of(const Error& error);

// True if the job has a mesh to be written: it succeeded, and its surface is not empty or that is
// accepted.
bool has_mesh(const Job& job, const Options& options);

using SampleRange = std::array<double, 2>;

// The exit status for the end of a job. The reason of a failure, or an empty surface, is reported
// on standard error, with the range of the volume's samples if it is known.
int status_of(const Job& job, const Options& options, const std::string& subject = {},
              const std::optional<SampleRange>& range = {});

// Reports the server's notes on a volume; `subject` as above.
void tell_notes(const Volume& volume, const std::string& subject);

// Without a terminal no progress is shown, so the client uses the longest polls.
Job wait(Client& client, const std::string& id, ProgressBar& bar);

// The job with all of its labels, which are omitted in a job with many.
Job with_labels(Client& client, Job job);

// The unit of the job's volume; the millimetre if the volume was deleted.
LengthUnit unit_of(Client& client, const Job& job);

void fetch(Client& client, const std::string& id, const Output& output, ProgressBar& bar,
           std::optional<std::int64_t> label = std::nullopt);

// Uploads the files and reports the notes on the volumes. `subject` names the input if there are
// several.
std::vector<UploadedVolume> upload_all(Client& client, const Options& options,
                                       const std::vector<std::filesystem::path>& files,
                                       const UploadOptions& how, ProgressBar& bar,
                                       const std::string& subject = {});

// The iso-value of a volume's preset, such as "bone". Throws Error kInvalidParameter, which lists
// the presets, if there is none with that name.
double preset_of(const Volume& volume, const std::string& name);

std::string outputs_report(const Job& job, const std::vector<Output>& outputs);
std::vector<std::filesystem::path> paths_of(const std::vector<Output>& outputs);

}  // namespace isomesh::cli
