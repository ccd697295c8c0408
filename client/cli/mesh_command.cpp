#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <set>
#include <thread>
#include <utility>

#include "base/ids.h"
#include "client/cli/batch.h"
#include "client/cli/commands.h"
#include "client/cli/console.h"
#include "client/cli/downloads.h"
#include "client/cli/exit_status.h"
#include "client/cli/ids.h"
#include "client/cli/job_end.h"
#include "client/cli/option_groups.h"
#include "client/cli/output_files.h"
#include "client/cli/progress_bar.h"
#include "client/cli/report.h"
#include "client/cli/uploads.h"
#include "proto/json.h"
#include "proto/notes.h"

namespace isomesh::cli {
namespace {

constexpr std::size_t kKeyBytes = 16;

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

Error overwriting(const RunFiles::Clash& clash, const std::string& member) {
  const std::string file = clash.file.string();
  return Error(ErrorCode::kInvalidParameter,
               (clash.owner.empty() ? "the mesh would overwrite the volume " + file
                                    : "two meshes would be written to " + file) +
                   ": --member takes one of the volumes")
      .with_remedy({.choices = {{"member", member, ""}}});
}

// One volume is needed. Several that look like labels may be the masks of one scan.
Error one_of(const std::vector<UploadedVolume>& volumes) {
  const Error error = several_volumes(volumes);
  const std::string_view advice = describe(NoteCode::kLooksLikeLabels).name;
  const bool are_labels = std::ranges::all_of(volumes, [&](const UploadedVolume& each) {
    return each.volume && std::ranges::count(each.volume->notes, advice, &Note::code) > 0;
  });
  if (!are_labels) return error;
  return error.with_detail(std::string(error.what()) +
                           "; if they are masks, --masks makes one surface of each in one mesh");
}

// The volumes that a dry run has stored. They are deleted when all inputs have ended, because
// several inputs may be the same volume. Thread safe.
class Leftovers {
 public:
  explicit Leftovers(const Options& options) : options_(options) {}
  ~Leftovers() {
    for (const std::string& id : ids_) {
      try {
        parting_client(options_).erase_volume(id);
      } catch (const Error& error) {
        complain("the volume " + id + " could not be deleted: " + error.what());
      }
    }
  }
  Leftovers(const Leftovers&) = delete;
  Leftovers& operator=(const Leftovers&) = delete;

  void add(const std::vector<UploadedVolume>& uploaded) {
    constexpr int kCreated = 201;
    const std::scoped_lock lock(mutex_);
    for (const UploadedVolume& each : uploaded) {
      if (each.volume && each.status == kCreated) ids_.insert(each.volume->id);
    }
  }

 private:
  const Options& options_;
  std::mutex mutex_;
  std::set<std::string> ids_;
};

// Processes one input at a time: uploads it, meshes it and downloads the mesh. One object per
// thread.
class MeshRun {
 public:
  MeshRun(const Options& options, const std::stop_token& stop, bool is_one_of_many,
          RunFiles& run_files, Leftovers& leftovers);

  // Returns the exit status. Throws Error as Client does, and Lost.
  int input(const Input& input);

 private:
  // One mesh of an input. `subject` begins messages; empty if there is only one.
  struct Task {
    OutputNames names;
    Origin origin;
    std::string subject;
  };

  int members(const Input& input, std::vector<UploadedVolume> volumes);
  int stored(const std::string& id, const Input& input);
  Task task_of(const Input& input) const;
  Task task_of(const Input& input, const OutputNames& names, const std::string& member) const;
  int mesh(const Volume& volume, const Task& task);
  std::optional<Job> made(const JobParameters& parameters);
  void resumable(const std::string& job, const std::function<void()>& step);
  int dry_run(const JobParameters& parameters, const Task& task);
  bool is_by_labels() const { return options_.parameters.labels.has_value(); }
  void report(const Job& job, const std::vector<Output>& outputs, const Task& task);

  const Options& options_;
  const std::stop_token stop_;
  RunFiles& run_files_;
  Leftovers& leftovers_;
  const bool is_one_of_many_;
  Client client_;
  ProgressBar bar_;
  ClientTiming seen_;
};

MeshRun::MeshRun(const Options& options, const std::stop_token& stop, bool is_one_of_many,
                 RunFiles& run_files, Leftovers& leftovers)
    : options_(options),
      stop_(stop),
      run_files_(run_files),
      leftovers_(leftovers),
      is_one_of_many_(is_one_of_many),
      client_(client_of(options, stop)),
      bar_(!options.quiet && (!is_one_of_many || options.jobs == 1)) {}

int MeshRun::input(const Input& input) {
  seen_ = {};
  UploadOptions how = options_.upload;
  std::vector<std::filesystem::path> files = input.files;
  const auto copy = standard_input_as_file(files, stop_);
  if (is_stored_volume(files.front())) return stored(files.front().string(), input);
  const Task task = task_of(input);
  const auto uploading = std::chrono::steady_clock::now();
  const std::vector<UploadedVolume> volumes =
      upload_all(client_, options_, files, how, bar_, task.subject);
  seen_.upload = milliseconds_since(uploading);
  if (options_.dry_run) leftovers_.add(volumes);
  if (volumes.size() == 1 && volumes.front().volume) return mesh(*volumes.front().volume, task);
  if (!is_by_name(options_.outputs)) throw one_of(volumes);
  return members(input, volumes);
}

// A member that cannot be meshed does not keep the others from it.
int MeshRun::members(const Input& input, std::vector<UploadedVolume> volumes) {
  int status = kDone;
  const auto refuse = [&](const Error& error, const UploadedVolume& which) {
    const Task task = task_of(input, input.names, which.member);
    complain(error, task.subject);
    if (options_.json) print_json(failure_json(error, task.origin));
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
      const Task task = task_of(input, names[n], each.member);
      if (const auto clash = run_files_.take(outputs, task.subject)) {
        throw overwriting(*clash, each.member);
      }
      const std::vector<std::filesystem::path> files = files_of(outputs, is_by_labels());
      if (options_.skip_existing && is_up_to_date(input, files)) {
        if (options_.json) print_json(skipped_json(files, task.origin));
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
  tell_notes(found.notes, options_, task.subject);
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
  if (options_.dry_run) return dry_run(parameters, task);

  const std::optional<Job> job = made(parameters);
  if (!job) return kRefused;
  if (!has_mesh(*job, options_)) {
    if (options_.json) print_json(job_json(*job, {}, seen_, task.origin));
    return status_of(*job, options_, task.subject);
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
  options_.json ? print_json(with_origin(to_json(estimate), task.origin))
                : print(title + estimate_report(estimate));
  return kDone;
}

void MeshRun::report(const Job& job, const std::vector<Output>& outputs, const Task& task) {
  if (options_.json) return print_json(job_json(job, paths_of(job, outputs), seen_, task.origin));
  if (options_.quiet) return;
  const bool has_mesh_on_stdout = std::ranges::any_of(outputs, &Output::is_stdout);
  if (has_mesh_on_stdout) return tell_notes(job.mesh->notes, options_, task.subject);
  std::string text = outputs_report(job, outputs);
  if (is_one_of_many_) {
    tell_notes(job.mesh->notes, options_, task.subject);
  } else {
    if (job.reused) text += "\nthe mesh was reused from an identical earlier job\n";
    text +=
        '\n' + timing_report(job.timing, seen_) + '\n' +
        mesh_report(*with_labels(client_, job).mesh, unit_of(client_, job), job.parameters.inside);
  }
  print(text);
}

int mesh_all(const Options& options, const std::vector<Input>& inputs, const std::stop_token& stop,
             RunFiles& run_files, Leftovers& leftovers) {
  std::atomic<std::size_t> next = 0;
  std::atomic<int> worst = kDone;
  std::atomic<std::size_t> failed = 0;
  std::atomic<bool> is_lost = false;
  const auto fail = [&](const Error& error, const Input& input) {
    complain(error, input.names.name);
    if (options.json) {
      print_json(failure_json(error, {.input = input.files.front().string()}));
    }
    return status_of(error);
  };
  const auto work = [&] {
    MeshRun run(options, stop, true, run_files, leftovers);
    for (std::size_t at = next++; at < inputs.size() && !stop.stop_requested(); at = next++) {
      int status = kDone;
      try {
        status = run.input(inputs[at]);
      } catch (const Lost& error) {
        is_lost = true;
        status = fail(error, inputs[at]);
      } catch (const Error& error) {
        status = fail(error, inputs[at]);
      }
      if (status == kDone) continue;
      ++failed;
      for (int before = worst; status > before && !worst.compare_exchange_weak(before, status);) {
      }
    }
  };
  {
    std::vector<std::jthread> threads;
    const auto count = std::min<std::size_t>(static_cast<std::size_t>(options.jobs), inputs.size());
    for (std::size_t n = 1; n < count; ++n) threads.emplace_back(work);
    work();
  }
  if (stop.stop_requested()) return kRefused;
  if (failed > 0) {
    complain(std::to_string(failed) + " of " + std::to_string(inputs.size()) + " inputs failed");
  }
  if (worst == kServerUnreachable && !is_lost && !options.is_local) suggest_local();
  return worst;
}

// Leaves out the inputs whose outputs are newer.
void skip_existing(std::vector<Input>& inputs, const Options& options) {
  const std::size_t all = inputs.size();
  std::erase_if(inputs, [&](const Input& input) {
    const std::vector<std::filesystem::path> files =
        files_of(filled(options.outputs, input.names), options.parameters.labels.has_value());
    if (!is_up_to_date(input, files)) return false;
    if (options.json) {
      print_json(skipped_json(files, {.input = input.files.front().string()}));
    }
    return true;
  });
  if (options.quiet) return;
  complain("skipped " + std::to_string(all - inputs.size()) + " of " + std::to_string(all) +
           (all == 1 ? " input, whose mesh is newer" : " inputs, whose meshes are newer"));
}

}  // namespace

int mesh(const Options& options, const std::stop_token& stop) {
  std::vector<Input> inputs = inputs_of(options);
  RunFiles run_files(options, inputs);
  const bool is_one = inputs.size() == 1;
  if (options.skip_existing) skip_existing(inputs, options);
  if (inputs.empty()) return kDone;
  Leftovers leftovers(options);
  if (!is_one) return mesh_all(options, inputs, stop, run_files, leftovers);
  return MeshRun(options, stop, false, run_files, leftovers).input(inputs.front());
}

}  // namespace isomesh::cli
