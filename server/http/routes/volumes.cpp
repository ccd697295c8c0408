#include <algorithm>
#include <filesystem>

#include "proto/json.h"
#include "server/http/app/outcomes.h"
#include "server/http/requests/import_query.h"
#include "server/http/requests/request_values.h"
#include "server/http/routes/routes.h"
#include "server/http/routes/uploads.h"
#include "server/volume/geometry.h"
#include "server/volume/names.h"

namespace isomesh::http {
namespace {

const std::string kVolumes = "/v1/volumes";
constexpr const char* kVolumeCursor = "volumes";

// The name of a rejected upload that is kept; clients send it as the request's parameter `upload`.
constexpr const char* kUploadHeader = "Isomesh-Upload";

constexpr const char* kKeep = "keep";

bool is_to_be_kept(const Request& request) { return flag_of(request, kKeep, false); }

// A request for a kept upload that has no options has those of the upload's beginning.
Request with_own_options(const Request& request, const KeptUploads::Partial& upload) {
  Request asked = request;
  if (upload && import_parameters_in(request.query).empty()) {
    for (auto& option : import_parameters_in(upload->note().query)) {
      asked.query.push_back(std::move(option));
    }
  }
  return asked;
}

// The request's body, or a kept upload.
KeptBody body_of(App& app, const Request& request, const KeptUploads::Partial& partial) {
  if (request.has_parameter("upload")) {
    std::string name(request.parameter("upload"));
    return {app.kept.find(owner_of(request), name), std::move(name), partial};
  }
  check_told_length(request, request.content_length);
  make_room_for(app, request.content_length.value_or(0));
  const auto upload = std::make_shared<const Upload>(app.services.folder, app.options.upload,
                                                     app.stopping, request);
  if (!request.content_length) {
    check_told_length(request, std::filesystem::file_size(upload->body().path));
  }
  return {.file = {upload, &upload->body()}};
}

// True if another request may succeed: with a selection, or with a description of raw samples.
bool may_be_helped(const Error& error) {
  return error.code() == ErrorCode::kUnsupportedMedia || error.remedy() != Remedy();
}

bool is_stored(const UploadedVolume& each) { return each.volume.has_value(); }

void keep(App& app, const Request& request, Response& response, const KeptBody& body) {
  response.set_header(kUploadHeader,
                      body.name.empty() ? app.kept.keep(owner_of(request), body.file) : body.name);
}

std::vector<UploadedVolume> imported(App& app, const Request& request, Response& response,
                                     const KeptBody& body) {
  const ImportOptions options = import_options_of(request);
  const bool is_kept = is_to_be_kept(request);
  const PartialUpload::Reading reading(body.partial);
  const jobs::ImportControl control = {
      .cancelled = reading.cancelled(),
      .stored = [&reading](const std::string& id) { reading.stored(id); }};
  try {
    std::vector<UploadedVolume> volumes = counting_refusals(app, request, [&] {
      return app.services.library.add_all(owner_of(request), body.file->path, options,
                                          body.file->name, party_of(request), control);
    });
    bool is_helped = false;
    for (const UploadedVolume& each : volumes) {
      if (!each.problem) continue;
      const Error error = to_error(*each.problem);
      report_import_refused(app, request, error);
      is_helped = is_helped || may_be_helped(error);
    }
    if (is_kept && is_helped) keep(app, request, response, body);
    return volumes;
  } catch (const Error& error) {
    if (is_kept && may_be_helped(error)) keep(app, request, response, body);
    throw;
  }
}

std::set<std::string> upload_parameters() {
  std::set<std::string> names = import_parameters();
  names.insert({kKeep, "upload"});
  return names;
}

// Null for an upload that is not resumable, and without one.
KeptUploads::Partial partial_of(App& app, const Request& request) {
  if (!request.has_parameter("upload")) return nullptr;
  if (request.has_body()) {
    throw invalid_parameter("upload", "names a body that the service already has: send no body");
  }
  return app.kept.partial_of(owner_of(request), std::string(request.parameter("upload")));
}

// A client that missed the response to the last part asks by the upload's name, with the same
// options. With others the upload would be another volume.
bool answer_what_it_became(App& app, const Request& request, Response& response,
                           const KeptUploads::Partial& upload) {
  if (!upload) return false;
  const PartialNote note = upload->note();
  if (note.volume.empty()) return false;
  Request first;
  first.query = note.read_with;
  if (import_options_of(first) != import_options_of(request)) return false;
  const std::string id = volume_from_json(note.volume).id;
  if (!app.services.volumes.contains(owner_of(request), id)) return false;  // it was deleted since
  response.set_header("Location", kVolumes + '/' + id);
  answer_json(response, 200, note.volume);
  return true;
}

void upload(App& app, const Request& request, Response& response) {
  check_known(request, upload_parameters());
  import_options_of(request);
  is_to_be_kept(request);
  if (begins_upload(request)) return begin_upload(app, request, response);
  const KeptUploads::Partial partial = partial_of(app, request);
  const Request asked = with_own_options(request, partial);
  if (answer_what_it_became(app, asked, response, partial)) return;
  const auto place = place_for_upload(app, request);
  answer_volumes(app, asked, response, body_of(app, asked, partial));
}

// True for the form of store::cursor_of: a time, a space and an id.
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
    // Lists omit the identifiers of slices; one volume may have thousands.
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

// Only a volume's name can change.
void rename(App& app, const Request& request, Response& response) {
  check_known(request, {});
  const std::string id = request.path_parameter("id");
  std::optional<std::string> name = parse_volume_name(json_body(app, request));
  if (name) name = volume::normalized(*name);
  if (request.has_header("If-Match")) {
    check_if_match(request, etag_of(to_json(app.services.volumes.get(viewer_of(request), id))));
  }
  answer_json(response, 200, to_json(app.services.library.rename(owner_of(request), id, name)));
}

void reorient(App& app, const Request& request, Response& response) {
  check_known(request, {"axes"});
  const auto order = volume::parse_axis_order(request.parameter("axes"));
  if (!order || *order == volume::kFilesOrder) {
    throw invalid_parameter("axes",
                            "must be x, y and z, each with a minus or without, in any "
                            "order but x,y,z, such as -x,y,z");
  }
  const auto place = place_for_upload(app, request);
  const auto [volume, is_new] =
      app.services.library.reorient(owner_of(request), request.path_parameter("id"), *order);
  response.set_header("Location", kVolumes + '/' + volume.id);
  answer_json(response, is_new ? 201 : 200, to_json(volume));
}

store::Made what_was_made_of(const Request& request) {
  const std::string_view jobs = request.has_parameter("jobs") ? request.parameter("jobs") : "keep";
  if (jobs != "keep" && jobs != "erase") {
    throw invalid_parameter("jobs", R"(must be "keep" or "erase")");
  }
  return jobs == "erase" ? store::Made::kErased : store::Made::kKept;
}

void erase(App& app, const Request& request, Response& response) {
  check_known(request, {"jobs"});
  const store::Made made = what_was_made_of(request);
  const std::string id = request.path_parameter("id");
  if (request.has_header("If-Match")) {
    check_if_match(request, etag_of(to_json(app.services.volumes.get(viewer_of(request), id))));
  }
  app.services.library.erase(viewer_of(request), id, made);
  response.status = 204;
}

}  // namespace

bool KeptBody::is_to_stay() const {
  if (!partial) return !name.empty();  // it is kept because its sender asked for it
  Request first;
  first.query = partial->note().query;
  return is_to_be_kept(first);
}

void make_room_for(App& app, std::uint64_t bytes) {
  app.services.folder.check_is_there();
  if (bytes > app.options.upload.max_bytes) return;  // it will be rejected
  store::Reserve& reserve = app.services.folder.reserve();
  const std::uint64_t free = reserve.free_bytes();
  // Nobody loses an upload in vain.
  const bool is_too_much = bytes > free && bytes - free > app.kept.idle_bytes();
  if (is_too_much || (reserve.has_room() && bytes <= free)) return;
  app.kept.let_all_go();
}

void answer_volumes(App& app, const Request& request, Response& response, const KeptBody& body) {
  const std::vector<UploadedVolume> volumes = imported(app, request, response, body);
  const UploadedVolume& only = volumes.front();
  const bool is_one = volumes.size() == 1 && only.volume;
  // Another choice may follow: another series, volume or member, or other options.
  const Parameters options = import_parameters_in(request.query);
  const bool stays = !options.empty() && (is_to_be_kept(request) || body.is_to_stay());
  if (!body.name.empty() && !stays) {
    if (is_one) {
      app.kept.finish(owner_of(request), body.name, to_json(*only.volume), options);
    } else if (!body.partial && std::ranges::all_of(volumes, is_stored)) {
      app.kept.let_go(owner_of(request), body.name);
    }
  }
  if (!is_one) {
    constexpr int kMultiStatus = 207;
    return answer_json(response, kMultiStatus, to_json(volumes));
  }
  response.set_header("Location", kVolumes + '/' + only.volume->id);
  answer_json(response, only.status, to_json(*only.volume));
}

void add_volume_routes(App& app) {
  add_post(app, kVolumes,
           [&app](const auto& request, auto& response) { upload(app, request, response); });
  add_computed_get(app, kVolumes,
                   [&app](const auto& request, auto& response) { list(app, request, response); });
  add_get(app, kVolumes + "/{id}",
          [&app](const auto& request, auto& response) { get(app, request, response); });
  add_patch(app, kVolumes + "/{id}",
            [&app](const auto& request, auto& response) { rename(app, request, response); });
  add_post(app, kVolumes + "/{id}/reoriented",
           [&app](const auto& request, auto& response) { reorient(app, request, response); });
  add_delete(app, kVolumes + "/{id}",
             [&app](const auto& request, auto& response) { erase(app, request, response); });
}

}  // namespace isomesh::http
