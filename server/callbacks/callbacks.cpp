#include "server/callbacks/callbacks.h"

#include <algorithm>
#include <map>
#include <random>
#include <stop_token>
#include <thread>
#include <utility>

#include <curl/curl.h>

#include "base/curl.h"
#include "base/log.h"
#include "base/mutex.h"
#include "proto/json_tree.h"
#include "server/callbacks/signature.h"

namespace isomesh::callbacks {
namespace {

using std::chrono::milliseconds;

using curl::append;
using curl::Easy;
using curl::Headers;
using curl::make_multi;
using curl::Multi;

// An attempt in progress; owns what the transfer refers to.
struct Attempt {
  store::Delivery delivery;
  Reach reach = Reach::kPublic;
  bool out_of_reach = false;
  Headers headers;
  Easy easy;
};

curl_socket_t open_socket(void* attempt_pointer, curlsocktype /*purpose*/, curl_sockaddr* address) {
  auto& attempt = *static_cast<Attempt*>(attempt_pointer);
  if (!is_within(attempt.reach, address->addr)) {
    attempt.out_of_reach = true;
    return CURL_SOCKET_BAD;
  }
  return ::socket(address->family, address->socktype | SOCK_CLOEXEC, address->protocol);
}

std::size_t drop(char* /*data*/, std::size_t size, std::size_t count, void* /*nothing*/) {
  return size * count;
}

std::int64_t seconds_now() {
  return std::chrono::duration_cast<std::chrono::seconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace

class Callbacks::Sender {
 public:
  Sender(store::Outbox& outbox, const CallbackTargets& targets, CallbackOptions options,
         CallbackObserver observer)
      : outbox_(outbox),
        targets_(targets),
        options_(std::move(options)),
        observer_(std::move(observer)),
        secrets_(options_.secrets),
        multi_(make_multi()),
        thread_([this](const std::stop_token& stop) { run(stop); }) {}

  ~Sender() {
    thread_.request_stop();
    wake();
    thread_.join();
    for (auto& [job, attempt] : attempts_) {
      curl_multi_remove_handle(multi_.get(), attempt->easy.get());
    }
  }

  void wake() { curl_multi_wakeup(multi_.get()); }

  void set_secrets(std::vector<std::string> secrets) {
    const Lock lock(mutex_);
    secrets_ = std::move(secrets);
  }

 private:
  void run(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      milliseconds sleep = limits::kLongestSleep;
      try {
        const auto now = std::chrono::system_clock::now();
        begin_due(now);
        sleep = advance(now);
      } catch (const std::exception& error) {
        log_error("callbacks could not be sent and are retried: {}", error.what());
        sleep = limits::kPause;
      }
      if (stop.stop_requested()) return;
      curl_multi_poll(multi_.get(), nullptr, 0, static_cast<int>(sleep.count()), nullptr);
    }
  }

  void begin_due(store::Time now) {
    if (attempts_.size() >= limits::kAtOnce) return;
    // Attempts in progress are still due and come first, so they count against their receiver's
    // limit.
    for (store::Delivery& delivery : outbox_.due(now, limits::kAtOncePerReceiver)) {
      if (attempts_.size() >= limits::kAtOnce) return;
      if (!attempts_.contains(delivery.job)) begin(std::move(delivery));
    }
  }

  void begin(store::Delivery delivery) {
    const auto reach = targets_.reach_of(delivery.url);
    if (!reach) return give_up(delivery, "the receiver is no longer allowed");
    if (!is_json(delivery.body)) return give_up(delivery, "its record is damaged");
    auto attempt = std::make_unique<Attempt>();
    attempt->delivery = std::move(delivery);
    attempt->reach = *reach;
    attempt->easy = curl::make_easy();
    set_up(*attempt);
    if (curl_multi_add_handle(multi_.get(), attempt->easy.get()) != CURLM_OK) {
      throw Error(ErrorCode::kInternal, "a transfer cannot be started");
    }
    const std::string job = attempt->delivery.job;
    attempts_[job] = std::move(attempt);
  }

  void set_up(Attempt& attempt) {
    const store::Delivery& delivery = attempt.delivery;
    const std::int64_t now = seconds_now();
    append(attempt.headers, "Content-Type: application/json");
    append(attempt.headers, "Expect:");  // send the body at once
    append(attempt.headers, "webhook-id: " + delivery.job);
    append(attempt.headers, "webhook-timestamp: " + std::to_string(now));
    {
      const Lock lock(mutex_);
      append(attempt.headers, "webhook-signature: " +
                                  callback_signature(secrets_, delivery.job, now, delivery.body));
    }
    CURL* easy = attempt.easy.get();
    curl_easy_setopt(easy, CURLOPT_URL, delivery.url.c_str());
    curl::connect_directly(easy, options_.authorities);
    curl_easy_setopt(easy, CURLOPT_TIMEOUT_MS, static_cast<long>(options_.timeout.count()));
    curl_easy_setopt(easy, CURLOPT_POSTFIELDS, delivery.body.data());
    curl_easy_setopt(easy, CURLOPT_POSTFIELDSIZE_LARGE,
                     static_cast<curl_off_t>(delivery.body.size()));
    curl_easy_setopt(easy, CURLOPT_HTTPHEADER, attempt.headers.get());
    curl_easy_setopt(easy, CURLOPT_USERAGENT, "isomesh/" ISOMESH_VERSION);
    curl_easy_setopt(easy, CURLOPT_WRITEFUNCTION, drop);
    curl_easy_setopt(easy, CURLOPT_OPENSOCKETFUNCTION, open_socket);
    curl_easy_setopt(easy, CURLOPT_OPENSOCKETDATA, &attempt);
    // A reused connection was checked for another entry's reach.
    curl_easy_setopt(easy, CURLOPT_FRESH_CONNECT, 1L);
    curl_easy_setopt(easy, CURLOPT_FORBID_REUSE, 1L);
    curl_easy_setopt(easy, CURLOPT_PRIVATE, &attempt);
  }

  // Advances all attempts and finishes those that have ended. Returns the time until the next
  // action, unless a socket or wake() comes first. Deliveries due before `now` have begun, or wait
  // for a place, which the end of an attempt frees.
  milliseconds advance(store::Time now) {
    int running = 0;
    curl_multi_perform(multi_.get(), &running);
    int left = 0;
    bool ended = false;
    while (const CURLMsg* message = curl_multi_info_read(multi_.get(), &left)) {
      if (message->msg != CURLMSG_DONE) continue;
      ended = true;
      end(message->easy_handle, message->data.result);
    }
    if (ended) return milliseconds(0);
    const auto next = outbox_.next_after(now);
    if (!next) return limits::kLongestSleep;
    const auto wait = std::chrono::ceil<milliseconds>(*next - std::chrono::system_clock::now());
    return std::clamp(wait, milliseconds(0), limits::kLongestSleep);
  }

  void end(CURL* easy, CURLcode result) {
    Attempt* pointer = nullptr;
    curl_easy_getinfo(easy, CURLINFO_PRIVATE, &pointer);
    long status = 0;
    curl_easy_getinfo(easy, CURLINFO_RESPONSE_CODE, &status);
    const auto node = attempts_.extract(pointer->delivery.job);
    const Attempt& attempt = *node.mapped();
    curl_multi_remove_handle(multi_.get(), easy);
    const bool success = result == CURLE_OK && status >= 200 && status < 300;
    if (success) {
      outbox_.remove(attempt.delivery);
      return observer_(attempt.delivery, CallbackOutcome::kDelivered, "");
    }
    const std::string reason =
        attempt.out_of_reach
            ? "the host name of the receiver resolves to an address that is not allowed"
        : result == CURLE_OK ? "status " + std::to_string(status)
                             : curl_easy_strerror(result);
    constexpr long kGone = 410;
    const auto age = std::chrono::system_clock::now() - attempt.delivery.created;
    if ((result == CURLE_OK && status == kGone) || age > options_.give_up_after) {
      return give_up(attempt.delivery, reason);
    }
    outbox_.postpone(attempt.delivery,
                     std::chrono::system_clock::now() + delay_after(attempt.delivery.attempts));
    observer_(attempt.delivery, CallbackOutcome::kRetried, reason);
  }

  void give_up(const store::Delivery& delivery, const std::string& reason) {
    outbox_.remove(delivery);
    observer_(delivery, CallbackOutcome::kGivenUp, reason);
  }

  // Exponential back-off with jitter over its upper half, so that simultaneous failures are not
  // repeated simultaneously.
  milliseconds delay_after(int attempts) {
    constexpr int kMostDoublings = 20;
    const milliseconds whole = std::min(
        options_.first_delay * (std::int64_t{1} << std::clamp(attempts, 0, kMostDoublings)),
        options_.longest_delay);
    return milliseconds(
        std::uniform_int_distribution<std::int64_t>(whole.count() / 2, whole.count())(random_));
  }

  store::Outbox& outbox_;
  const CallbackTargets& targets_;
  const CallbackOptions options_;
  const CallbackObserver observer_;
  Mutex mutex_;
  std::vector<std::string> secrets_ ISOMESH_GUARDED_BY(mutex_);
  std::mt19937_64 random_{std::random_device()()};
  const Multi multi_;
  std::map<std::string, std::unique_ptr<Attempt>> attempts_;
  std::jthread thread_;  // last: it uses all of the above
};

Callbacks::Callbacks(store::Outbox& outbox, const CallbackTargets& targets, CallbackOptions options,
                     CallbackObserver observer)
    : sender_(std::make_unique<Sender>(outbox, targets, std::move(options), std::move(observer))) {}

Callbacks::~Callbacks() = default;

void Callbacks::wake() { sender_->wake(); }

void Callbacks::set_secrets(std::vector<std::string> secrets) {
  sender_->set_secrets(std::move(secrets));
}

}  // namespace isomesh::callbacks
