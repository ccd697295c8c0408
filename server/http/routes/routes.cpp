#include "server/http/routes/routes.h"

#include <exception>
#include <filesystem>
#include <new>

#include "base/log.h"
#include "base/sha256.h"
#include "base/text.h"
#include "proto/json.h"
#include "server/http/limits.h"
#include "server/http/requests/upload.h"
#include "server/jobs/library/complete_labels.h"
#include "server/jobs/making/crop.h"

namespace isomesh::http {
namespace {

// Browsers let foreign pages send plain text without a preflight, but not JSON.
void check_is_json(const Request& request, std::string_view wanted) {
  const std::string_view type = split(request.header("Content-Type"), ';').front();
  if (type.empty() || lower(type) == wanted) return;
  throw Error(ErrorCode::kUnsupportedMedia,
              "the body's Content-Type must be " + std::string(wanted));
}

}  // namespace

std::optional<Continuation> answer_at_end(App& app, const Request& request, Response& response,
                                          const Job& job, std::chrono::milliseconds wait,
                                          const JobResponder& answer) {
  if (is_final(job.state) || wait.count() == 0 || app.stopping) {
    answer(request, response, job);
    return std::nullopt;
  }
  return Continuation{.job = job.id,
                      .until = std::chrono::steady_clock::now() + wait,
                      .resume = [&app, id = job.id, answer](const Request& asked, Response& out) {
                        answer(asked, out, app.services.jobs.get(viewer_of(asked), id));
                      }};
}

void answer_json(Response& response, int status, const std::string& json) {
  response.status = status;
  response.set_header("Cache-Control", "no-store");
  response.set_body(json, "application/json");
}

void answer_pieces(const Request& request, Response& response, const char* media_type,
                   NextPiece next) {
  const bool in_chunks = request.version != "HTTP/1.0";
  response.status = 200;
  response.stream = {.source = computed_source(std::move(next), in_chunks),
                     .media_type = media_type,
                     .framing = in_chunks ? Framing::kChunks : Framing::kUntilConnectionEnds};
}

std::string etag_of(const std::string& text) {
  constexpr std::size_t kEnough = 32;  // hex digits, of 64
  return '"' + sha256_of(text).substr(0, kEnough) + '"';
}

bool is_known(const Request& request, Response& response, const std::string& etag,
              const char* cache_control) {
  check_if_match(request, etag);
  response.set_header("ETag", etag);
  response.set_header("Cache-Control", cache_control);
  if (!matches_etag(request, etag)) return false;
  response.status = 304;
  return true;
}

void answer_tagged(const Request& request, Response& response, const std::string& text,
                   const char* media_type) {
  if (is_known(request, response, etag_of(text), kAskEachTime)) return;
  response.status = 200;
  response.set_body(text, media_type);
}

void answer_tagged_json(const Request& request, Response& response, const std::string& json) {
  answer_tagged(request, response, json, "application/json");
}

net::FairPlaces::Place place_for_upload(App& app, const Request& request) {
  if (app.draining) throw Error(ErrorCode::kUnavailable, "the service is shutting down");
  return app.uploads.take(party_of(request));
}

std::string json_body(App& app, const Request& request) {
  return json_body(app, request, "application/json", limits::kMostJsonBytes);
}

std::string json_body(App& app, const Request& request, std::string_view type,
                      std::size_t most_bytes) {
  check_is_json(request, type);
  const auto place =
      request.body->is_whole() ? net::FairPlaces::Place() : app.uploads.take(party_of(request));
  return read_text(request, most_bytes);
}

JobParameters complete_parameters(const App& app, const Request& request,
                                  JobParameters parameters) {
  if (!parameters.labels && !parameters.crop && parameters.preset.empty()) return parameters;
  const store::Viewer viewer = viewer_of(request);
  const Volume volume = app.services.volumes.get(viewer, parameters.volume);
  if (parameters.crop) jobs::samples_in(*parameters.crop, volume.geometry, volume.dims);
  jobs::resolve_preset(parameters, volume);
  if (!parameters.labels) return parameters;
  return jobs::complete_labels(std::move(parameters), viewer, volume, app.services.labels);
}

Job submitted(App& app, const store::JobSpec& spec) {
  const store::Submission submission = app.services.jobs.submit(spec);
  if (submission.kind == store::Submission::Kind::kBusy && app.draining) {
    throw Error(ErrorCode::kUnavailable, "the service is shutting down");
  }
  return store::job_of(submission);
}

}  // namespace isomesh::http
