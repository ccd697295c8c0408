// The exit statuses of isomesh and isomeshd, beside 128 and the number of a signal.
#pragma once

namespace isomesh::exit_status {

inline constexpr int kDone = 0;
inline constexpr int kRefused = 1;     // a failure that was reported
inline constexpr int kWrongUsage = 2;  // of options and arguments
inline constexpr int kServerUnreachable = 3;

}  // namespace isomesh::exit_status
