// What the commands share: a client, and what they say to people; private to this folder.
#pragma once

#include <stop_token>
#include <string>

#include "client/cli/options.h"
#include "client/cli/progress_bar.h"
#include "client/isomesh/client.h"

namespace isomesh::cli {

Client client_of(const Options& options, const std::stop_token& stop);

// A line on standard error. Safe to call from several threads.
void complain(const std::string& message);
// What was refused, and the options that would have it taken; `subject`, where there is one, is the
// input that it is about.
void complain(const Error& error, const std::string& subject = {});

// The exit status for an error that ended a command.
int status_of(const Error& error);
// The exit status for how a job ended. Why it failed, or that it found no surface, goes to standard
// error.
int status_of(const Job& job, const Options& options, const std::string& subject = {});

// What the server says about a volume besides what was asked; not for scripts.
void tell_notes(const Volume& volume);

// Without a terminal there is no progress to show, so the client uses the longest polls.
Job wait(Client& client, const std::string& id, ProgressBar& bar);

void fetch(Client& client, const std::string& id, const Output& output, ProgressBar& bar,
           std::optional<std::int64_t> label = std::nullopt);

// Sends the files, and tells notes of what came of them.
std::vector<UploadedVolume> upload_all(Client& client, const Options& options,
                                       const std::vector<std::filesystem::path>& files,
                                       const UploadOptions& how, ProgressBar& bar);

// A name for the iso-value, such as "bone", as the volume's presets have it. Throws Error
// kInvalidParameter that names those that there are.
double preset_of(const Volume& volume, const std::string& name);

// A line for each file that was written.
std::string outputs_report(const Job& job, const std::vector<Output>& outputs);
std::vector<std::filesystem::path> paths_of(const std::vector<Output>& outputs);

}  // namespace isomesh::cli
