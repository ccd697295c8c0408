// The exit statuses of the command: its help has this table, and docs/command.md says more.
#pragma once

#include <array>

namespace isomesh::cli {

inline constexpr int kDone = 0;
inline constexpr int kRefused = 1;
inline constexpr int kWrongUsage = 2;
inline constexpr int kServerUnreachable = 3;

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
