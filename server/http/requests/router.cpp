#include "server/http/requests/router.h"

#include <algorithm>

#include "base/text.h"
#include "server/http/limits.h"

namespace isomesh::http {
namespace {

// Not trimmed, unlike base/text's split: white space is part of a path.
std::vector<std::string_view> segments_of(std::string_view path) {
  std::vector<std::string_view> segments;
  for (std::size_t begin = 0; begin <= path.size();) {
    const std::size_t end = std::min(path.find('/', begin), path.size());
    segments.push_back(path.substr(begin, end - begin));
    begin = end + 1;
  }
  return segments;
}

bool is_parameter(std::string_view text) {
  return !text.empty() && text.size() <= limits::kLongestPathParameter &&
         std::ranges::all_of(text, is_plain);
}

}  // namespace

Route::Route(std::string pattern) : pattern_(std::move(pattern)) {
  for (const std::string_view segment : segments_of(pattern_)) {
    const std::size_t open = std::min(segment.find('{'), segment.size());
    const std::size_t close = std::min(segment.find('}', open), segment.size());
    const bool is_literal = open == segment.size();
    segments_.push_back(
        {.before = std::string(segment.substr(0, open)),
         .parameter = is_literal ? "" : std::string(segment.substr(open + 1, close - open - 1)),
         .after = is_literal ? "" : std::string(segment.substr(close + 1))});
  }
}

std::string Route::methods() const {
  std::string all;
  for (const auto& [method, handler] : handlers_) all += (all.empty() ? "" : ", ") + method;
  return all;
}

void Route::add(const std::string& method, Handler handler) {
  handlers_[method] = std::move(handler);
}

std::optional<Parameters> Route::match(const std::vector<std::string_view>& segments) const {
  if (segments.size() != segments_.size()) return std::nullopt;
  Parameters parameters;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const auto& [before, parameter, after] = segments_[i];
    std::string_view text = segments[i];
    if (parameter.empty()) {
      if (text != before) return std::nullopt;
      continue;
    }
    const bool fits = text.size() > before.size() + after.size() && text.starts_with(before) &&
                      text.ends_with(after);
    if (!fits) return std::nullopt;
    text = text.substr(before.size(), text.size() - before.size() - after.size());
    if (!is_parameter(text)) return std::nullopt;
    parameters.emplace_back(parameter, text);
  }
  return parameters;
}

void Router::add(const std::string& method, const std::string& pattern, Handler handler) {
  auto route = std::ranges::find(routes_, pattern, &Route::pattern);
  if (route == routes_.end()) route = routes_.emplace(routes_.end(), pattern);
  route->add(method, std::move(handler));
}

std::pair<const Route*, Parameters> Router::find(std::string_view path) const {
  const std::vector<std::string_view> segments = segments_of(path);
  for (const Route& route : routes_) {
    if (auto parameters = route.match(segments)) return {&route, std::move(*parameters)};
  }
  return {nullptr, {}};
}

}  // namespace isomesh::http
