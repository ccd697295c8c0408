// Helpers for routes.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "proto/error.h"
#include "proto/types.h"
#include "server/http/app/app.h"
#include "server/http/limits.h"
#include "server/http/requests/request_values.h"
#include "server/http/responses/list_page.h"
#include "server/http/responses/sources.h"

namespace isomesh::http {

// `run` is a Handler, or a function with the same arguments that returns nothing.
template <class Run>
void add_get(App& app, const std::string& pattern, const Run& run) {
  for (const char* method : {"GET", "HEAD"}) app.router.add(method, pattern, handler_of(run));
}
// The same for expensive responses: `run` is called on computing threads, in fair order between
// parties.
template <class Run>
void add_computed_get(App& app, const std::string& pattern, const Run& run) {
  add_get(app, pattern, [run](const Request& request, Response& /*response*/) {
    return std::optional(Continuation{.resume = run, .computing_for = party_of(request)});
  });
}
template <class Run>
void add_post(App& app, const std::string& pattern, const Run& run) {
  app.router.add("POST", pattern, handler_of(run));
}
template <class Run>
void add_patch(App& app, const std::string& pattern, const Run& run) {
  app.router.add("PATCH", pattern, handler_of(run));
}
template <class Run>
void add_put(App& app, const std::string& pattern, const Run& run) {
  app.router.add("PUT", pattern, handler_of(run));
}
template <class Run>
void add_delete(App& app, const std::string& pattern, const Run& run) {
  app.router.add("DELETE", pattern, handler_of(run));
}

void answer_json(Response& response, int status, const std::string& json);

// Answers 200 with a body computed in pieces.
void answer_pieces(const Request& request, Response& response, const char* media_type,
                   NextPiece next);

// Answers with a page of a list, as plain JSON if it is a single piece, otherwise in pieces.
template <class Row>
void answer_list(const Request& request, Response& response, ListRequest<Row> list) {
  const auto page = std::make_shared<ListPage<Row>>(std::move(list));
  std::optional<std::string> first = page->next();
  if (page->is_over()) return answer_json(response, 200, *first);
  response.set_header("Cache-Control", "no-store");
  answer_pieces(request, response, "application/json", [page, first = std::move(first)]() mutable {
    return first ? std::exchange(first, std::nullopt) : page->next();
  });
}

std::string etag_of(const std::string& text);
// For mutable content: the client caches and revalidates it.
inline constexpr const char* kAskEachTime = "private, no-cache";
// Sets the headers of cacheable content. Returns true if the client has it already; then the
// response is complete. Throws Error kPreconditionFailed.
bool is_known(const Request& request, Response& response, const std::string& etag,
              const char* cache_control);
// Answers 200, or 304 if the client has the content already. Throws Error kPreconditionFailed.
void answer_tagged(const Request& request, Response& response, const std::string& text,
                   const char* media_type);
void answer_tagged_json(const Request& request, Response& response, const std::string& json);
// The allowed numbers of entries in one response, and the default.
inline constexpr WholeNumbers kListLengths = {1, limits::kMostListed};
inline constexpr std::uint64_t kUsualListLength = 100;

// Throws Error kUnavailable if all places are taken or the service stops, and kTooManyRequests if
// the sender has its fair share.
net::FairPlaces::Place place_for_upload(App& app, const Request& request);

// Reads a small JSON body. A body that has not arrived yet may be slow, so reading it takes one of
// the places for uploads. Throws as place_for_upload and read_text do.
std::string json_body(App& app, const Request& request);
// The same, with this type instead of application/json, and of at most that size.
std::string json_body(App& app, const Request& request, std::string_view type,
                      std::size_t most_bytes);

// Completes the parameters from their volume; see jobs::resolve_preset and jobs::complete_labels.
// Throws as these do, and Error kNotFound without the volume.
JobParameters complete_parameters(const App& app, const Request& request, JobParameters parameters);

// Submits a job. Throws as store::job_of does.
Job submitted(App& app, const store::JobSpec& spec);

using JobResponder = std::function<void(const Request&, Response&, const Job&)>;

// Calls `answer` with the job's state when it has ended or `wait` is over: now, or by a
// continuation.
std::optional<Continuation> answer_at_end(App& app, const Request& request, Response& response,
                                          const Job& job, std::chrono::milliseconds wait,
                                          const JobResponder& answer);

struct WhichMesh {
  MeshFormat format = MeshFormat::kDrc;
  std::optional<std::int64_t> label = {};
};

// Answers with a finished job's mesh file: entity tag, one range, timings.
void answer_mesh(const App& app, const Request& request, Response& response, const Job& job,
                 const WhichMesh& which);

void add_volume_routes(App& app);
void add_upload_routes(App& app);
void add_job_routes(App& app);
void add_mesh_routes(App& app);
void add_inspect_routes(App& app);
void add_page_routes(App& app);
void add_service_routes(App& app);

}  // namespace isomesh::http
