// Tells receivers that jobs have ended: a POST of the job's JSON, signed, until one is answered
// with success or time is over.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/callbacks/targets.h"
#include "server/store/outbox.h"

namespace isomesh::callbacks {

struct CallbackOptions {
  std::vector<std::string> secrets;  // see signature.h
  std::string authorities;           // a file of certificates to trust; empty: the system's
  std::chrono::milliseconds timeout{10'000};     // of one attempt, from its name to its answer
  std::chrono::milliseconds first_delay{5'000};  // after a failed attempt; doubles
  std::chrono::milliseconds longest_delay{std::chrono::hours(1)};
  std::chrono::milliseconds give_up_after{std::chrono::hours(24)};
};

enum class CallbackOutcome { kDelivered, kRetried, kGivenUp };

// Called by the delivering thread after each attempt; `reason` says why it failed, and never holds
// the URL, which may hold a secret.
using CallbackObserver = std::function<void(const store::Delivery& delivery,
                                            CallbackOutcome outcome, const std::string& reason)>;

// One thread that has several deliveries under way at once, few of them to one receiver, so that
// one that hangs holds up itself only. A delivery may come more than once, always with the same id:
// a crash between the answer and its record repeats it. Redirects are not followed, proxies of the
// environment are not used, and the address that is connected to is checked itself, whatever its
// name resolved to before.
//
// Thread safe. Outbox and targets must outlive it.
class Callbacks {
 public:
  Callbacks(store::Outbox& outbox, const CallbackTargets& targets, CallbackOptions options,
            CallbackObserver observer);

  // Attempts under way are cut off, and made again when the next process runs.
  ~Callbacks();
  Callbacks(const Callbacks&) = delete;
  Callbacks& operator=(const Callbacks&) = delete;

  // A job has ended: there may be something to deliver.
  void wake();

  // Signs with these from now on, when their file has been read again.
  void set_secrets(std::vector<std::string> secrets);

 private:
  class Sender;
  std::unique_ptr<Sender> sender_;
};

}  // namespace isomesh::callbacks
