// Sends a Client's requests. Private to this folder.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "client/isomesh/busy.h"
#include "client/isomesh/client.h"
#include "client/isomesh/pages.h"
#include "client/isomesh/transport.h"
#include "client/isomesh/url.h"

namespace isomesh {

inline constexpr std::size_t kKeyBytes = 16;

using Query = std::vector<std::pair<std::string, std::string>>;

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

  // The body of one page of a list: the first, or the one of `cursor`.
  std::string page(const std::string& path, Query query, const std::string& cursor) const {
    if (!cursor.empty()) query.emplace_back("cursor", cursor);
    return repeat({.target = path + query_string(query)});
  }

  // All items of a list that comes in pages. `parse` reads those of one page.
  template <class Parse>
  auto all_pages(const std::string& path, const Parse& parse, const Query& query = {}) const {
    const auto ask = [&](const std::string& cursor) { return page(path, query, cursor); };
    return isomesh::all_pages(ask, parse);
  }

  // Sends a request with a source, and resumes it after a broken connection.
  HttpResponse resumed(const HttpRequest& request) const;

  // Throws Error kCancelled immediately on a stop request.
  void pause(std::chrono::milliseconds duration) const { isomesh::pause(duration, stop_); }

 private:
  std::string begin_upload(const HttpRequest& request) const;
  HttpResponse finish_upload(const HttpRequest& request, const std::string& place) const;
  std::string give_up(const std::string& place) const;

  std::stop_token stop_;
  PersistentTransport transport_;
  PersistentTransport parting_;  // for a last request, also after a stop request
};

}  // namespace isomesh
