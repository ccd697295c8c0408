#include "tests/support/receiver.h"

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <stdexcept>
#include <thread>

#include <httplib.h>

#include "base/text.h"
#include "tests/support/process.h"

namespace isomesh::test {
namespace {}  // namespace

struct Receiver::State {
  httplib::Server http;
  int port = 0;
  std::mutex mutex;
  std::condition_variable ending;
  bool is_ending = false;
  std::vector<int> statuses;
  std::vector<Received> received;
  std::jthread thread;

  void answer(const httplib::Request& request, httplib::Response& response) {
    std::unique_lock lock(mutex);
    Received one{.path = request.path, .body = request.body, .headers = {}};
    for (const auto& [name, value] : request.headers) one.headers[lower(name)] = value;
    received.push_back(one);
    response.status = statuses.front();
    if (statuses.size() > 1) statuses.erase(statuses.begin());
    if (response.status == 0) {
      ending.wait(lock, [&] { return is_ending; });
      response.status = 500;
    }
    if (response.status == 302) response.set_header("Location", "/elsewhere");
  }
};

Receiver::Receiver(std::vector<int> statuses) : state_(std::make_unique<State>()) {
  state_->statuses = std::move(statuses);
  const auto answer = [this](const httplib::Request& request, httplib::Response& response) {
    state_->answer(request, response);
  };
  state_->http.Get(".*", answer);
  state_->http.Post(".*", answer);
  state_->http.set_keep_alive_max_count(1);
  state_->port = state_->http.bind_to_any_port("127.0.0.1");
  if (state_->port < 0) throw std::runtime_error("no port for a receiver");
  state_->thread = std::jthread([this] { state_->http.listen_after_bind(); });
  while (!state_->http.is_running()) std::this_thread::yield();
}

Receiver::~Receiver() {
  {
    const std::lock_guard lock(state_->mutex);
    state_->is_ending = true;
  }
  state_->ending.notify_all();
  state_->http.stop();
}

std::string Receiver::url() const { return "http://127.0.0.1:" + std::to_string(state_->port); }

std::string Receiver::url_by_name() const {
  return "http://localhost:" + std::to_string(state_->port);
}

std::vector<Received> Receiver::received() const {
  const std::lock_guard lock(state_->mutex);
  return state_->received;
}

void Receiver::answer_with(int status) {
  const std::lock_guard lock(state_->mutex);
  state_->statuses = {status};
}

bool Receiver::gets(std::size_t count) const {
  return eventually([&] { return received().size() >= count; });
}

}  // namespace isomesh::test
