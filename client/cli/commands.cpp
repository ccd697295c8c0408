#include "client/cli/commands.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <thread>
#include <utility>

#include "client/cli/batch.h"
#include "client/cli/console.h"
#include "client/cli/downloads.h"
#include "client/cli/exit_status.h"
#include "client/cli/ids.h"
#include "client/cli/job_end.h"
#include "client/cli/local_daemon.h"
#include "client/cli/option_groups.h"
#include "client/cli/progress_bar.h"
#include "client/cli/report.h"
#include "client/cli/uploads.h"
#include "client/isomesh/client.h"
#include "client/isomesh/file.h"
#include "proto/json.h"

namespace isomesh::cli {
namespace {

int upload(Client& client, const Options& options, const std::stop_token& stop) {
  ProgressBar bar(!options.quiet);
  UploadOptions how = options.upload;
  std::vector<std::filesystem::path> files = options.files;
  const auto copy = standard_input_as_file(files, stop);
  const std::vector<UploadedVolume> volumes = upload_all(client, options, files, how, bar);
  const bool is_one = volumes.size() == 1 && volumes.front().volume;
  if (options.json) {
    print_json(is_one ? to_json(*volumes.front().volume) : to_json(volumes));
  }
  int status = kDone;
  for (const UploadedVolume& each : volumes) {
    // The bare id, for `$(isomesh upload ...)`.
    if (each.volume && !options.json) print(each.volume->id + '\n');
    if (!each.problem) continue;
    const Error error = to_error(*each.problem);
    complain(error.with_detail(each.member + ": " + error.what()));
    status = kRefused;
  }
  return status;
}

JobParameters parameters_of(const Options& options, Client& client) {
  JobParameters parameters = options.parameters;
  parameters.volume = volume_id(client, options.id);
  return parameters;
}

int estimate(Client& client, const Options& options) {
  const Estimate estimate = client.estimate(parameters_of(options, client));
  options.json ? print_json(to_json(estimate)) : print(estimate_report(estimate));
  return kDone;
}

int submit(Client& client, const Options& options) {
  const Job job = client.submit(parameters_of(options, client), options.key);
  options.json ? print_json(to_json(job)) : print(job.id + '\n');
  return kDone;
}

void show(Client& client, const Job& job, bool json) {
  if (json) return print_json(to_json(job));
  const LengthUnit unit = job.mesh ? unit_of(client, job) : length_unit({});
  print(job_report(with_labels(client, job), unit));
}

// Returns 0 for every state of the job.
int status(Client& client, const Options& options) {
  show(client, client.job(job_id(client, options.id)), options.json);
  return kDone;
}

int wait(Client& client, const Options& options) {
  ProgressBar bar(!options.quiet);
  const Job job = wait(client, job_id(client, options.id), bar);
  if (!options.quiet || options.json) show(client, job, options.json);
  return status_of(job, options);
}

int fetch(Client& client, const Options& options) {
  ProgressBar bar(!options.quiet);
  const std::string id = job_id(client, options.id);
  const std::vector<Output> outputs = filled(options.outputs, {id});
  const Job job = client.job(id);
  if (job.state == JobState::kSucceeded && !has_mesh(job, options)) {
    if (options.json) print_json(job_json(job, {}, {}));
    return status_of(job, options);
  }
  const auto start = std::chrono::steady_clock::now();
  for (const Output& output : outputs) fetch(client, id, output, bar, options.label);
  const ClientTiming seen{.download = milliseconds_since(start)};
  if (options.json) {
    print_json(job_json(job, paths_of(job, outputs, options.label), seen));
  } else if (job.mesh && !options.quiet) {
    print(outputs_report(job, outputs, options.label));
    tell_notes(job.mesh->notes, options, "");
  }
  return kDone;
}

void erase_job(Client& client, const std::string& id) {
  if (client.erase_job(job_id(client, id))) {
    throw Error(ErrorCode::kNotReady,
                "the job had not ended. It is cancelled now; repeat the "
                "command to delete it");
  }
}

int report(Client& client, const Options& options) {
  const std::string text = client.report(job_id(client, options.id));
  if (options.report.empty() || options.report == "-") {
    print_json(text);
  } else {
    PartFile file(options.report);
    file.write(text + '\n');
    file.publish();
  }
  return kDone;
}

// Deletes as many of them as possible and reports the others.
int erase(Client& client, const Options& options) {
  int status = kDone;
  for (const std::string& id : options.ids) {
    try {
      if (options.are_jobs) {
        erase_job(client, id);
      } else {
        client.erase_volume(volume_id(client, id), options.with_jobs);
      }
    } catch (const Error& error) {
      complain(error, id);
      status = std::max(status, status_of(error));
    }
  }
  return status;
}

int cancel(Client& client, const Options& options) {
  const Job job = client.cancel(job_id(client, options.id));
  if (options.json) {
    print_json(to_json(job));
  } else {
    // A job that had ended keeps its state, and one that runs takes a moment to stop.
    const auto state = is_final(job.state) ? to_string(job.state) : "stopping";
    print(std::string(state) + ' ' + job.id + '\n');
  }
  return kDone;
}

VolumeNames names_of_volumes(Client& client, const std::vector<Job>& jobs) {
  VolumeNames names;
  if (jobs.empty()) return names;
  for (const Volume& volume : client.volumes()) {
    if (volume.name) names[volume.id] = *volume.name;
  }
  return names;
}

int list(Client& client, const Options& options) {
  if (options.volumes) {
    const auto volumes = client.volumes();
    options.json ? print_json(to_json(volumes)) : print(volume_list(volumes));
  } else {
    JobFilter filter = options.filter;
    if (!filter.volume.empty()) filter.volume = volume_id(client, filter.volume);
    const JobPage page = client.jobs(filter, options.cursor);
    if (options.json) {
      print_json(to_json(page.jobs, page.next));
      return kDone;
    }
    print(job_list(page.jobs, names_of_volumes(client, page.jobs)));
    tell_next("isomesh list", page.next);
  }
  return kDone;
}

int info(Client& client, const Options& options) {
  const Volume volume = client.volume(volume_id(client, options.id));
  if (options.json) {
    print_json(to_json(volume));
  } else {
    constexpr std::uint32_t kColumns = 64;
    print(volume_report(volume) + histogram_report(client.histogram(volume.id, kColumns)));
  }
  return kDone;
}

int labels(Client& client, const Options& options) {
  const VolumeLabels labels = client.labels(volume_id(client, options.id), options.background);
  options.json ? print_json(to_json(labels)) : print(label_list(labels));
  return kDone;
}

int walls(Client& client, const Options& options) {
  const Job job = client.job(job_id(client, options.id));
  const std::vector<WallSummary> walls = client.job_walls(job.id, options.edge_contacts);
  options.json ? print_json(to_json(walls)) : print(wall_list(walls, unit_of(client, job)));
  return kDone;
}

// Replaces an error that speaks of a field and of null, which this command does not have.
Volume renamed(Client& client, const std::string& id, const std::optional<std::string>& name) {
  try {
    return client.rename_volume(id, name);
  } catch (const Error& error) {
    if (error.fields().empty() || error.fields().front().field != "name") throw;
    throw Error(error.code(),
                "NAME must have 1 to 255 bytes on one line, or be \"\", which removes the name");
  }
}

int rename(Client& client, const Options& options) {
  const auto name = options.name.empty() ? std::nullopt : std::optional(options.name);
  const std::string id = volume_id(client, options.id);
  const Volume volume = renamed(client, id, name);
  options.json ? print_json(to_json(volume)) : print(volume.id + '\n');
  return kDone;
}

int reorient(Client& client, const Options& options) {
  const Volume volume = client.reorient_volume(volume_id(client, options.id), options.axes);
  tell_notes(volume.notes, options, "");
  options.json ? print_json(to_json(volume)) : print(volume.id + '\n');
  return kDone;
}

int ids(Client& client, const Options& options) {
  const std::vector<Candidate> all = options.added_ids != nullptr
                                         ? options.added_ids->newest(client)
                                         : ids_of(client, options.kind);
  std::string lines;
  for (const Candidate& each : all) lines += each.id + '\n';
  print(lines);
  return kDone;
}

// For completions, which must be quick and say nothing on errors. A server that sends a byte now
// and then is not silent, so the whole has a time limit, too.
int complete(const Options& options, const std::stop_token& stop) {
  constexpr std::chrono::seconds kLongest{3};
  std::stop_source over;
  const std::stop_callback interrupted(stop, [&over] { over.request_stop(); });
  const std::jthread clock([&](const std::stop_token& done) {
    std::mutex mutex;
    std::unique_lock lock(mutex);
    const auto never = [] { return false; };
    std::condition_variable_any().wait_for(lock, done, kLongest, never);
    over.request_stop();
  });
  Client client({.server = options.server,
                 .token = options.token,
                 .authorities = options.authorities,
                 .connect_timeout = std::chrono::seconds{1},
                 .silence_timeout = std::chrono::seconds{2},
                 .retry_timeout = {},
                 .stop = over.get_token()});
  return ids(client, options);
}

struct CommandRow {
  Command command;
  int (*run)(Client& client, const Options& options);
};

constexpr std::array kCommands = {
    CommandRow{Command::kEstimate, estimate}, CommandRow{Command::kSubmit, submit},
    CommandRow{Command::kStatus, status},     CommandRow{Command::kWait, wait},
    CommandRow{Command::kFetch, fetch},       CommandRow{Command::kCancel, cancel},
    CommandRow{Command::kRename, rename},     CommandRow{Command::kErase, erase},
    CommandRow{Command::kReorient, reorient}, CommandRow{Command::kList, list},
    CommandRow{Command::kInfo, info},         CommandRow{Command::kLabels, labels},
    CommandRow{Command::kWalls, walls},       CommandRow{Command::kReport, report}};

int dispatch(const Options& options, const std::stop_token& stop) {
  if (options.command == Command::kMesh) return mesh(options, stop);
  if (options.command == Command::kIds) return complete(options, stop);
  Client client = client_of(options, stop);
  if (options.command == Command::kUpload) return upload(client, options, stop);
  if (options.added != nullptr) return options.added->run(client, options);
  return std::ranges::find(kCommands, options.command, &CommandRow::command)->run(client, options);
}

// A malformed server address or token is wrong usage. The server rejects all other parameters.
void check_server(const Options& options) { client_of(options, {}); }

int run_locally(Options options, const std::stop_token& stop) {
  try {
    const LocalDaemon daemon(options.daemon, options.jobs);
    options.server = daemon.url();
    options.token.clear();
    return dispatch(options, stop);
  } catch (const Error& error) {
    complain(error);
    return status_of(error);
  }
}

}  // namespace

int run(const Options& options, const std::stop_token& stop) {
  if (options.is_local) return run_locally(options, stop);
  try {
    check_server(options);
  } catch (const Error& error) {
    complain(error.what());
    return kWrongUsage;
  }
  try {
    return dispatch(options, stop);
  } catch (const Lost& error) {
    complain(error);
    return status_of(error);
  } catch (const Error& error) {
    complain(error);
    if (error.code() == ErrorCode::kUnreachable) suggest_local();
    return status_of(error);
  }
}

}  // namespace isomesh::cli
