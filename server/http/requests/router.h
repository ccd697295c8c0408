// Which handler answers which path and method.
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

// Makes a handler of a function that always answers at once.
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

// A path such as /v1/jobs/{id}/mesh.{format}. A segment has at most one parameter, which stands for
// 1 to 100 letters, digits, dots, underscores and hyphens.
class Route {
 public:
  explicit Route(std::string pattern);

  // Also what the route is called in logs and metrics.
  const std::string& pattern() const { return pattern_; }
  // The handlers by their methods, in alphabetical order.
  const std::map<std::string, Handler>& handlers() const { return handlers_; }
  // The methods with commas between, as in the header Allow.
  std::string methods() const;

  void add(const std::string& method, Handler handler);

  // The parameters of a path that the pattern matches; nothing for another path.
  std::optional<Parameters> match(const std::vector<std::string_view>& segments) const;

 private:
  struct Segment {
    std::string before;  // all of it when there is no parameter
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

  // The first route that matches, in the order in which their patterns were added, and the path's
  // parameters. Null without one.
  std::pair<const Route*, Parameters> find(std::string_view path) const;

  const std::deque<Route>& routes() const { return routes_; }

 private:
  std::deque<Route> routes_;  // stay where they are, as requests refer to their patterns
};

}  // namespace isomesh::http
