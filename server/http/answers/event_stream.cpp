#include "server/http/answers/event_stream.h"

#include <algorithm>
#include <utility>

#include "proto/json.h"

namespace isomesh::http {
namespace {

constexpr std::chrono::seconds kPing{15};
// After how many milliseconds a browser whose connection broke comes back.
constexpr const char* kRetry = "retry: 2000\n\n";

std::string_view name_of(store::EventKind kind) {
  switch (kind) {
    case store::EventKind::kStage:
      return "stage";
    case store::EventKind::kProgress:
      return "progress";
    case store::EventKind::kDone:
      break;
  }
  return "done";
}

class EventSource : public net::Source {
 public:
  explicit EventSource(EventStream stream) : stream_(std::move(stream)) {
    std::ranges::reverse(stream_.past);
  }

  // The job that is over has to be read and written as JSON.
  bool computes() const override { return end_.has_value(); }

  More next(std::string& bytes) override {
    if (is_over_) return More::kEnd;
    if (end_) {
      tell(*std::exchange(end_, std::nullopt), bytes);
      return More::kBytes;
    }
    if (!std::exchange(has_begun_, true)) bytes += kRetry;
    while (auto event = next_event()) {
      if (event->kind == store::EventKind::kDone) {
        end_ = std::move(event);
        return More::kBytes;
      }
      tell(*event, bytes);
    }
    const auto now = std::chrono::steady_clock::now();
    if (bytes.empty() && now - last_told_ >= kPing) bytes += ": ping\n\n";
    if (bytes.empty()) return More::kLater;
    last_told_ = now;
    return More::kBytes;
  }

  bool ends_with_reader() const override { return true; }

 private:
  std::optional<store::Event> next_event() {
    if (stream_.past.empty()) return stream_.mailbox->take();
    store::Event event = std::move(stream_.past.back());
    stream_.past.pop_back();
    return event;
  }

  void tell(const store::Event& event, std::string& bytes) {
    is_over_ = event.kind == store::EventKind::kDone;
    // An event may be both in the past and in the mailbox. The last event is sent even to a client
    // that claims to have seen a later one.
    if (event.id <= stream_.last && !is_over_) return;
    stream_.last = event.id;
    bytes.append("id: ").append(std::to_string(event.id));
    bytes.append("\nevent: ").append(name_of(event.kind));
    bytes.append("\ndata: ")
        .append(is_over_ ? stream_.result()
                         : to_json(JobEvent{event.state, event.stage, event.progress}));
    bytes.append("\n\n");
  }

  EventStream stream_;  // the past in reverse
  bool has_begun_ = false;
  std::optional<store::Event> end_;  // the last event, which is to be told next
  bool is_over_ = false;
  std::chrono::steady_clock::time_point last_told_ = std::chrono::steady_clock::now();
};

}  // namespace

void Broadcaster::Mailbox::put(const store::Event& event) {
  const Lock lock(mutex_);
  const bool replaces = event.kind == store::EventKind::kProgress && !events_.empty() &&
                        events_.back().kind == store::EventKind::kProgress;
  if (replaces) events_.pop_back();
  events_.push_back(event);
}

std::optional<store::Event> Broadcaster::Mailbox::take() {
  const Lock lock(mutex_);
  if (events_.empty()) return std::nullopt;
  store::Event event = std::move(events_.front());
  events_.pop_front();
  return event;
}

std::shared_ptr<Broadcaster::Mailbox> Broadcaster::listen_to(const std::string& job) {
  auto mailbox = std::make_shared<Mailbox>();
  const Lock lock(mutex_);
  std::erase_if(listeners_, [](const auto& listener) { return listener.second.expired(); });
  listeners_.emplace(job, mailbox);
  return mailbox;
}

bool Broadcaster::publish(const store::Event& event) {
  const Lock lock(mutex_);
  bool is_heard = false;
  const auto [begin, end] = listeners_.equal_range(event.job);
  for (auto listener = begin; listener != end; ++listener) {
    const auto mailbox = listener->second.lock();
    if (!mailbox) continue;
    mailbox->put(event);
    is_heard = true;
  }
  return is_heard;
}

std::unique_ptr<net::Source> event_source(EventStream stream) {
  return std::make_unique<EventSource>(std::move(stream));
}

}  // namespace isomesh::http
