#include "client/cli/mesh_run.h"

#include <algorithm>
#include <chrono>
#include <iostream>
#include <utility>

#include "base/ids.h"
#include "client/cli/commands.h"
#include "client/cli/console.h"
#include "client/cli/ids.h"
#include "client/cli/standard_input.h"
#include "proto/json.h"

namespace isomesh::cli {
namespace {

constexpr std::size_t kKeyBytes = 16;

// For the last requests, also after an interrupt. The time limits are short, because the user
// waits.
Client parting_client(const Options& options) {
  return Client({.server = options.server,
                 .token = options.token,
                 .authorities = options.authorities,
                 .connect_timeout = std::chrono::seconds{2},
                 .silence_timeout = std::chrono::seconds{5},
                 .retry_timeout = std::chrono::seconds{2}});
}

// Cancels the job with that key, which may not have come to the server yet. `id` is empty if it is
// not known.
void cancel_after_stop(const Options& options, const JobParameters& parameters,
                       const std::string& key, std::string id) {
  Client client = parting_client(options);
  try {
    if (id.empty()) id = client.submit(parameters, key).id;
    const JobState state = client.cancel(id).state;
    const bool had_ended = state == JobState::kSucceeded || state == JobState::kFailed;
    complain("interrupted; the job " + id + (had_ended ? " had already ended" : " was cancelled"));
  } catch (const Error& error) {
    complain("interrupted; the job " + (id.empty() ? "" : id + ' ') +
             "could not be cancelled: " + error.what());
  }
}

Error overwriting(const OutputNames& names, const std::string& member) {
  return Error(ErrorCode::kInvalidParameter,
               "two meshes would be called " + names.name + ": --member takes one of the volumes")
      .with_remedy({.choices = {{"member", member, ""}}});
}

}  // namespace

void Leftovers::add(const std::vector<UploadedVolume>& uploaded) {
  constexpr int kCreated = 201;
  const std::scoped_lock lock(mutex_);
  for (const UploadedVolume& each : uploaded) {
    if (each.volume && each.status == kCreated) ids_.insert(each.volume->id);
  }
}

Leftovers::~Leftovers() {
  for (const std::string& id : ids_) {
    try {
      parting_client(options_).erase_volume(id);
    } catch (const Error& error) {
      complain("the volume " + id + " could not be deleted: " + error.what());
    }
  }
}

void print(const std::string& text) {
  static std::mutex mutex;
  const std::scoped_lock lock(mutex);
  std::cout << text << std::flush;
}

MeshRun::MeshRun(const Options& options, const std::stop_token& stop, bool is_one_of_many,
                 TakenOutputs& taken, Leftovers& leftovers)
    : options_(options),
      stop_(stop),
      taken_(taken),
      leftovers_(leftovers),
      is_one_of_many_(is_one_of_many),
      client_(client_of(options, stop)),
      bar_(!options.quiet && (!is_one_of_many || options.jobs == 1)) {}

int MeshRun::input(const Input& input) {
  seen_ = {};
  UploadOptions how = options_.upload;
  std::vector<std::filesystem::path> files = input.files;
  const auto copy = standard_input_as_file(files, how, stop_);
  if (is_stored_volume(files.front())) return stored(files.front().string(), input);
  const Task task = task_of(input);
  const auto uploading = std::chrono::steady_clock::now();
  const std::vector<UploadedVolume> volumes =
      upload_all(client_, options_, files, how, bar_, task.subject);
  seen_.upload = milliseconds_since(uploading);
  if (options_.dry_run) leftovers_.add(volumes);
  if (volumes.size() == 1 && volumes.front().volume) return mesh(*volumes.front().volume, task);
  if (!is_by_name(options_.outputs)) throw several_volumes(volumes);
  return members(input, volumes);
}

// A member that cannot be meshed does not keep the others from it.
int MeshRun::members(const Input& input, std::vector<UploadedVolume> volumes) {
  int status = kDone;
  const auto refuse = [&](const Error& error, const UploadedVolume& which) {
    const Task task = task_of(input, input.names, which.member);
    complain(error, task.subject);
    if (options_.json) print(failure_json(error, task.origin) + '\n');
    status = std::max(status, status_of(error));
  };
  for (const UploadedVolume& each : volumes) {
    if (each.problem) refuse(to_error(*each.problem), each);
  }
  std::erase_if(volumes, [](const UploadedVolume& each) { return each.problem.has_value(); });
  std::vector<std::string> members;
  members.reserve(volumes.size());
  for (const UploadedVolume& each : volumes) members.push_back(each.member);
  const std::vector<OutputNames> names = names_of_members(input.names, members);
  for (std::size_t n = 0; n < volumes.size() && !stop_.stop_requested(); ++n) {
    const UploadedVolume& each = volumes[n];
    const std::vector<Output> outputs = filled(options_.outputs, names[n]);
    try {
      if (!taken_.take(outputs)) throw overwriting(names[n], each.member);
      const Task task = task_of(input, names[n], each.member);
      if (options_.skip_existing && is_up_to_date(input, outputs)) {
        if (options_.json) print(skipped_json(paths_of(outputs), task.origin) + '\n');
        if (!options_.quiet) complain(task.subject + ": skipped: its mesh is newer");
        continue;
      }
      status = std::max(status, mesh(*each.volume, task));
    } catch (const Error& error) {
      if (error.code() == ErrorCode::kUnreachable || stop_.stop_requested()) throw;
      refuse(error, each);
    }
  }
  return status;
}

int MeshRun::stored(const std::string& id, const Input& input) {
  const Task task = task_of(input);
  const Volume found = client_.volume(volume_id(client_, id));
  if (!options_.quiet) tell_notes(found, task.subject);
  return mesh(found, task);
}

MeshRun::Task MeshRun::task_of(const Input& input) const {
  return {.names = input.names,
          .origin = {.input = input.files.front().string()},
          .subject = is_one_of_many_ ? input.names.name : ""};
}

MeshRun::Task MeshRun::task_of(const Input& input, const OutputNames& names,
                               const std::string& member) const {
  return {.names = names,
          .origin = {.input = input.files.front().string(), .member = member},
          .subject = input.names.name + ": " + member};
}

int MeshRun::mesh(const Volume& volume, const Task& task) {
  const std::vector<Output> outputs = filled(options_.outputs, task.names);
  JobParameters parameters = options_.parameters;
  parameters.volume = volume.id;
  if (!outputs.empty()) parameters.formats = formats_of(outputs);
  if (!options_.preset.empty()) parameters.iso = preset_of(volume, options_.preset);
  if (options_.dry_run) return dry_run(parameters, task);

  const std::optional<Job> job = made(parameters);
  if (!job) return kRefused;
  if (!has_mesh(*job, options_)) {
    if (options_.json) print(job_json(*job, {}, seen_, task.origin) + '\n');
    return status_of(*job, options_, task.subject, volume.range);
  }
  const auto downloading = std::chrono::steady_clock::now();
  resumable(job->id, [&] {
    for (const Output& output : outputs) fetch(client_, job->id, output, bar_);
  });
  seen_.download = milliseconds_since(downloading);
  report(*job, outputs, task);
  return kDone;
}

// Returns the job when it has ended; empty after an interrupt.
std::optional<Job> MeshRun::made(const JobParameters& parameters) {
  const std::string key = random_hex(kKeyBytes);
  std::optional<Job> job;
  try {
    job = client_.submit(parameters, key);
    resumable(job->id, [&] { job = wait(client_, job->id, bar_); });
    return job;
  } catch (const Error&) {
    bar_.clear();
    if (!stop_.stop_requested()) throw;
    cancel_after_stop(options_, parameters, key, job ? job->id : "");
    return std::nullopt;
  }
}

// If the server is lost, the job continues there; the error says how to resume.
void MeshRun::resumable(const std::string& job, const std::function<void()>& step) {
  try {
    step();
  } catch (const Error& error) {
    bar_.clear();
    if (error.code() != ErrorCode::kUnreachable || options_.is_local) throw;
    const std::string command = "isomesh --server " + options_.server;
    throw Lost(std::string(error.what()) + "\nThe server has accepted the job " + job +
               " and continues it. To resume:\n  " + command + " wait " + job + "\n  " + command +
               " fetch " + job + " -o OUT");
  }
}

int MeshRun::dry_run(const JobParameters& parameters, const Task& task) {
  const Estimate estimate = client_.estimate(parameters);
  const std::string title = task.subject.empty() ? "" : task.names.name + '\n';
  print(options_.json ? with_origin(to_json(estimate), task.origin) + '\n'
                      : title + estimate_report(estimate));
  return kDone;
}

void MeshRun::report(const Job& job, const std::vector<Output>& outputs, const Task& task) {
  if (options_.json) return print(job_json(job, paths_of(outputs), seen_, task.origin) + '\n');
  const bool has_mesh_on_stdout = std::ranges::any_of(outputs, &Output::is_stdout);
  if (options_.quiet || has_mesh_on_stdout) return;
  std::string text = outputs_report(job, outputs);
  if (!is_one_of_many_) {
    if (job.reused) text += "\nthe mesh was reused from an identical earlier job\n";
    text += '\n' + timing_report(job.timing, seen_) + '\n' +
            mesh_report(*with_labels(client_, job).mesh, unit_of(client_, job));
  }
  print(text);
}

}  // namespace isomesh::cli
