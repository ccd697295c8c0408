#include "client/isomesh/impl.h"

#include <algorithm>
#include <utility>

#include "client/isomesh/url.h"
#include "proto/json.h"

namespace isomesh {
namespace {

using std::chrono::milliseconds;

// For the server to end the import of a cancelled upload, or to finish storing its volume.
constexpr milliseconds kPartingSilence{5'000};
constexpr milliseconds kPartingRetries{2'000};

TransportOptions transport_options(ClientOptions&& options) {
  const bool sendable =
      std::ranges::all_of(options.token, [](char c) { return c > ' ' && c < '\x7f'; });
  if (!sendable)
    throw invalid_parameter("token", "must consist of ASCII letters, digits and punctuation");
  return {.server = parse_server_address(options.server),
          .server_url = options.server,
          .token = std::move(options.token),
          .authorities = std::move(options.authorities),
          .connect_timeout = options.connect_timeout,
          .silence_timeout = options.silence_timeout,
          .stall_timeout = options.stall_timeout,
          .stop = std::move(options.stop)};
}

PersistentTransport transport_of(ClientOptions options) {
  PersistenceOptions persistence{.retry_timeout = options.retry_timeout,
                                 .busy = std::move(options.busy),
                                 .stop = options.stop};
  return {transport_options(std::move(options)), std::move(persistence)};
}

// The time limits are short, because the user waits.
ClientOptions parting_options(ClientOptions options) {
  options.stop = {};
  options.busy = {};
  options.connect_timeout = std::chrono::seconds{2};
  options.silence_timeout = std::min<milliseconds>(options.silence_timeout, kPartingSilence);
  options.retry_timeout = std::min<milliseconds>(options.retry_timeout, kPartingRetries);
  return options;
}

// For errors of intermediaries, which do not send our problem documents.
ErrorCode code_of_status(int status) {
  const bool is_gateway = status == 502 || status == 504;
  return is_gateway ? ErrorCode::kUnreachable : error_code_of_status(status);
}

Error reason_of(const HttpResponse& response) {
  const std::string status = "the server responded with status " + std::to_string(response.status);
  if (!response.content_type.starts_with("application/problem+json")) {
    return {code_of_status(response.status), status};
  }
  Problem problem;
  try {
    problem = problem_from_json(response.body);
  } catch (const Error&) {
    return {code_of_status(response.status), status};
  }
  Error error = to_error(problem);
  if (error.code() != ErrorCode::kInternal || response.status == 500) return error;
  return Error(code_of_status(response.status), problem.detail.empty() ? status : problem.detail,
               problem.errors)
      .with_remedy(problem.remedy);
}

}  // namespace

Error refusal(const HttpResponse& response) {
  return reason_of(response).with_retry_after(response.retry_after);
}

Client::Impl::Impl(ClientOptions&& options)
    : stop_(options.stop),
      transport_(transport_of(options)),
      parting_(transport_of(parting_options(std::move(options)))) {}

HttpResponse Client::Impl::exchange(const HttpRequest& request) const {
  HttpResponse response = transport_.send(request);
  if (!is_success(response)) throw refusal(response);
  return response;
}

HttpResponse Client::Impl::repeated(const HttpRequest& request,
                                    const std::function<void()>& before) const {
  Backoff backoff = kBroken;
  for (int attempt = 1;; ++attempt) {
    try {
      if (before) before();
      return exchange(request);
    } catch (const NoResponse& lost) {
      if (!lost.broken() || attempt == kTries) throw;
    }
    pause(backoff.next());
  }
}

}  // namespace isomesh
