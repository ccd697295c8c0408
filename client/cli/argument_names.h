// Checks the names of commands and options before the library parses them; private to this folder.
#pragma once

#include <CLI/CLI.hpp>

namespace isomesh::cli {

// Throws EarlyExit for a command or an option that `app` does not have. The library would report
// "FILE: 30 does not exist" for "--isoo 30". Also rejects options that `local` has no use for.
void check_names(const CLI::App& app, int argc, const char* const* argv);

}  // namespace isomesh::cli
