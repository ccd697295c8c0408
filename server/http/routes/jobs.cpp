#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/sha256.h"
#include "base/text.h"
#include "proto/json.h"
#include "server/http/requests/request_values.h"
#include "server/http/requests/upload.h"
#include "server/http/routes/routes.h"

namespace isomesh::http {
namespace {

const std::string kJobs = "/v1/jobs";
constexpr const char* kJobCursor = "jobs";

void answer_with(Response& response, int status, const Job& job) {
  response.set_header("Location", kJobs + '/' + job.id);
  answer_json(response, status, to_json(job));
}

std::optional<Continuation> submit(App& app, const Request& request, Response& response) {
  check_known(request, {"wait"});
  const auto wait = wait_of(request);
  const std::string body = json_body(app, request);
  store::JobSpec spec = {owner_of(request), parse_job_parameters(body), idempotency_key_of(request),
                         ""};
  const auto& callback = spec.parameters.callback;
  if (callback) app.services.callback_targets.check(callback->url);
  if (!spec.idempotency_key.empty()) spec.request_digest = sha256_of(body);
  {
    // The first count of the volume's labels reads all of it.
    const auto place =
        spec.parameters.labels ? place_for_upload(app, request) : net::FairPlaces::Place();
    spec.parameters = complete_parameters(app, request, spec.parameters);
  }
  const Job job = submitted(app, spec);
  const bool waits = wait.count() > 0;
  return answer_at_end(app, request, response, job, wait,
                       [waits](const Request& /*request*/, Response& out, const Job& now) {
                         answer_with(out, waits && is_final(now.state) ? 200 : 202, now);
                       });
}

std::optional<Continuation> get(App& app, const Request& request, Response& response) {
  check_known(request, {"wait"});
  const auto wait = wait_of(request);
  const Job job = app.services.jobs.get(viewer_of(request), request.path_parameter("id"));
  return answer_at_end(app, request, response, job, wait,
                       [](const Request& asked, Response& out, const Job& now) {
                         answer_tagged_json(asked, out, to_json(now));
                       });
}

// Omits the jobs' labels, which may be many.
std::vector<Job> rows_of(std::vector<Job> jobs) {
  for (Job& job : jobs) {
    if (job.mesh) job.mesh->labels.clear();
    job.parameters.label_names.clear();
    job.parameters.label_colors.clear();
    job.parameters.label_values.clear();
  }
  return jobs;
}

store::JobFilter filter_of(const Request& request) {
  store::JobFilter filter = {.since = instant_of(request, "since"),
                             .until = instant_of(request, "until")};
  if (request.has_parameter("state")) {
    filter.state = from_string<JobState>(request.parameter("state"));
    if (!filter.state) throw invalid_parameter("state", "must be " + names_of<JobState>());
  }
  if (request.has_parameter("volume")) filter.volume = request.parameter("volume");
  return filter;
}

void list(App& app, const Request& request, Response& response) {
  check_known(request, {"state", "volume", "since", "until", "cursor", "limit"});
  const store::JobFilter filter = filter_of(request);
  const std::string after = id_after(request, kJobCursor);
  const std::size_t limit = whole_number_of(request, "limit", kListLengths, kUsualListLength);
  answer_list<Job>(
      request, response,
      {.kind = kJobCursor,
       .after = after,
       .limit = limit,
       .read = [&jobs = app.services.jobs, viewer = viewer_of(request), filter](
                   const std::string& from,
                   std::size_t count) { return rows_of(jobs.list(viewer, filter, from, count)); },
       .place_of = [](const Job& job) { return job.id; }});
}

// Cancels a job that has not ended, and erases one that has.
void cancel_or_erase(App& app, const Request& request, Response& response) {
  check_known(request, {"erase"});
  const bool may_erase = flag_of(request, "erase", true);
  const std::string id = request.path_parameter("id");
  const store::Viewer viewer = viewer_of(request);
  if (request.has_header("If-Match")) {
    check_if_match(request, etag_of(to_json(app.services.jobs.get(viewer, id))));
  }
  if (may_erase && app.services.library.erase_job(app.services.jobs, viewer, id)) {
    response.status = 204;
    return;
  }
  answer_json(response, 200, to_json(app.services.jobs.cancel(viewer, id)));
}

// All events of the job so far, without superseded progress.
std::vector<store::Event> past_of(const App& app, const store::Viewer& viewer,
                                  const std::string& job) {
  std::vector<store::Event> past;
  std::uint64_t last = 0;
  while (true) {
    const auto more = app.services.jobs.events(viewer, job, last, std::chrono::milliseconds(0));
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

void answer_events(Response& response, std::unique_ptr<net::Source> source) {
  response.status = 200;
  response.set_header("Cache-Control", "no-store");
  response.set_header("X-Accel-Buffering", "no");  // nginx would buffer them
  response.stream = {.source = std::move(source),
                     .media_type = "text/event-stream",
                     .framing = Framing::kUntilConnectionEnds};
}

void events(App& app, const Request& request, Response& response) {
  check_known(request, {});
  const std::string id = request.path_parameter("id");
  const std::uint64_t last = last_event_id(request).value_or(0);
  auto place = app.streams.take(party_of(request));
  // The mailbox exists before the past is read, so no event is missed. The source removes
  // duplicates.
  auto mailbox = app.events.listen_to(id);
  const Job job = app.services.jobs.get(viewer_of(request), id);
  auto past = past_of(app, viewer_of(request), id);
  const bool is_told = !past.empty() && past.back().kind == store::EventKind::kDone;
  const bool is_forgotten = past.empty() && last > 0;  // jobs outlive their events
  if (is_final(job.state) && !is_told && !is_forgotten) {
    // The state of a job can be read shortly before the event of its end.
    const std::uint64_t next = std::max(last, past.empty() ? 0 : past.back().id) + 1;
    past.push_back({next, "", id, store::EventKind::kDone, job.state, job.stage, job.progress});
  }
  std::erase_if(past, [last](const store::Event& event) { return event.id <= last; });
  if (is_final(job.state) && past.empty()) {
    response.status = 204;  // tells a browser not to reconnect
    return;
  }
  answer_events(response,
                event_source({.mailbox = std::move(mailbox),
                              .past = std::move(past),
                              .last = last,
                              .result = [&jobs = app.services.jobs, who = viewer_of(request),
                                         id] { return to_json(jobs.get(who, id)); },
                              .place = std::move(place),
                              .may_listen = validity_of(app.logins, request)}));
}

void all_events(App& app, const Request& request, Response& response) {
  check_known(request, {});
  auto place = app.streams.take(party_of(request));
  answer_events(response, event_source(app.events.listen_to_all(viewer_of(request)),
                                       std::move(place), validity_of(app.logins, request)));
}

}  // namespace

void add_job_routes(App& app) {
  add_post(app, kJobs,
           [&app](const auto& request, auto& response) { return submit(app, request, response); });
  add_computed_get(app, kJobs,
                   [&app](const auto& request, auto& response) { list(app, request, response); });
  add_get(app, kJobs + "/{id}",
          [&app](const auto& request, auto& response) { return get(app, request, response); });
  add_delete(app, kJobs + "/{id}", [&app](const auto& request, auto& response) {
    cancel_or_erase(app, request, response);
  });
  add_get(app, kJobs + "/{id}/events",
          [&app](const auto& request, auto& response) { events(app, request, response); });
  add_get(app, "/v1/events",
          [&app](const auto& request, auto& response) { all_events(app, request, response); });
}

}  // namespace isomesh::http
