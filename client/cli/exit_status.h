// The exit statuses of the command: its help has this table, and docs/command.md says more.
#pragma once

#include <array>

#include "base/command_line/exit_status.h"

namespace isomesh::cli {

using namespace exit_status;

struct ExitStatus {
  int status;
  const char* meaning;
};

inline constexpr std::array kExitStatuses = {
    ExitStatus{kDone, "done"},
    ExitStatus{kRefused, "the job failed or was rejected, or the surface is empty"},
    ExitStatus{kWrongUsage, "wrong usage"},
    ExitStatus{kServerUnreachable, "the server could not be reached"}};

}  // namespace isomesh::cli
