// The stages of a job, in the order in which they run: a new one is an enumerator, a time and a row
// here, and its time in server/jobs/making/stage_times.cpp.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

namespace isomesh {

enum class Stage {
  kQueue,
  kLoad,
  kExtract,
  kSmooth,
  kUntangle,
  kSimplify,
  kEncode,
  kCertify,
  kThickness,
  kDone
};

// Wall-clock milliseconds of each stage; 0 for a stage that has not run.
struct Timing {
  double queue = 0;
  double load = 0;
  double extract = 0;
  double smooth = 0;
  double untangle = 0;
  double simplify = 0;
  double encode = 0;
  double certify = 0;
  double thickness = 0;
  double total = 0;  // from acceptance to the end

  bool operator==(const Timing&) const = default;
};

struct StageRow {
  Stage stage;
  const char* name;           // of the API
  const char* help;           // in its description
  double Timing::*elapsed;    // milliseconds; null for the end, which takes no time
  bool is_always_run = true;  // otherwise only a job that asks for it has it
};

inline constexpr std::array kStages = {
    StageRow{Stage::kQueue, "queue", "From acceptance to start.", &Timing::queue},
    StageRow{Stage::kLoad, "load", "Loading the samples into memory.", &Timing::load},
    StageRow{Stage::kExtract, "extract", "Marching tetrahedra.", &Timing::extract},
    StageRow{Stage::kSmooth, "smooth", "All smoothing passes.", &Timing::smooth},
    StageRow{Stage::kUntangle, "untangle", "Removing self-intersections, if requested.",
             &Timing::untangle, false},
    StageRow{Stage::kSimplify, "simplify", "Simplification, if fewer triangles are requested.",
             &Timing::simplify, false},
    StageRow{Stage::kEncode, "encode", "Writing the files and measuring the mesh.",
             &Timing::encode},
    StageRow{Stage::kCertify, "certify", "Measuring the error, if requested.", &Timing::certify,
             false},
    StageRow{Stage::kThickness, "thickness", "Measuring the thickness of walls, if requested.",
             &Timing::thickness, false},
    StageRow{Stage::kDone, "done", "", nullptr}};

constexpr const StageRow& row_of(Stage stage) {
  return *std::ranges::find(kStages, stage, &StageRow::stage);
}

static_assert([] {
  for (std::size_t number = 0; number < kStages.size(); ++number) {
    if (std::ranges::count(kStages, static_cast<Stage>(number), &StageRow::stage) != 1)
      return false;
  }
  return true;
}());

}  // namespace isomesh
