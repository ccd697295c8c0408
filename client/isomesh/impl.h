// How a Client sends its requests. Private to this folder.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <stop_token>
#include <string>

#include "client/isomesh/client.h"
#include "client/isomesh/transport.h"

namespace isomesh {

// Of one long poll.
inline constexpr std::chrono::seconds kLongestWait{30};
// The least time between two looks, for a server that answers a long poll at once.
inline constexpr std::chrono::milliseconds kShortestLook{200};
inline constexpr std::size_t kKeyBytes = 16;  // of an idempotency key

inline bool is_success(const HttpAnswer& answer) {
  return answer.status >= 200 && answer.status < 300;
}

// What an answer that is no success says.
Error refusal(const HttpAnswer& answer);

// Thread safe.
class Client::Impl {
 public:
  explicit Impl(ClientOptions&& options);

  // Returns a successful answer; every other answer is thrown as an Error.
  HttpAnswer answer(const HttpRequest& request) const;

  std::string send(const HttpRequest& request) const { return answer(request).body; }

  // Sends a request that may be repeated when its connection breaks. `before` runs ahead of each
  // try.
  HttpAnswer repeated(const HttpRequest& request, const std::function<void()>& before = {}) const;
  std::string repeat(const HttpRequest& request, const std::function<void()>& before = {}) const {
    return repeated(request, before).body;
  }

  // Sends a request with a source so that it goes on where its connection breaks; as answer() to a
  // server that does not know that.
  HttpAnswer resumed(const HttpRequest& request) const;

  // Ends at once with Error kCancelled when asked to stop.
  void pause(std::chrono::milliseconds duration) const;

 private:
  std::string begin_upload(const HttpRequest& request) const;
  HttpAnswer finish_upload(const HttpRequest& request, const std::string& place) const;
  void give_up(const std::string& place) const;

  std::stop_token stop_;
  Transport transport_;
};

}  // namespace isomesh
