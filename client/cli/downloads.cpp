#include "client/cli/downloads.h"

#include <fstream>
#include <iostream>
#include <iterator>

#include "client/cli/output_files.h"
#include "client/cli/run_folder.h"
#include "client/cli/text.h"

namespace isomesh::cli {
namespace {

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

}  // namespace

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

std::string outputs_report(const Job& job, const std::vector<Output>& outputs,
                           std::optional<std::int64_t> label) {
  std::string text;
  for (const Output& output : outputs) {
    if (output.is_stdout()) continue;
    const auto mesh = job.mesh->files.find(output.format);
    for (const std::filesystem::path& file : paths_of(job, {output}, label)) {
      text += file.string();
      const bool has_size = file == output.path && mesh != job.mesh->files.end();
      if (has_size) text += "  " + human_bytes(mesh->second.bytes);
      text += '\n';
    }
  }
  return text;
}

std::vector<std::filesystem::path> paths_of(const Job& job, const std::vector<Output>& outputs,
                                            std::optional<std::int64_t> label) {
  return files_of(outputs, job.parameters.labels && !label);
}

}  // namespace isomesh::cli
