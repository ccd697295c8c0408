#pragma once

#include <chrono>
#include <compare>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "proto/error.h"
#include "server/http/requests/request.h"
#include "server/net/sender.h"

namespace isomesh::http {

// The mark of the end of a streamed body.
enum class Framing {
  kLength,  // by Content-Length
  kChunks,  // the source writes chunks (RFC 9112, 7.1)
  kUntilConnectionEnds,
};

struct StreamedBody {
  std::unique_ptr<net::Source> source;
  std::string media_type;
  Framing framing = Framing::kLength;
  std::uint64_t length = 0;  // with kLength: the source's bytes, not 0
};

// The patient about whom a response tells, for the audit trail, if it belongs to no volume and no
// job.
struct ToldPatient {
  std::string what;  // "workitem"
  std::string study = {};
  std::string patient_id = {};

  auto operator<=>(const ToldPatient&) const = default;
};

struct Response {
  int status = 200;
  net::Headers headers;
  std::string media_type;
  std::string body;                    // compressed if the client accepts that
  std::optional<StreamedBody> stream;  // instead of `body`; never compressed
  std::optional<ToldPatient> told;

  bool has_header(std::string_view name) const;
  void set_header(std::string_view name, std::string_view value);
  // Adds a header; for names that may occur several times, such as Vary.
  void add_header(std::string_view name, std::string_view value);
  void set_body(std::string text, std::string_view type);
};

// A deferred response: `resume` answers when the job has ended, or at `until` in any case. No
// thread is held until then. With `computing_for` there is no job: `resume` runs on a computing
// thread, in fair order between parties.
struct Continuation {
  std::string job = {};
  std::chrono::steady_clock::time_point until = {};
  std::function<void(const Request& request, Response& response)> resume;
  // Called once, before `resume`, as soon as the client has disconnected. If it is empty, `resume`
  // is called then.
  std::function<void(const Request& request)> abandoned = {};
  std::optional<std::string> computing_for = {};
};

// Answers now or by a continuation. May throw: an Error becomes its problem; all others are logged
// and become kInternal. Called concurrently.
using Handler = std::function<std::optional<Continuation>(const Request&, Response&)>;

// The problem in a record, such as a failed job's. A handler that throws it answers with this
// problem, also with its detail, and does not fail itself.
class RecordedProblem : public Error {
 public:
  explicit RecordedProblem(const Problem& problem) : Error(to_error(problem)), problem_(problem) {}

  const Problem& problem() const { return problem_; }

 private:
  Problem problem_;
};

// Sets the response to the error's problem (RFC 9457), or to that problem at the request's path.
void answer_problem(const Request& request, Response& response, const Error& error);
void answer_problem(const Request& request, Response& response, Problem problem);

// The bytes of a response to a connection whose request was not read.
std::string refusal(const Error& error);

}  // namespace isomesh::http
