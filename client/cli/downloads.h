// Meshes on their way to files, pipes and standard output; private to this folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/options.h"
#include "client/cli/progress_bar.h"
#include "client/isomesh/client.h"

namespace isomesh::cli {

void fetch(Client& client, const std::string& id, const Output& output, ProgressBar& bar,
           std::optional<std::int64_t> label = std::nullopt);

// The files with their sizes, one per line. `label`: the one that was fetched, if not all.
std::string outputs_report(const Job& job, const std::vector<Output>& outputs,
                           std::optional<std::int64_t> label = std::nullopt);
// All files that fetch() wrote.
std::vector<std::filesystem::path> paths_of(const Job& job, const std::vector<Output>& outputs,
                                            std::optional<std::int64_t> label = std::nullopt);

}  // namespace isomesh::cli
