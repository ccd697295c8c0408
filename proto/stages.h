// The stages of a job, in the order in which they run: a new one is a row here, its enumerator and
// its time in types.h.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "proto/types.h"

namespace isomesh {

struct StageRow {
  Stage stage;
  const char* name;           // of the API
  double Timing::*elapsed;    // milliseconds; null for the end, which takes no time
  bool is_always_run = true;  // otherwise only a job that asks for it has it
};

inline constexpr std::array kStages = {
    StageRow{Stage::kQueue, "queue", &Timing::queue},
    StageRow{Stage::kLoad, "load", &Timing::load},
    StageRow{Stage::kExtract, "extract", &Timing::extract},
    StageRow{Stage::kSmooth, "smooth", &Timing::smooth},
    StageRow{Stage::kSimplify, "simplify", &Timing::simplify, false},
    StageRow{Stage::kEncode, "encode", &Timing::encode},
    StageRow{Stage::kCertify, "certify", &Timing::certify, false},
    StageRow{Stage::kDone, "done", nullptr}};

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
