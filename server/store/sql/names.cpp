#include "server/store/sql/names.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>

#include "base/error.h"
#include "proto/types.h"
#include "server/store/job_store.h"
#include "server/store/outbox.h"

namespace isomesh::store {
namespace {

struct Name {
  template <class T>
  constexpr Name(std::string_view text, T value)
      : name(text), number(static_cast<std::int64_t>(value)) {}
  constexpr Name(std::string_view text, Stage value) : name(text), stage(row_of(value).name) {}

  std::string_view name;
  std::int64_t number = 0;
  std::string_view stage = {};  // tables contain the names of stages, so a new one fits in anywhere
};

constexpr std::array kNames = {
    Name{"job.queued", JobState::kQueued},
    Name{"job.running", JobState::kRunning},
    Name{"job.succeeded", JobState::kSucceeded},
    Name{"job.cancelled", JobState::kCancelled},
    Name{"job.final", JobState::kSucceeded},  // the first of the final states
    Name{"event.stage", EventKind::kStage},
    Name{"event.done", EventKind::kDone},
    Name{"stage.queue", Stage::kQueue},
    Name{"stage.load", Stage::kLoad},
    Name{"stage.done", Stage::kDone},
    Name{"priority.stat", Priority::kStat},
    Name{"priority.routine", Priority::kRoutine},
    Name{"priority.bulk", Priority::kBulk},
    Name{"callback.longest_us", std::chrono::microseconds(kLongestPostponed).count()},
};

// Databases and their indexes contain these numbers, so they stay.
static_assert(static_cast<int>(JobState::kSucceeded) == 2);
static_assert(static_cast<int>(JobState::kCancelled) == 4);
static_assert(static_cast<int>(EventKind::kDone) == 2);
static_assert(static_cast<int>(Priority::kBulk) == 2);

std::string value_of(std::string_view name) {
  const auto* const found = std::ranges::find(kNames, name, &Name::name);
  if (found == kNames.end()) {
    throw Error(ErrorCode::kInternal, "SQL has no name " + std::string(name));
  }
  if (found->stage.empty()) return std::to_string(found->number);
  return '\'' + std::string(found->stage) + '\'';
}

}  // namespace

std::string with_numbers(std::string_view sql) {
  constexpr std::string_view kEmptyObject = "{}";
  std::string text;
  while (true) {
    const std::size_t begin = sql.find('{');
    text += sql.substr(0, begin);
    if (begin == std::string_view::npos) return text;
    sql.remove_prefix(begin);
    const std::size_t end = sql.find('}');
    if (end == std::string_view::npos) throw Error(ErrorCode::kInternal, "SQL has an open brace");
    if (sql.starts_with(kEmptyObject)) {
      text += kEmptyObject;
    } else {
      text += value_of(sql.substr(1, end - 1));
    }
    sql.remove_prefix(end + 1);
  }
}

}  // namespace isomesh::store
