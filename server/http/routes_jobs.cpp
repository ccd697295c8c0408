#include <chrono>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <strings.h>

#include "proto/json.h"
#include "server/http/request.h"
#include "server/http/routes.h"
#include "server/http/sources.h"
#include "server/http/upload.h"
#include "server/store/files.h"

namespace isomesh::http {
namespace {

const std::string kJobs = "/v1/jobs";
constexpr std::size_t kMostBodyBytes = 64 * 1024;
constexpr const char* kJobCursor = "jobs";

void answer_with(httplib::Response& response, int status, const Job& job) {
  response.set_header("Location", kJobs + '/' + job.id);
  answer_json(response, status, to_json(job));
}

// A page of another origin may send text without asking first, but not JSON that is called so.
void check_is_json(const httplib::Request& request) {
  std::string type = request.get_header_value("Content-Type");
  type = type.substr(0, type.find(';'));
  while (type.ends_with(' ')) type.pop_back();
  if (type.empty() || ::strcasecmp(type.c_str(), "application/json") == 0) return;
  throw Error(ErrorCode::kUnsupportedMedia, "the body's Content-Type must be application/json");
}

// A body that is not here yet may come slowly, so it takes one of the places that uploads have.
std::string small_body(App& app, const httplib::Request& request,
                       const httplib::ContentReader& read_body) {
  const bool may_be_slow = !Exchange::current()->has_whole_body();
  const auto place = may_be_slow ? app.uploads.try_take() : std::nullopt;
  if (may_be_slow && !place) {
    throw Error(ErrorCode::kUnavailable, "too many uploads are under way");
  }
  return read_text(request, read_body, kMostBodyBytes);
}

void submit(App& app, const httplib::Request& request, httplib::Response& response,
            const httplib::ContentReader& read_body) {
  if (const auto& resumed = Exchange::current()->resumed()) {
    const Job job = app.services.jobs.get(viewer(), resumed->job);
    return answer_with(response, is_final(job.state) ? 200 : 202, job);
  }
  check_known(request, {"wait"});
  const auto wait = wait_of(request);
  check_is_json(request);
  const std::string body = small_body(app, request, read_body);
  store::JobSpec spec = {owner(), parse_job_parameters(body), idempotency_key_of(request), ""};
  const auto& callback = spec.parameters.callback;
  if (callback) app.services.callback_targets.check(callback->url);
  if (!spec.idempotency_key.empty()) spec.request_digest = store::sha256_of(body);
  const Job job = submitted(app, spec, response);
  if (wait_for_end(app, job, wait)) return;
  answer_with(response, wait.count() > 0 && is_final(job.state) ? 200 : 202, job);
}

void get(App& app, const httplib::Request& request, httplib::Response& response) {
  check_known(request, {"wait"});
  const auto wait = wait_of(request);
  const Job job = app.services.jobs.get(viewer(), id_of(request));
  if (wait_for_end(app, job, wait)) return;
  answer_tagged_json(request, response, to_json(job));
}

void list(App& app, const httplib::Request& request, httplib::Response& response) {
  check_known(request, {"state", "cursor", "limit"});
  std::optional<JobState> state;
  if (request.has_param("state")) {
    state = from_string<JobState>(request.get_param_value("state"));
    if (!state) throw invalid_parameter("state", "must be " + names_of<JobState>());
  }
  const std::string after = id_after(request, kJobCursor);
  const std::size_t limit = whole_number_of(request, "limit", kPageSizes, kUsualPageSize);
  std::vector<Job> jobs = app.services.jobs.list(viewer(), state, after, limit + 1);
  std::string next;
  if (jobs.size() > limit) {
    jobs.pop_back();
    next = cursor_after(kJobCursor, jobs.back().id);
  }
  answer_json(response, 200, to_json(jobs, next));
}

void cancel(App& app, const httplib::Request& request, httplib::Response& response) {
  check_known(request, {});
  const std::string id = id_of(request);
  if (request.has_header("If-Match")) {
    check_if_match(request, etag_of(to_json(app.services.jobs.get(viewer(), id))));
  }
  answer_json(response, 200, to_json(app.services.jobs.cancel(viewer(), id)));
}

// What happened to the job after the event `last`. Of progress only the newest is worth telling.
std::vector<store::Event> past_of(const App& app, const std::string& job, std::uint64_t last) {
  std::vector<store::Event> past;
  while (true) {
    const auto more = app.services.jobs.events(viewer(), job, last, std::chrono::milliseconds(0));
    if (more.empty()) return past;
    for (const store::Event& event : more) {
      const bool replaces = event.kind == store::EventKind::kProgress && !past.empty() &&
                            past.back().kind == store::EventKind::kProgress;
      if (replaces) past.pop_back();
      past.push_back(event);
    }
    last = more.back().id;
  }
}

void events(App& app, const httplib::Request& request, httplib::Response& response) {
  check_known(request, {});
  const std::string id = id_of(request);
  const std::uint64_t last = last_event_id(request).value_or(0);
  auto place = app.streams.try_take();
  if (!place) throw Error(ErrorCode::kUnavailable, "too many streams of events are open");
  // Listening before looking: what happens in between comes twice, and is told once.
  auto mailbox = app.events.listen_to(id);
  const Job job = app.services.jobs.get(viewer(), id);
  auto past = past_of(app, id, last);
  if (is_final(job.state) && past.empty()) {
    if (last > 0) {
      response.status = 204;  // tells a browser not to come back
      return;
    }
    // The events are forgotten, the job is not.
    past.push_back({1, "", id, store::EventKind::kDone, job.state, job.stage, job.progress});
  }
  response.status = 200;
  response.set_header("Cache-Control", "no-store");
  response.set_header("X-Accel-Buffering", "no");  // nginx would collect them
  set_body(response, {.source = event_source({.mailbox = std::move(mailbox),
                                              .past = std::move(past),
                                              .last = last,
                                              .result = [&jobs = app.services.jobs, who = viewer(),
                                                         id] { return to_json(jobs.get(who, id)); },
                                              .place = std::move(*place)}),
                      .media_type = "text/event-stream",
                      .framing = Framing::kUntilConnectionEnds});
}

}  // namespace

void add_job_routes(App& app) {
  add_post(app, kJobs, [&app](const auto& request, auto& response, const auto& read_body) {
    submit(app, request, response, read_body);
  });
  add_get(app, kJobs,
          [&app](const auto& request, auto& response) { list(app, request, response); });
  add_get(app, kJobs + '/' + kId,
          [&app](const auto& request, auto& response) { get(app, request, response); });
  add_delete(app, kJobs + '/' + kId,
             [&app](const auto& request, auto& response) { cancel(app, request, response); });
  add_get(app, kJobs + '/' + kId + "/events",
          [&app](const auto& request, auto& response) { events(app, request, response); });
}

}  // namespace isomesh::http
