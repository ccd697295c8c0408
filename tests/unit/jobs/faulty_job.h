// Faults of the stand-in for isomesh-job, selected by the iso-value.
#pragma once

namespace isomesh::test {

inline constexpr double kAnswers = 0;  // a mesh of nothing, or a surface of nothing
inline constexpr double kKilled = 1;   // by SIGKILL
inline constexpr double kExits = 2;    // with status 3
inline constexpr double kIsDeaf = 3;   // works on, whatever it is asked to
inline constexpr double kTalksNonsense = 4;
inline constexpr double kMakesAnotherFile = 5;
inline constexpr double kAnswersAnotherOrder = 6;
inline constexpr double kNeverBegins = 7;  // but ends
inline constexpr double kTalksForEver = 8;
inline constexpr double kDiesInAFile = 9;  // before the bytes that it has announced
inline constexpr double kRunsOutOfTime = 10;
inline constexpr double kHasNoRoom = 11;  // on the disk for what it sets aside

}  // namespace isomesh::test
