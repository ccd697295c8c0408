#include "client/cli/console.h"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <mutex>
#include <span>

#include <unistd.h>

#include "base/text.h"
#include "client/cli/commands.h"
#include "client/cli/parameter_options.h"
#include "client/cli/report.h"
#include "client/cli/run_folder.h"
#include "client/cli/text.h"
#include "client/isomesh/package.h"
#include "proto/parameters.h"

namespace isomesh::cli {
namespace {

std::mutex& console_mutex() {
  static std::mutex mutex;
  return mutex;
}

Error reason_of(const Job& job) {
  if (job.error) return to_error(*job.error);
  return {ErrorCode::kCancelled, "the job was cancelled"};
}

std::string why_empty(const Job& job, const std::optional<SampleRange>& range) {
  const MeshSummary& mesh = *job.mesh;
  if (mesh.dropped.components > 0) return "all of its components were dropped";
  const std::string nothing =
      job.parameters.crop ? " no surface in the box of --crop" : " no surface";
  if (!mesh.iso) return "the labels have" + nothing;
  std::string reason = "the volume has" + nothing + " at the iso-value " + human_number(*mesh.iso);
  if (range && !job.parameters.crop) {
    reason += "; its samples range from " + human_number((*range)[0]) + " to " +
              human_number((*range)[1]);
  }
  return reason;
}

// "Soft tissue" and "soft-tissue" are "soft tissue".
std::string folded(const std::string& name) {
  std::string text = lower(name);
  std::ranges::replace(text, '-', ' ');
  std::ranges::replace(text, '_', ' ');
  return text;
}

std::string files_in_words(const std::vector<PackedFile>& files) {
  return grouped(files.size()) + (files.size() == 1 ? " file" : " files");
}

// The folder's content may differ from its name.
void tell_folders(const std::vector<std::filesystem::path>& files) {
  for (const std::filesystem::path& path : files) {
    std::error_code error;
    if (!std::filesystem::is_directory(path, error)) continue;
    const std::vector<PackedFile> sent = files_of_upload(path);
    std::uint64_t bytes = 0;
    for (const PackedFile& file : sent) bytes += std::filesystem::file_size(file.path, error);
    complain("sending " + files_in_words(sent) + " of " + path.string() + ", " +
             human_bytes(bytes));
  }
}

// Downloads to a file first, so that only a complete mesh is written.
void fetch_to_pipe(Client& client, const std::string& id, const Output& output, ProgressBar& bar,
                   std::optional<std::int64_t> label) {
  const RunFolder folder;
  const std::filesystem::path file = folder.path() / "mesh";
  fetch(client, id, {file, output.format}, bar, label);
  std::ifstream mesh(file, std::ios::binary);
  std::ofstream pipe;
  if (!output.is_stdout()) pipe.open(output.path, std::ios::binary);
  std::ostream& out = output.is_stdout() ? std::cout : pipe;
  std::vector<char> block(std::size_t{1} << 20);
  while (out && (mesh.read(block.data(), std::ssize(block)) || mesh.gcount() > 0)) {
    out.write(block.data(), mesh.gcount());
  }
  if (!out.flush() || mesh.bad()) {
    const std::string name = output.is_stdout() ? "standard output" : output.path.string();
    throw Error(ErrorCode::kInvalidParameter, name + " cannot be written to");
  }
}

// For a folder that -o names with a slash at its end, or through {folder}.
void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  if (!folder.empty()) std::filesystem::create_directories(folder, error);
  if (error) {
    throw Error(ErrorCode::kInvalidParameter,
                "the folder " + folder.string() + " cannot be created: " + error.message());
  }
}

// A person sees why nothing happens. Once, because with --jobs many requests wait.
void tell_wait(const Error& reason, int seconds) {
  static std::atomic<bool> is_told = false;
  if (::isatty(STDERR_FILENO) != 1 || is_told.exchange(true)) return;
  // The line of a progress bar may be there.
  std::cerr << "\r\x1b[K";
  complain("the server is busy (" + std::string(reason.what()) + "); trying again for up to " +
           human_duration(1000.0 * seconds));
}

bool is_busy(const Error& error) {
  return error.code() == ErrorCode::kTooManyRequests || error.code() == ErrorCode::kUnavailable;
}

}  // namespace

Client client_of(const Options& options, const std::stop_token& stop) {
  ClientOptions client{.server = options.server,
                       .token = options.token,
                       .authorities = options.authorities,
                       .retry_timeout = std::chrono::seconds(options.retry_seconds),
                       .stop = stop};
  if (!options.quiet) {
    client.busy = [seconds = options.retry_seconds](const Error& reason,
                                                    std::chrono::milliseconds) {
      tell_wait(reason, seconds);
    };
  }
  return Client(std::move(client));
}

void complain(const std::string& message) {
  const std::scoped_lock lock(console_mutex());
  std::cerr << "isomesh: " << printable_lines(message) << '\n';
}

void complain(const Error& error, const std::string& subject) {
  const std::string remedy = remedy_report(error.remedy());
  std::string text = subject + (subject.empty() ? "" : ": ") + in_options(error);
  if (is_busy(error)) text += "; try again later, or wait longer with --retry-seconds";
  const std::scoped_lock lock(console_mutex());
  std::cerr << "isomesh: " << printable_lines(text) << '\n' << remedy;
}

void suggest_local() {
  complain("check --server, start isomeshd, or use `isomesh local`, which needs no server");
}

int status_of(const Error& error) {
  return error.code() == ErrorCode::kUnreachable ? kServerUnreachable : kRefused;
}

bool has_mesh(const Job& job, const Options& options) {
  return job.state == JobState::kSucceeded && job.mesh && (!job.mesh->empty || options.allow_empty);
}

int status_of(const Job& job, const Options& options, const std::string& subject,
              const std::optional<SampleRange>& range) {
  if (job.state == JobState::kFailed || job.state == JobState::kCancelled) {
    complain(reason_of(job), subject);
    return kRefused;
  }
  if (!job.mesh || !job.mesh->empty || options.allow_empty) return kDone;
  complain((subject.empty() ? "" : subject + ": ") +
           "the surface is empty: " + why_empty(job, range) + "; --allow-empty accepts that");
  return kRefused;
}

void tell_notes(const Volume& volume, const std::string& subject) {
  for (const Note& note : volume.notes) {
    complain((subject.empty() ? "" : subject + ": ") + "note: " + with_options(note.detail) + " (" +
             note.code + ")");
  }
}

Job wait(Client& client, const std::string& id, ProgressBar& bar) {
  const JobProgress draw = [&](const Job& job) { bar.job(job); };
  Job job = client.wait(id, bar.visible() ? draw : JobProgress{});
  bar.clear();
  return job;
}

Job with_labels(Client& client, Job job) {
  if (job.mesh && job.mesh->labels_count) job.mesh->labels = client.job_labels(job.id);
  return job;
}

LengthUnit unit_of(Client& client, const Job& job) {
  try {
    return length_unit(client.volume(job.parameters.volume).notes);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNotFound) throw;
    return length_unit({});
  }
}

void fetch(Client& client, const std::string& id, const Output& output, ProgressBar& bar,
           std::optional<std::int64_t> label) {
  if (output.is_stdout() || is_pipe(output.path)) {
    return fetch_to_pipe(client, id, output, bar, label);
  }
  make_folder(output.path.parent_path());
  client.fetch(
      id, output.format, output.path,
      [&](std::uint64_t done, std::uint64_t total) { bar.transfer("download", done, total); },
      label);
  bar.clear();
}

std::vector<UploadedVolume> upload_all(Client& client, const Options& options,
                                       const std::vector<std::filesystem::path>& files,
                                       const UploadOptions& how, ProgressBar& bar,
                                       const std::string& subject) {
  if (!options.quiet) tell_folders(files);
  UploadOptions watched = how;
  watched.progress = [&](std::uint64_t done, std::uint64_t total) {
    bar.transfer(done < total ? "upload" : "check", done, total);
  };
  std::vector<UploadedVolume> volumes = client.upload_all(files, watched);
  bar.clear();
  if (options.quiet) return volumes;
  for (const UploadedVolume& each : volumes) {
    if (!each.volume) continue;
    const bool has_both = !subject.empty() && volumes.size() > 1;
    tell_notes(*each.volume,
               subject + (has_both ? ": " : "") + (volumes.size() > 1 ? each.member : ""));
  }
  return volumes;
}

double preset_of(const Volume& volume, const std::string& name) {
  std::vector<std::string> names;
  for (const Preset& preset : volume.presets) {
    if (folded(preset.name) == folded(name)) return preset.iso;
    names.push_back('"' + preset.name + '"');
  }
  const std::string has = names.empty()
                              ? "it has none. Only CTs in Hounsfield units and fractional "
                                "segmentations have presets, and only for values that occur in them"
                              : "it has " + listed(names);
  throw Error(ErrorCode::kInvalidParameter,
              "--iso: the volume has no preset \"" + name + "\"; " + has);
}

std::string outputs_report(const Job& job, const std::vector<Output>& outputs) {
  std::string text;
  for (const Output& output : outputs) {
    if (output.is_stdout()) continue;
    const auto file = job.mesh->files.find(output.format);
    text += output.path.string();
    if (file != job.mesh->files.end()) text += "  " + human_bytes(file->second.bytes);
    text += '\n';
  }
  return text;
}

std::vector<std::filesystem::path> paths_of(const std::vector<Output>& outputs) {
  std::vector<std::filesystem::path> paths;
  paths.reserve(outputs.size());
  for (const Output& output : outputs) paths.push_back(output.path);
  return paths;
}

}  // namespace isomesh::cli
