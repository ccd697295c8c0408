#include "server/store/postgresql/messages.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

#include <poll.h>

#include "base/log.h"
#include "proto/error.h"

namespace isomesh::store::postgresql {
namespace {

constexpr std::chrono::milliseconds kBetweenPolls{1000};
constexpr std::chrono::milliseconds kBetweenLooks{300};
constexpr std::chrono::milliseconds kBetweenTries{200};
constexpr char kWork = 'w';
constexpr char kEvents = 'e';
constexpr char kCancelled = 'c';  // followed by a job's id

// Waits until either descriptor is readable.
void wait_for(int first, int second, std::chrono::milliseconds longest) {
  std::array<pollfd, 2> watched = {pollfd{first, POLLIN, 0}, pollfd{second, POLLIN, 0}};
  ::poll(watched.data(), watched.size(), static_cast<int>(longest.count()));
}

News read(const std::vector<std::string>& messages) {
  News news;
  for (const std::string& message : messages) {
    if (message.starts_with(kCancelled)) {
      news.cancelled.insert(message.substr(1));
      continue;
    }
    news.has_work |= message.find(kWork) != std::string::npos;
    news.has_events |= message.find(kEvents) != std::string::npos;
  }
  return news;
}

// Reported if messages may have been missed.
const News kAnything = {
    .has_work = true, .has_events = true, .has_progress = true, .cancelled = {}};

bool is_empty(const News& news) {
  return !news.has_work && !news.has_events && !news.has_progress && news.cancelled.empty();
}

void add(News& news, const News& more) {
  news.has_work |= more.has_work;
  news.has_events |= more.has_events;
  news.cancelled.insert(more.cancelled.begin(), more.cancelled.end());
}

}  // namespace

Messages::Messages(const Database& database, Listener listener)
    : database_(database), listener_(std::move(listener)) {
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

Messages::~Messages() {
  thread_.request_stop();
  wakeup_.ring();
  thread_.join();
}

void Messages::tell(const News& news) {
  {
    const Lock lock(mutex_);
    add(to_tell_, news);
  }
  wakeup_.ring();
}

void Messages::run(const std::stop_token& stop) {
  bool is_told = false;
  while (!stop.stop_requested()) {
    try {
      listen(stop);
      is_told = false;
    } catch (const Error& error) {
      if (!is_told)
        log_warning("messages of other daemons cannot be received and are retried: {}",
                    error.what());
      is_told = true;
      listener_(kAnything);
      wait_for(wakeup_.descriptor(), -1, kBetweenTries);
      if (wakeup_.clear() && !stop.stop_requested()) {
        std::this_thread::sleep_for(kBetweenTries);
      }
    }
  }
}

void Messages::listen(const std::stop_token& stop) {
  Connection connection(database_.url());
  connection.script("LISTEN isomesh; SET synchronous_commit = off");
  using Clock = std::chrono::steady_clock;
  bool looks = listener_(kAnything);
  auto next_poll = Clock::now() + kBetweenPolls;
  auto next_look = Clock::now() + kBetweenLooks;
  while (!stop.stop_requested()) {
    const auto next = looks ? std::min(next_look, next_poll) : next_poll;
    const auto wait = std::chrono::ceil<std::chrono::milliseconds>(next - Clock::now());
    wait_for(connection.socket(), wakeup_.descriptor(),
             std::max(wait, std::chrono::milliseconds(0)));
    // This process also receives its own messages.
    News news;
    connection.wait_until(Connection::Clock::now() + Connection::kPatience);
    if (wakeup_.clear()) news = send(connection);
    add(news, read(connection.take_messages()));
    const auto now = Clock::now();
    if (now >= next_poll) {
      next_poll += kBetweenPolls;
      news.has_work = news.has_events = true;
    }
    if (looks && now >= next_look) {
      next_look = now + kBetweenLooks;
      news.has_progress = true;
    }
    if (!is_empty(news)) looks = listener_(news);
  }
}

News Messages::send(Connection& connection) {
  News news;
  {
    const Lock lock(mutex_);
    news = std::exchange(to_tell_, {});
  }
  std::string messages;
  for (const std::string& job : news.cancelled) messages += std::string(",") + kCancelled + job;
  std::string flags;
  if (news.has_work) flags += kWork;
  if (news.has_events) flags += kEvents;
  if (!flags.empty()) messages += ',' + flags;
  if (!messages.empty()) {
    connection.query("SELECT pg_notify('isomesh', m) FROM unnest(string_to_array(?1, ',')) AS m",
                     messages.substr(1));
  }
  return news;
}

}  // namespace isomesh::store::postgresql
