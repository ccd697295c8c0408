#include "client/cli/commands.h"

#include <algorithm>
#include <chrono>
#include <iostream>
#include <utility>

#include "client/cli/progress_bar.h"
#include "client/cli/report.h"
#include "client/cli/text.h"
#include "client/isomesh/client.h"
#include "proto/json.h"

namespace isomesh::cli {
namespace {

class Stopwatch {
 public:
  double milliseconds() const {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_)
        .count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

Client client_of(const Options& options, const std::stop_token& stop) {
  return Client({.server = options.server,
                 .token = options.token,
                 .authorities = options.authorities,
                 .stop = stop});
}

void complain(const std::string& message) { std::cerr << "isomesh: " << message << '\n'; }

// What was refused, and the options that would have it taken.
void complain(const Error& error) {
  complain(error.what());
  std::cerr << remedy_report(error.remedy());
}

// What the server says about a volume besides what was asked; not for scripts.
void tell_notes(const Volume& volume) {
  for (const Note& note : volume.notes) complain("note: " + note.detail + " (" + note.code + ")");
}

Error reason_of(const Job& job) {
  if (job.error) return to_error(*job.error);
  return {ErrorCode::kCancelled, "the job was cancelled"};
}

// The exit status for how a job ended. Why it failed goes to standard error.
int status_of(const Job& job) {
  if (job.state != JobState::kFailed && job.state != JobState::kCancelled) return kDone;
  complain(reason_of(job));
  return kRefused;
}

std::vector<UploadedVolume> upload_all(Client& client, const Options& options, ProgressBar& bar) {
  UploadOptions how = options.upload;
  how.progress = [&](std::uint64_t done, std::uint64_t total) {
    bar.transfer(done < total ? "upload" : "check", done, total);
  };
  std::vector<UploadedVolume> volumes = client.upload_all(options.files, how);
  bar.clear();
  for (const UploadedVolume& each : volumes) {
    if (each.volume) tell_notes(*each.volume);
  }
  return volumes;
}

// The volume of an upload that holds one.
Volume upload(Client& client, const Options& options, ProgressBar& bar) {
  std::vector<UploadedVolume> volumes = upload_all(client, options, bar);
  if (volumes.size() == 1 && volumes.front().volume) return std::move(*volumes.front().volume);
  throw several_volumes(volumes);
}

void fetch(Client& client, const std::string& id, const Output& output, ProgressBar& bar,
           std::optional<std::int64_t> label = std::nullopt) {
  client.fetch(
      id, output.format, output.path,
      [&](std::uint64_t done, std::uint64_t total) { bar.transfer("download", done, total); },
      label);
  bar.clear();
}

// Without a terminal there is no progress to show, so the client uses the longest polls.
Job wait(Client& client, const std::string& id, ProgressBar& bar) {
  const JobProgress draw = [&](const Job& job) { bar.job(job); };
  Job job = client.wait(id, bar.visible() ? draw : JobProgress{});
  bar.clear();
  return job;
}

// After an interrupt the job is no longer wanted, which the server must learn. The user does not
// wait long for that.
void cancel_after_stop(const Options& options, const std::string& id) {
  Client client({.server = options.server,
                 .token = options.token,
                 .authorities = options.authorities,
                 .connect_timeout = std::chrono::seconds{2},
                 .silence_timeout = std::chrono::seconds{5}});
  try {
    client.cancel(id);
    complain("interrupted; the job " + id + " is cancelled");
  } catch (const Error& error) {
    complain("interrupted; the job " + id + " could not be cancelled: " + error.what());
  }
}

std::vector<MeshFormat> formats_of(const std::vector<Output>& outputs) {
  std::vector<MeshFormat> formats;
  for (const Output& output : outputs) {
    if (std::ranges::find(formats, output.format) == formats.end()) {
      formats.push_back(output.format);
    }
  }
  return formats;
}

std::vector<std::filesystem::path> paths_of(const std::vector<Output>& outputs) {
  std::vector<std::filesystem::path> paths;
  paths.reserve(outputs.size());
  for (const Output& output : outputs) paths.push_back(output.path);
  return paths;
}

void report_outputs(const Job& job, const std::vector<Output>& outputs) {
  for (const Output& output : outputs) {
    const auto file = job.mesh->files.find(output.format);
    std::cout << output.path.string();
    if (file != job.mesh->files.end()) std::cout << "  " << human_bytes(file->second.bytes);
    std::cout << '\n';
  }
}

int mesh(const Options& options, const std::stop_token& stop) {
  Client client = client_of(options, stop);
  ProgressBar bar;
  ClientTiming seen;

  const Stopwatch uploading;
  const Volume volume = upload(client, options, bar);
  seen.upload = uploading.milliseconds();

  JobParameters parameters = options.parameters;
  parameters.volume = volume.id;
  parameters.formats = formats_of(options.outputs);
  Job job = client.submit(parameters);
  try {
    job = wait(client, job.id, bar);
  } catch (const Error&) {
    bar.clear();
    if (!stop.stop_requested()) throw;
    cancel_after_stop(options, job.id);
    return kRefused;
  }
  if (job.state != JobState::kSucceeded) {
    if (options.json) std::cout << job_json(job, {}, seen) << '\n';
    return status_of(job);
  }

  const Stopwatch downloading;
  for (const Output& output : options.outputs) fetch(client, job.id, output, bar);
  seen.download = downloading.milliseconds();
  if (options.json) {
    std::cout << job_json(job, paths_of(options.outputs), seen) << '\n';
  } else {
    report_outputs(job, options.outputs);
    if (job.reused) std::cout << "\nthe mesh is that of an earlier job like this one\n";
    std::cout << '\n' << timing_report(job.timing, seen) << '\n' << mesh_report(*job.mesh);
  }
  return kDone;
}

int upload(const Options& options, const std::stop_token& stop) {
  Client client = client_of(options, stop);
  ProgressBar bar;
  const std::vector<UploadedVolume> volumes = upload_all(client, options, bar);
  const bool is_one = volumes.size() == 1 && volumes.front().volume;
  if (options.json) {
    std::cout << (is_one ? to_json(*volumes.front().volume) : to_json(volumes)) << '\n';
  }
  int status = kDone;
  for (const UploadedVolume& each : volumes) {
    // The bare id, for `$(isomesh upload ...)`.
    if (each.volume && !options.json) std::cout << each.volume->id << '\n';
    if (!each.problem) continue;
    const Error error = to_error(*each.problem);
    complain(error.with_detail(each.member + ": " + error.what()));
    status = kRefused;
  }
  return status;
}

int estimate(const Options& options, const std::stop_token& stop) {
  JobParameters parameters = options.parameters;
  parameters.volume = options.id;
  const Estimate estimate = client_of(options, stop).estimate(parameters);
  std::cout << (options.json ? to_json(estimate) + '\n' : estimate_report(estimate));
  return kDone;
}

int submit(const Options& options, const std::stop_token& stop) {
  JobParameters parameters = options.parameters;
  parameters.volume = options.id;
  const Job job = client_of(options, stop).submit(parameters, options.key);
  std::cout << (options.json ? to_json(job) : job.id) << '\n';
  return kDone;
}

void show(const Job& job, bool json) {
  std::cout << (json ? to_json(job) + '\n' : job_report(job));
}

// The status is 0 for every state of the job, because the question was answered.
int status(const Options& options, const std::stop_token& stop) {
  show(client_of(options, stop).job(options.id), options.json);
  return kDone;
}

int wait(const Options& options, const std::stop_token& stop) {
  Client client = client_of(options, stop);
  ProgressBar bar;
  const Job job = wait(client, options.id, bar);
  show(job, options.json);
  return status_of(job);
}

int fetch(const Options& options, const std::stop_token& stop) {
  Client client = client_of(options, stop);
  ProgressBar bar;
  const Stopwatch downloading;
  for (const Output& output : options.outputs) {
    fetch(client, options.id, output, bar, options.label);
  }
  const ClientTiming seen{.download = downloading.milliseconds()};
  const Job job = client.job(options.id);
  if (options.json) {
    std::cout << job_json(job, paths_of(options.outputs), seen) << '\n';
  } else if (job.mesh) {
    report_outputs(job, options.outputs);
  }
  return kDone;
}

int cancel(const Options& options, const std::stop_token& stop) {
  Client client = client_of(options, stop);
  client.cancel(options.id);
  const Job job = client.job(options.id);
  if (options.json) {
    std::cout << to_json(job) << '\n';
  } else {
    // A job that had ended stays as it was, and one that runs takes a moment to stop.
    std::cout << (is_final(job.state) ? to_string(job.state) : "stopping") << ' ' << job.id << '\n';
  }
  return kDone;
}

int list(const Options& options, const std::stop_token& stop) {
  Client client = client_of(options, stop);
  if (options.volumes) {
    const auto volumes = client.volumes();
    std::cout << (options.json ? to_json(volumes) + '\n' : volume_list(volumes));
  } else {
    const JobPage page = client.jobs(options.state, options.cursor);
    std::cout << (options.json ? to_json(page.jobs, page.next) + '\n' : job_list(page.jobs));
    if (!options.json && !page.next.empty()) {
      std::cerr << "There are more: --cursor " << page.next << '\n';
    }
  }
  return kDone;
}

int info(const Options& options, const std::stop_token& stop) {
  Client client = client_of(options, stop);
  const Volume volume = client.volume(options.id);
  if (options.json) {
    std::cout << to_json(volume) << '\n';
  } else {
    constexpr std::uint32_t kColumns = 64;
    std::cout << volume_report(volume) << histogram_report(client.histogram(options.id, kColumns));
  }
  return kDone;
}

int labels(const Options& options, const std::stop_token& stop) {
  const VolumeLabels labels = client_of(options, stop).labels(options.id, options.background);
  std::cout << (options.json ? to_json(labels) + '\n' : label_list(labels));
  return kDone;
}

int rename(const Options& options, const std::stop_token& stop) {
  const auto name = options.name.empty() ? std::nullopt : std::optional(options.name);
  const Volume volume = client_of(options, stop).rename_volume(options.id, name);
  std::cout << (options.json ? to_json(volume) : volume.id) << '\n';
  return kDone;
}

int dispatch(const Options& options, const std::stop_token& stop) {
  switch (options.command) {
    case Command::kMesh:
      return mesh(options, stop);
    case Command::kUpload:
      return upload(options, stop);
    case Command::kEstimate:
      return estimate(options, stop);
    case Command::kSubmit:
      return submit(options, stop);
    case Command::kStatus:
      return status(options, stop);
    case Command::kWait:
      return wait(options, stop);
    case Command::kFetch:
      return fetch(options, stop);
    case Command::kCancel:
      return cancel(options, stop);
    case Command::kRename:
      return rename(options, stop);
    case Command::kList:
      return list(options, stop);
    case Command::kInfo:
      return info(options, stop);
    case Command::kLabels:
      return labels(options, stop);
  }
  return kWrongUsage;
}

// A malformed server address or token is wrong usage; every other parameter that is refused was
// refused by the server.
void check_server(const Options& options) { client_of(options, {}); }

}  // namespace

int run(const Options& options, const std::stop_token& stop) {
  try {
    check_server(options);
  } catch (const Error& error) {
    complain(error.what());
    return kWrongUsage;
  }
  try {
    return dispatch(options, stop);
  } catch (const Error& error) {
    complain(error);
    return error.code() == ErrorCode::kUnreachable ? kServerUnreachable : kRefused;
  }
}

}  // namespace isomesh::cli
