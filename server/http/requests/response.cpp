#include "server/http/requests/response.h"

#include <chrono>

#include "base/clock.h"
#include "proto/json.h"
#include "server/http/limits.h"

namespace isomesh::http {
namespace {

constexpr const char* kProblemType = "application/problem+json";

bool may_come_again(const Problem& problem) {
  return problem.status == 429 || problem.status == 503;
}

std::string retry_after() { return std::to_string(limits::kRetryAfter.count()); }

}  // namespace

bool Response::has_header(std::string_view name) const {
  return net::find_header(headers, name) != nullptr;
}

void Response::set_header(std::string_view name, std::string_view value) {
  std::erase_if(headers, [&](const auto& header) { return net::equal_names(header.first, name); });
  add_header(name, value);
}

void Response::add_header(std::string_view name, std::string_view value) {
  headers.emplace_back(name, value);
}

void Response::set_body(std::string text, std::string_view type) {
  body = std::move(text);
  media_type = type;
}

void answer_problem(const Request& request, Response& response, const Error& error) {
  answer_problem(request, response, to_problem(error, request.path));
}

void answer_problem(const Request& request, Response& response, Problem problem) {
  problem.instance = request.path;
  response.status = problem.status;
  response.set_header("Cache-Control", "no-store");
  if (may_come_again(problem) && !response.has_header("Retry-After")) {
    response.set_header("Retry-After", retry_after());
  }
  response.stream.reset();
  response.set_body(to_json(problem), kProblemType);
}

std::string refusal(const Error& error) {
  const Problem problem = to_problem(error, "");
  const std::string body = to_json(problem);
  std::string bytes =
      "HTTP/1.1 " + std::to_string(problem.status) + ' ' + problem.title +
      "\r\nDate: " + http_date_of(std::chrono::system_clock::now()) +
      "\r\nCache-Control: no-store\r\nConnection: close\r\nContent-Type: " + kProblemType +
      "\r\nX-Content-Type-Options: nosniff\r\nCross-Origin-Resource-Policy: same-origin"
      "\r\nContent-Length: " +
      std::to_string(body.size()) + "\r\n";
  if (may_come_again(problem)) {
    bytes.append("Retry-After: ").append(retry_after()).append("\r\n");
  }
  return bytes + "\r\n" + body;
}

}  // namespace isomesh::http
