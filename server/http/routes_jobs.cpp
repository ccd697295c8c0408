#include <charconv>

#include "proto/json.h"
#include "server/http/request.h"
#include "server/http/routes.h"
#include "server/http/upload.h"
#include "server/store/files.h"

namespace isomesh::http {
namespace {

const std::string kJobs = "/v1/jobs";
constexpr std::size_t kMostBodyBytes = 64 * 1024;
constexpr std::size_t kJobsPerPage = 100;

// The job after at most `wait`. When all places for waiting are taken, its present state: `wait` is
// an upper bound.
Job waited(App& app, const std::string& id, std::chrono::milliseconds wait) {
  const auto place = wait.count() > 0 ? app.waits.try_take() : std::nullopt;
  return place ? app.services.jobs.wait(viewer(), id, wait) : app.services.jobs.get(viewer(), id);
}

void submit(App& app, const httplib::Request& request, httplib::Response& response,
            const httplib::ContentReader& read_body) {
  check_known(request, {"wait"});
  const std::string body = read_text(request, read_body, kMostBodyBytes);
  store::JobSpec spec = {owner(), parse_job_parameters(body), idempotency_key_of(request), ""};
  if (!spec.idempotency_key.empty()) spec.request_digest = store::sha256_of(body);
  const auto wait = wait_of(request);
  Job job = store::job_of(app.services.jobs.submit(spec));
  if (wait.count() > 0) job = waited(app, job.id, wait);
  response.set_header("Location", kJobs + '/' + job.id);
  answer_json(response, wait.count() > 0 && is_final(job.state) ? 200 : 202, to_json(job));
}

void list(App& app, const httplib::Request& request, httplib::Response& response) {
  check_known(request, {"state", "cursor"});
  std::optional<JobState> state;
  if (request.has_param("state")) {
    state = from_string<JobState>(request.get_param_value("state"));
    if (!state) throw invalid_parameter("state", "must be " + names_of<JobState>());
  }
  const std::string cursor = request.get_param_value("cursor");
  std::vector<Job> jobs = app.services.jobs.list(viewer(), state, cursor, kJobsPerPage + 1);
  std::string next;
  if (jobs.size() > kJobsPerPage) {
    jobs.pop_back();
    next = jobs.back().id;
  }
  answer_json(response, 200, to_json(jobs, next));
}

}  // namespace

void add_job_routes(App& app) {
  add_post(app, kJobs, [&app](const auto& request, auto& response, const auto& read_body) {
    submit(app, request, response, read_body);
  });
  add_get(app, kJobs,
          [&app](const auto& request, auto& response) { list(app, request, response); });
  add_get(app, kJobs + '/' + kId, [&app](const auto& request, auto& response) {
    check_known(request, {"wait"});
    answer_json(response, 200, to_json(waited(app, id_of(request), wait_of(request))));
  });
  add_delete(app, kJobs + '/' + kId, [&app](const auto& request, auto& response) {
    check_known(request, {});
    answer_json(response, 200, to_json(app.services.jobs.cancel(viewer(), id_of(request))));
  });
}

}  // namespace isomesh::http
