#include "client/cli/output_files.h"

#include <system_error>

#include <sys/stat.h>

#include "base/files.h"
#include "client/isomesh/package.h"
#include "proto/error.h"

namespace isomesh::cli {
namespace {

namespace fs = std::filesystem;

// The same for all names of a file, through links of files and folders, whether it exists or not.
fs::path place_of_output(const fs::path& path) {
  std::error_code unknown;
  try {
    // The call makes no absolute path of a relative one that does not exist.
    const fs::path whole = fs::absolute(behind_links(path), unknown);
    const fs::path place = fs::weakly_canonical(whole, unknown);
    if (!unknown) return place;
  } catch (const Error&) {
    // A loop of links: writing it fails.
  }
  return fs::absolute(path, unknown).lexically_normal();
}

}  // namespace

std::vector<fs::path> files_of(const std::vector<Output>& outputs, bool is_by_labels) {
  std::vector<fs::path> files;
  for (const Output& output : outputs) {
    const bool is_file = !output.is_stdout() && !is_pipe(output.path);
    for (fs::path& file : files_of_mesh(output.path, output.format, is_by_labels && is_file)) {
      files.push_back(std::move(file));
    }
  }
  return files;
}

RunFiles::RunFiles(const Options& options, const std::vector<Input>& inputs)
    : is_by_labels_(options.parameters.labels.has_value()) {
  for (const Input& input : inputs) {
    for (const fs::path& path : input.files) add_volume(path);
  }
  for (const Input& input : inputs) {
    const std::string own = input.files.front().string();
    const auto clash = take(filled(options.outputs, input.names), own);
    if (!clash) continue;
    if (clash->owner.empty()) {
      wrong_usage("-o: the mesh would overwrite the volume " + clash->file.string());
    }
    wrong_usage("-o: " + clash->owner + " and " + own + " would both be written to " +
                clash->file.string() + "; use {folder} and {name}, or give them in two runs");
  }
}

std::optional<RunFiles::Clash> RunFiles::take(const std::vector<Output>& outputs,
                                              const std::string& owner) {
  std::vector<fs::path> places;
  const std::scoped_lock lock(mutex_);
  for (const Output& output : outputs) {
    if (output.is_stdout()) continue;
    for (const fs::path& file : files_of({output}, is_by_labels_)) {
      const std::optional<FileId> id = id_of(file);
      if (id && volumes_.contains(*id)) return Clash{file, {}};
      places.push_back(place_of_output(file));
      const auto taken = owners_.find(places.back());
      if (taken != owners_.end() && taken->second != owner) return Clash{file, taken->second};
    }
  }
  for (fs::path& place : places) owners_.emplace(std::move(place), owner);
  return std::nullopt;
}

std::optional<RunFiles::FileId> RunFiles::id_of(const fs::path& path) {
  struct stat status = {};
  if (::stat(path.c_str(), &status) != 0) return std::nullopt;
  return FileId{status.st_dev, status.st_ino};
}

void RunFiles::add_file(const fs::path& path) {
  if (const std::optional<FileId> id = id_of(path)) volumes_.insert(*id);
}

void RunFiles::add_volume(const fs::path& path) {
  std::error_code unknown;
  if (!fs::exists(path, unknown)) return;  // standard input, or a stored volume
  try {
    for (const PackedFile& file : files_of_upload(path)) add_file(file.path);
  } catch (const Error&) {
    // The upload of this input tells it. What can be found of it is not replaced either.
    add_file(path);
    for (fs::recursive_directory_iterator entry(path, unknown), end; !unknown && entry != end;
         entry.increment(unknown)) {
      add_file(entry->path());
    }
  }
}

}  // namespace isomesh::cli
