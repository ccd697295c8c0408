// The end of a job, as the command reports it; private to this folder.
#pragma once

#include <string>

#include "client/cli/options.h"
#include "client/cli/progress_bar.h"
#include "client/isomesh/client.h"
#include "proto/notes.h"

namespace isomesh::cli {

// The server was lost after it had accepted a job; the text says how to resume.
class Lost : public Error {
 public:
  explicit Lost(const std::string& detail) : Error(ErrorCode::kUnreachable, detail) {}
};

int status_of(const Error& error);

// True if the job has a mesh to be written: it succeeded, and its surface is not empty or that is
// accepted.
bool has_mesh(const Job& job, const Options& options);

// The exit status for the end of a job. The reason of a failure, or of an empty surface, is
// reported on standard error.
int status_of(const Job& job, const Options& options, const std::string& subject = {});

// Without a terminal no progress is shown, so the client uses the longest polls.
Job wait(Client& client, const std::string& id, ProgressBar& bar);

// The job with all of its labels, which are omitted in a job with many.
Job with_labels(Client& client, Job job);

// The unit of the job's volume; the millimetre if the volume was deleted.
LengthUnit unit_of(Client& client, const Job& job);

}  // namespace isomesh::cli
