#include "client/isomesh/event_reader.h"

#include "proto/error.h"
#include "proto/json.h"

namespace isomesh {
namespace {

// A job's JSON has a few kilobytes, so a longer line is not an event.
constexpr std::size_t kLongestLine = 1024 * 1024;

}  // namespace

void EventReader::take(std::string_view piece) {
  while (!piece.empty()) {
    const std::size_t end = piece.find('\n');
    line_ += piece.substr(0, end);
    if (line_.size() > kLongestLine) {
      throw Error(ErrorCode::kInternal, "the server's events do not match the API");
    }
    if (end == std::string_view::npos) return;
    take_line(line_);
    line_.clear();
    piece.remove_prefix(end + 1);
  }
}

void EventReader::restart() {
  line_.clear();
  name_.clear();
  data_.clear();
  id_.clear();
}

// A line is a field, a comment, which begins with a colon, or empty, which ends an event.
void EventReader::take_line(std::string_view line) {
  if (line.empty()) return finish_event();
  const std::size_t colon = line.find(':');
  const std::string_view name = line.substr(0, colon);
  std::string_view value = colon == std::string_view::npos ? "" : line.substr(colon + 1);
  if (value.starts_with(' ')) value.remove_prefix(1);
  if (name == "event") name_ = value;
  if (name == "data") data_ += value;
  if (name == "id") id_ = value;
}

void EventReader::finish_event() {
  if (name_ == "done") {
    job_ = job_from_json(data_);
  } else if (name_ == "stage" || name_ == "progress") {
    const JobEvent event = job_event_from_json(data_);
    if (listener_) listener_(event);
  }
  if (!id_.empty()) last_id_ = id_;
  name_.clear();
  data_.clear();
}

}  // namespace isomesh
