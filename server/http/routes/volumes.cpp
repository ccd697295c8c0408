#include "proto/json.h"
#include "server/http/import_query.h"
#include "server/http/observe/outcomes.h"
#include "server/http/request_values.h"
#include "server/http/routes/routes.h"

namespace isomesh::http {
namespace {

const std::string kVolumes = "/v1/volumes";
constexpr const char* kVolumeCursor = "volumes";

void upload(App& app, const Request& request, Response& response) {
  check_known(request, import_parameters());
  const process::ImportOptions options = import_options_of(request);
  const auto place = place_for_upload(app, request);
  const Upload file(app.services.folder, app.options.upload, app.stopping, request);
  const std::vector<UploadedVolume> volumes = counting_refusals(app, request, [&] {
    return app.services.library.add_all(owner_of(request), file.path(), options, file.name());
  });
  for (const UploadedVolume& each : volumes) {
    if (each.problem) report_import_refused(app, request, to_error(*each.problem));
  }
  if (volumes.size() != 1 || !volumes.front().volume) {
    constexpr int kMultiStatus = 207;
    return answer_json(response, kMultiStatus, to_json(volumes));
  }
  const UploadedVolume& only = volumes.front();
  response.set_header("Location", kVolumes + '/' + only.volume->id);
  answer_json(response, only.status, to_json(*only.volume));
}

// Whether that has the form of what store::cursor_of makes: a time, a space and an id.
bool is_place(const std::string& text) {
  constexpr std::size_t kTime = std::string_view("2026-11-20T07:00:00.000").size();
  const std::size_t space = text.find(' ');
  return space != std::string::npos && space > kTime && text[10] == 'T' && text[space - 1] == 'Z' &&
         text.find_first_not_of("0123456789-T:.Z", 0) == space;
}

store::ListOrder order_of(const Request& request) {
  const std::string_view order =
      request.has_parameter("order") ? request.parameter("order") : "oldest";
  if (order != "oldest" && order != "newest") {
    throw invalid_parameter("order", R"(must be "oldest" or "newest")");
  }
  return order == "newest" ? store::ListOrder::kNewestFirst : store::ListOrder::kOldestFirst;
}

void list(App& app, const Request& request, Response& response) {
  check_known(request, {"cursor", "limit", "order"});
  const store::ListOrder order = order_of(request);
  const std::string after = id_after(request, kVolumeCursor);
  if (!after.empty() && !is_place(after)) throw wrong_cursor();
  const std::size_t limit = whole_number_of(request, "limit", kListLengths, kUsualListLength);
  const auto read = [&volumes = app.services.volumes, viewer = viewer_of(request), order](
                        const std::string& from, std::size_t count) {
    std::vector<Volume> rows = volumes.list(viewer, from, count, order);
    // Lists leave out the identifiers of slices, of which one volume may have thousands.
    for (Volume& row : rows) row.dicom.reset();
    return rows;
  };
  answer_list<Volume>(request, response,
                      {.kind = kVolumeCursor,
                       .after = after,
                       .limit = limit,
                       .read = read,
                       .place_of = store::cursor_of});
}

void get(App& app, const Request& request, Response& response) {
  check_known(request, {});
  const Volume volume = app.services.volumes.get(viewer_of(request), request.path_parameter("id"));
  answer_tagged_json(request, response, to_json(volume));
}

// What a volume is called is all of it that can change.
void rename(App& app, const Request& request, Response& response) {
  check_known(request, {});
  const std::string id = request.path_parameter("id");
  const std::optional<std::string> name = parse_volume_name(json_body(app, request));
  if (request.has_header("If-Match")) {
    check_if_match(request, etag_of(to_json(app.services.volumes.get(viewer_of(request), id))));
  }
  answer_json(response, 200, to_json(app.services.library.rename(owner_of(request), id, name)));
}

void erase(App& app, const Request& request, Response& response) {
  check_known(request, {});
  const std::string id = request.path_parameter("id");
  if (request.has_header("If-Match")) {
    check_if_match(request, etag_of(to_json(app.services.volumes.get(viewer_of(request), id))));
  }
  app.services.library.erase(viewer_of(request), id);
  response.status = 204;
}

}  // namespace

void add_volume_routes(App& app) {
  add_post(app, kVolumes,
           [&app](const auto& request, auto& response) { upload(app, request, response); });
  add_computed_get(app, kVolumes,
                   [&app](const auto& request, auto& response) { list(app, request, response); });
  add_get(app, kVolumes + "/{id}",
          [&app](const auto& request, auto& response) { get(app, request, response); });
  add_patch(app, kVolumes + "/{id}",
            [&app](const auto& request, auto& response) { rename(app, request, response); });
  add_delete(app, kVolumes + "/{id}",
             [&app](const auto& request, auto& response) { erase(app, request, response); });
}

}  // namespace isomesh::http
