#include "proto/json.h"
#include "server/http/request.h"
#include "server/http/routes.h"

namespace isomesh::http {
namespace {

const std::string kVolumes = "/v1/volumes";

void upload(App& app, const httplib::Request& request, httplib::Response& response,
            const httplib::ContentReader& read_body) {
  check_known(request, import_parameters());
  const volume::ImportOptions options = import_options_of(request);
  const auto place = app.uploads.try_take();
  if (!place) throw Error(ErrorCode::kUnavailable, "too many uploads are under way");
  const Upload file(app.services.folder, app.options.upload, app.stopping, request, read_body);
  const auto [volume, is_new] = app.services.library.add(owner(), file.path(), options);
  response.set_header("Location", kVolumes + '/' + volume.id);
  answer_json(response, is_new ? 201 : 200, to_json(volume));
}

}  // namespace

void add_volume_routes(App& app) {
  add_post(app, kVolumes, [&app](const auto& request, auto& response, const auto& read_body) {
    upload(app, request, response, read_body);
  });
  add_get(app, kVolumes, [&app](const auto& request, auto& response) {
    check_known(request, {});
    std::vector<Volume> volumes = app.services.volumes.list(viewer());
    // A hundred volumes of a thousand slices would fill it with their identifiers.
    for (Volume& volume : volumes) volume.dicom.reset();
    answer_json(response, 200, to_json(volumes));
  });
  add_get(app, kVolumes + '/' + kId, [&app](const auto& request, auto& response) {
    check_known(request, {});
    answer_json(response, 200, to_json(app.services.volumes.get(viewer(), id_of(request))));
  });
  add_delete(app, kVolumes + '/' + kId, [&app](const auto& request, auto& response) {
    check_known(request, {});
    app.services.library.erase(owner(), id_of(request));
    response.status = 204;
  });
}

}  // namespace isomesh::http
