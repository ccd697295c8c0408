#include "server/http/responses/event_stream.h"

#include <algorithm>
#include <utility>

#include "proto/error.h"
#include "proto/json.h"
#include "server/http/limits.h"

namespace isomesh::http {
namespace {

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

std::string json_of(const store::Event& event) {
  return to_json(JobEvent{event.state, event.stage, event.progress});
}

// Common part of all event streams: their first bytes, and comments while there are no events.
class TalkingSource : public net::Source {
 public:
  bool ends_with_reader() const override { return true; }

 protected:
  // Call before writing the first event.
  void begin(std::string& bytes) {
    if (!std::exchange(has_begun_, true)) {
      bytes += "retry: " + std::to_string(limits::kReconnectAfter.count()) + "\n\n";
    }
  }

  // Call after writing the available events.
  More sent(std::string& bytes) {
    const auto now = std::chrono::steady_clock::now();
    if (bytes.empty() && now - last_told_ >= limits::kBetweenPings) bytes += ": ping\n\n";
    if (bytes.empty()) return More::kLater;
    last_told_ = now;
    return More::kBytes;
  }

 private:
  bool has_begun_ = false;
  std::chrono::steady_clock::time_point last_told_ = std::chrono::steady_clock::now();
};

class EventSource : public TalkingSource {
 public:
  explicit EventSource(EventStream stream) : stream_(std::move(stream)) {
    std::ranges::reverse(stream_.past);
  }

  // The end of a job needs its record, as JSON.
  bool computes() const override { return end_.has_value(); }

  More next(std::string& bytes) override {
    if (is_over_ || !stream_.may_listen()) return More::kEnd;
    if (end_) return tell_end(*std::exchange(end_, std::nullopt), bytes);
    begin(bytes);
    while (auto event = next_event()) {
      if (event->kind == store::EventKind::kDone) {
        end_ = std::move(event);
        return More::kBytes;
      }
      tell(*event, bytes);
    }
    return sent(bytes);
  }

 private:
  std::optional<store::Event> next_event() {
    if (stream_.past.empty()) return stream_.mailbox->take();
    store::Event event = std::move(stream_.past.back());
    stream_.past.pop_back();
    return event;
  }

  // An event may be both in the past and in the mailbox.
  void tell(const store::Event& event, std::string& bytes) {
    if (event.id > stream_.last) write(event, json_of(event), bytes);
  }

  // The last event is sent even if the client claims to have seen a later one. Nobody is told about
  // a job that was deleted meanwhile.
  More tell_end(const store::Event& event, std::string& bytes) {
    is_over_ = true;
    try {
      write(event, stream_.result(), bytes);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kNotFound && error.code() != ErrorCode::kGone) throw;
      return More::kEnd;
    }
    return More::kBytes;
  }

  void write(const store::Event& event, const std::string& data, std::string& bytes) {
    stream_.last = event.id;
    bytes.append("id: ").append(std::to_string(event.id));
    bytes.append("\nevent: ").append(name_of(event.kind));
    bytes.append("\ndata: ").append(data).append("\n\n");
  }

  EventStream stream_;               // `past` is reversed
  std::optional<store::Event> end_;  // the job's last event, to be sent next
  bool is_over_ = false;
};

class AllEventsSource : public TalkingSource {
 public:
  AllEventsSource(std::shared_ptr<Broadcaster::Mailbox> mailbox, net::FairPlaces::Place place,
                  std::function<bool()> may_listen)
      : mailbox_(std::move(mailbox)),
        place_(std::move(place)),
        may_listen_(std::move(may_listen)) {}

  More next(std::string& bytes) override {
    if (mailbox_->has_lost_some() || !may_listen_()) return More::kEnd;
    begin(bytes);
    while (const auto event = mailbox_->take()) {
      bytes.append("event: ").append(name_of(event->kind));
      // Ids contain nothing that JSON escapes.
      bytes.append("\ndata: {\"id\":\"").append(event->job).append("\",");
      bytes.append(json_of(*event).substr(1)).append("\n\n");
    }
    return sent(bytes);
  }

 private:
  std::shared_ptr<Broadcaster::Mailbox> mailbox_;
  net::FairPlaces::Place place_;
  std::function<bool()> may_listen_;
};

}  // namespace

void Broadcaster::Mailbox::put(const store::Event& event) {
  const Lock lock(mutex_);
  const auto before = std::find_if(events_.rbegin(), events_.rend(),
                                   [&](const auto& one) { return one.job == event.job; });
  const bool replaces = event.kind == store::EventKind::kProgress && before != events_.rend() &&
                        before->kind == store::EventKind::kProgress;
  if (replaces) events_.erase(std::next(before).base());
  if (events_.size() >= limits::kMostUnreadEvents) {
    events_.clear();
    has_lost_some_ = true;
  }
  if (!has_lost_some_) events_.push_back(event);
}

bool Broadcaster::Mailbox::has_lost_some() {
  const Lock lock(mutex_);
  return has_lost_some_;
}

std::optional<store::Event> Broadcaster::Mailbox::take() {
  const Lock lock(mutex_);
  if (events_.empty()) return std::nullopt;
  store::Event event = std::move(events_.front());
  events_.pop_front();
  return event;
}

std::shared_ptr<Broadcaster::Mailbox> Broadcaster::listen_to(const std::string& job) {
  return add(job, std::nullopt);
}

std::shared_ptr<Broadcaster::Mailbox> Broadcaster::listen_to_all(const store::Viewer& viewer) {
  return add("", viewer);
}

std::shared_ptr<Broadcaster::Mailbox> Broadcaster::add(const std::string& job,
                                                       const store::Viewer& viewer) {
  auto mailbox = std::make_shared<Mailbox>();
  const Lock lock(mutex_);
  std::erase_if(listeners_, [](const auto& one) { return one.second.mailbox.expired(); });
  listeners_.emplace(job, Listener{mailbox, viewer});
  return mailbox;
}

bool Broadcaster::publish(const store::Event& event) {
  const Lock lock(mutex_);
  bool is_heard = false;
  for (const std::string& key : {event.job, std::string()}) {
    const auto [begin, end] = listeners_.equal_range(key);
    for (auto listener = begin; listener != end; ++listener) {
      const auto& [weak, viewer] = listener->second;
      const auto mailbox = weak.lock();
      if (!mailbox || (viewer && *viewer != event.owner)) continue;
      mailbox->put(event);
      is_heard = true;
    }
  }
  return is_heard;
}

std::unique_ptr<net::Source> event_source(EventStream stream) {
  return std::make_unique<EventSource>(std::move(stream));
}

std::unique_ptr<net::Source> event_source(std::shared_ptr<Broadcaster::Mailbox> mailbox,
                                          net::FairPlaces::Place place,
                                          std::function<bool()> may_listen) {
  return std::make_unique<AllEventsSource>(std::move(mailbox), std::move(place),
                                           std::move(may_listen));
}

}  // namespace isomesh::http
