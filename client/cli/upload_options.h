// The options that select what to upload; private to this folder.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/options.h"

namespace isomesh::cli {

inline constexpr const char* kUploadGroup = "Upload";
inline constexpr const char* kRawGroup = "Raw samples";

// The kinds of objects that the argument FILE may name.
enum class Inputs { kFiles, kFilesAndVolumes };

// FILE and the options that select a volume in it.
void add_file(CLI::App& app, Options& options, Inputs inputs = Inputs::kFiles);

void add_raw(CLI::App& app, Options& options);

}  // namespace isomesh::cli
