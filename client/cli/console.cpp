#include "client/cli/console.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <mutex>
#include <span>

#include <unistd.h>

#include "base/files.h"
#include "base/text.h"
#include "client/cli/commands.h"
#include "client/cli/parameter_options.h"
#include "client/cli/report.h"
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
void fetch_to_stdout(Client& client, const std::string& id, const Output& output, ProgressBar& bar,
                     std::optional<std::int64_t> label) {
  const ScratchFile file(temporary_folder(), ".mesh");
  fetch(client, id, {file.path(), output.format}, bar, label);
  std::ifstream mesh(file.path(), std::ios::binary);
  std::vector<char> block(std::size_t{1} << 20);
  while (std::cout && (mesh.read(block.data(), std::ssize(block)) || mesh.gcount() > 0)) {
    std::cout.write(block.data(), mesh.gcount());
  }
  if (!std::cout.flush() || mesh.bad()) {
    throw Error(ErrorCode::kInvalidParameter, "standard output cannot be written to");
  }
}

}  // namespace

Client client_of(const Options& options, const std::stop_token& stop) {
  return Client({.server = options.server,
                 .token = options.token,
                 .authorities = options.authorities,
                 .stop = stop});
}

std::filesystem::path temporary_folder() {
  std::error_code error;
  std::filesystem::path folder = std::filesystem::temp_directory_path(error);
  if (!error) return folder;
  std::string place = "/tmp";
  // The variables that the library looks at; it prefers the last of them.
  for (const std::string name : {"TEMPDIR", "TEMP", "TMP", "TMPDIR"}) {
    if (const char* const value = std::getenv(name.c_str())) place = name + '=' + value;
  }
  throw Error(ErrorCode::kInvalidParameter,
              "the folder for temporary files cannot be used: " + place + ": " + error.message() +
                  "; set TMPDIR to an existing folder");
}

void complain(const std::string& message) {
  const std::scoped_lock lock(console_mutex());
  std::cerr << "isomesh: " << printable_lines(message) << '\n';
}

void complain(const Error& error, const std::string& subject) {
  const std::string remedy = remedy_report(error.remedy());
  const std::string text = subject + (subject.empty() ? "" : ": ") + in_options(error);
  const std::scoped_lock lock(console_mutex());
  std::cerr << "isomesh: " << printable_lines(text) << '\n' << remedy;
}

void suggest_local() {
  complain("check --server, start isomeshd, or use `isomesh local`, which needs no server");
}

int status_of(const Error& error) {
  return error.code() == ErrorCode::kUnreachable ? kServerUnreachable : kRefused;
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
  if (output.is_stdout()) return fetch_to_stdout(client, id, output, bar, label);
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
