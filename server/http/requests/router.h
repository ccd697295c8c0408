#pragma once

#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "server/http/requests/request.h"
#include "server/http/requests/response.h"

namespace isomesh::http {

// A handler from a function that always answers immediately.
template <class Run>
Handler handler_of(Run run) {
  using Result = std::invoke_result_t<Run, const Request&, Response&>;
  if constexpr (std::is_void_v<Result>) {
    return [run = std::move(run)](const Request& request, Response& response) {
      run(request, response);
      return std::optional<Continuation>();
    };
  } else {
    return run;
  }
}

// A path such as /v1/jobs/{id}/mesh.{format}. A segment has at most one parameter, which matches 1
// to 100 letters, digits, dots, underscores and hyphens.
class Route {
 public:
  explicit Route(std::string pattern);

  const std::string& pattern() const { return pattern_; }
  // Handlers by method, in alphabetical order.
  const std::map<std::string, Handler>& handlers() const { return handlers_; }
  // The methods, separated by commas, as in the header Allow.
  std::string methods() const;

  void add(const std::string& method, Handler handler);

  // The parameters of a matching path; empty for other paths.
  std::optional<Parameters> match(const std::vector<std::string_view>& segments) const;

 private:
  struct Segment {
    std::string before;  // everything if there is no parameter
    std::string parameter;
    std::string after;
  };

  std::string pattern_;
  std::vector<Segment> segments_;
  std::map<std::string, Handler> handlers_;
};

// Thread safe once all routes are added.
class Router {
 public:
  void add(const std::string& method, const std::string& pattern, Handler handler);

  // The first matching route, in the order of `add`, and the path's parameters. Null if there is
  // none.
  std::pair<const Route*, Parameters> find(std::string_view path) const;

  const std::deque<Route>& routes() const { return routes_; }

 private:
  std::deque<Route> routes_;  // stable addresses: requests refer to their patterns
};

}  // namespace isomesh::http
