// Sends a Client's requests. Private to this folder.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <stop_token>
#include <string>

#include "client/isomesh/client.h"
#include "client/isomesh/transport.h"

namespace isomesh {

// The duration of one long poll.
inline constexpr std::chrono::seconds kLongestWait{30};
// The minimum interval between polls, for a server that answers long polls immediately.
inline constexpr std::chrono::milliseconds kShortestLook{200};
inline constexpr std::size_t kKeyBytes = 16;

inline bool is_success(const HttpResponse& response) {
  return response.status >= 200 && response.status < 300;
}

Error refusal(const HttpResponse& response);

inline Error other_api() {
  return {ErrorCode::kInternal, "the server's response does not match the API"};
}

// Thread safe.
class Client::Impl {
 public:
  explicit Impl(ClientOptions&& options);

  // Returns a successful response; throws all others as Error.
  HttpResponse exchange(const HttpRequest& request) const;

  std::string send(const HttpRequest& request) const { return exchange(request).body; }

  // Sends a request that may be repeated after a broken connection. Calls `before` ahead of each
  // attempt.
  HttpResponse repeated(const HttpRequest& request, const std::function<void()>& before = {}) const;
  std::string repeat(const HttpRequest& request, const std::function<void()>& before = {}) const {
    return repeated(request, before).body;
  }

  // Sends a request with a source, and resumes it after a broken connection. Works as exchange()
  // with a server that does not support this.
  HttpResponse resumed(const HttpRequest& request) const;

  // Throws Error kCancelled immediately on a stop request.
  void pause(std::chrono::milliseconds duration) const;

 private:
  std::string begin_upload(const HttpRequest& request) const;
  HttpResponse finish_upload(const HttpRequest& request, const std::string& place) const;
  std::string give_up(const std::string& place) const;

  std::stop_token stop_;
  Transport transport_;
  Transport parting_;  // for a last request, also after a stop request
};

}  // namespace isomesh
