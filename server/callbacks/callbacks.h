// Notifies receivers of ended jobs: POSTs the signed JSON of the job until a receiver confirms it
// or time is over.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/callbacks/limits.h"
#include "server/callbacks/targets.h"
#include "server/store/outbox.h"

namespace isomesh::callbacks {

struct CallbackOptions {
  std::vector<std::string> secrets;  // see signature.h
  std::string authorities;           // a file of trusted certificates; empty: the system's
  std::chrono::milliseconds timeout = limits::kTimeout;
  std::chrono::milliseconds first_delay = limits::kFirstDelay;
  std::chrono::milliseconds longest_delay = limits::kLongestDelay;
  std::chrono::milliseconds give_up_after = limits::kGiveUpAfter;
};

enum class CallbackOutcome { kDelivered, kRetried, kGivenUp };

// Called on the delivering thread after each attempt. `reason` describes the failure, without the
// URL, which may hold a secret.
using CallbackObserver = std::function<void(const store::Delivery& delivery,
                                            CallbackOutcome outcome, const std::string& reason)>;

// One thread with several concurrent deliveries, few per receiver, so that a slow receiver delays
// only itself. A delivery may arrive more than once, always with the same id: a crash between the
// response and its record repeats it. Does not follow redirects or use proxies of the environment.
// Checks the connected address itself, whatever the name resolved to before.
//
// Thread safe. Outbox and targets must outlive it.
class Callbacks {
 public:
  Callbacks(store::Outbox& outbox, const CallbackTargets& targets, CallbackOptions options,
            CallbackObserver observer);

  // Aborts attempts in progress; the next process repeats them.
  ~Callbacks();
  Callbacks(const Callbacks&) = delete;
  Callbacks& operator=(const Callbacks&) = delete;

  // Call after a job has ended: there may be deliveries.
  void wake();

  void set_secrets(std::vector<std::string> secrets);

 private:
  class Sender;
  std::unique_ptr<Sender> sender_;
};

}  // namespace isomesh::callbacks
