// Routes for exploring a volume before a job: histograms, labels, slices, previews, estimates.
#include <memory>
#include <utility>

#include "base/text.h"
#include "proto/json.h"
#include "server/http/limits.h"
#include "server/http/requests/request_values.h"
#include "server/http/routes/routes.h"
#include "server/jobs/library/intact_volume.h"
#include "server/volume/preview.h"
#include "server/volume/slice.h"

namespace isomesh::http {
namespace {

constexpr std::uint64_t kUsualBins = 256;
constexpr std::uint64_t kUsualPreviewSize = 128;

// A volume's id determines its content, so derived data never changes.
constexpr const char* kForever = "private, max-age=31536000, immutable";

void histogram(App& app, const Request& request, Response& response) {
  check_known(request, {"bins"});
  const Volume volume = app.services.volumes.get(viewer_of(request), request.path_parameter("id"));
  const std::uint64_t bins = whole_number_of(request, "bins", {1, limits::kMostBins}, kUsualBins);
  const std::string etag = '"' + volume.id + ".bins" + std::to_string(bins) + '"';
  if (is_known(request, response, etag, kForever)) return;
  response.status = 200;
  response.set_body(to_json(app.services.histograms.of(viewer_of(request), volume, bins)),
                    "application/json");
}

// Without the window.
volume::SliceChoice slice_choice(const Request& request, const Volume& volume) {
  volume::SliceChoice choice;
  if (request.has_parameter("axis")) {
    const auto axis = volume::axis_of(request.parameter("axis"));
    if (!axis) throw invalid_parameter("axis", R"(must be "x", "y" or "z")");
    choice.axis = *axis;
  }
  const std::uint32_t slices = volume.dims.at(static_cast<std::size_t>(choice.axis));
  choice.index =
      static_cast<std::uint32_t>(whole_number_of(request, "index", {0, slices - 1}, slices / 2));
  return choice;
}

std::shared_ptr<const volume::CanonicalFile> samples_of(const App& app, const Volume& volume) {
  return std::make_shared<const volume::CanonicalFile>(
      jobs::intact_volume(app.services.blobs, volume.samples).path);
}

void slice_samples(App& app, const Request& request, Response& response) {
  check_known(request, {"axis", "index"});
  const Volume volume = app.services.volumes.get(viewer_of(request), request.path_parameter("id"));
  const volume::SliceChoice choice = slice_choice(request, volume);
  const std::string etag = '"' + volume.id + ".samples." + std::string(to_string(choice.axis)) +
                           std::to_string(choice.index) + '"';
  if (is_known(request, response, etag, kForever)) return;
  const auto slice =
      std::make_shared<volume::SliceSamples>(samples_of(app, volume), choice.axis, choice.index);
  response.status = 200;
  response.set_header("Accept-Ranges", "none");
  response.set_header("Isomesh-Sample-Type", std::string(to_string(volume.type)));
  response.set_header("Isomesh-Slice",
                      std::to_string(slice->width()) + ',' + std::to_string(slice->height()));
  response.stream = {.source = computed_source([slice] { return slice->next(); }, false),
                     .media_type = "application/octet-stream",
                     .framing = Framing::kLength,
                     .length = slice->row_bytes() * slice->height()};
}

void slice(App& app, const Request& request, Response& response) {
  check_known(request, {"axis", "index", "window"});
  const Volume volume = app.services.volumes.get(viewer_of(request), request.path_parameter("id"));
  volume::SliceChoice choice = slice_choice(request, volume);
  choice.window = interval_of(request, "window").value_or(volume.range);
  const std::string etag = '"' + volume.id + '.' + std::string(to_string(choice.axis)) +
                           std::to_string(choice.index) + '.' + to_text(choice.window[0]) + '.' +
                           to_text(choice.window[1]) + '"';
  if (is_known(request, response, etag, kForever)) return;
  const auto picture = std::make_shared<volume::SlicePng>(samples_of(app, volume), choice);
  response.set_header("Accept-Ranges", "none");
  answer_pieces(request, response, "image/png",
                [picture] { return std::optional<std::string>(picture->next()); });
}

void preview(App& app, const Request& request, Response& response) {
  check_known(request, {"size", "window"});
  const Volume volume = app.services.volumes.get(viewer_of(request), request.path_parameter("id"));
  const volume::PreviewChoice choice = {
      .most = static_cast<std::uint32_t>(
          whole_number_of(request, "size", {1, limits::kMostPreviewSize}, kUsualPreviewSize)),
      .window = interval_of(request, "window").value_or(volume.range)};
  const std::string etag = '"' + volume.id + ".preview" + std::to_string(choice.most) + '.' +
                           to_text(choice.window[0]) + '.' + to_text(choice.window[1]) + '"';
  if (is_known(request, response, etag, kForever)) return;
  const auto reduced = std::make_shared<volume::PreviewNrrd>(samples_of(app, volume), choice);
  const auto next = [reduced] { return std::optional<std::string>(reduced->next()); };
  response.status = 200;
  response.set_header("Accept-Ranges", "none");
  response.set_header("Content-Disposition", "attachment; filename=\"preview.nrrd\"");
  response.stream = {.source = computed_source(next, false),
                     .media_type = "application/octet-stream",
                     .framing = Framing::kLength,
                     .length = reduced->size()};
}

void labels(App& app, const Request& request, Response& response) {
  constexpr const char* kCursor = "volume labels";
  check_known(request, {"background", "cursor"});
  const Volume volume = app.services.volumes.get(viewer_of(request), request.path_parameter("id"));
  const std::int64_t background = whole_number_of(request, "background", 0);
  VolumeLabels page = app.services.labels.page_of(viewer_of(request), volume, background,
                                                  label_after(request, kCursor));
  if (page.next) page.next = cursor_after(kCursor, *page.next);
  answer_tagged_json(request, response, to_json(page));
}

void estimate(App& app, const Request& request, Response& response) {
  const JobParameters parameters =
      complete_parameters(app, request, parse_job_parameters(request.query, VolumeIn::kQuery));
  answer_json(response, 200,
              to_json(app.services.estimator.estimate(viewer_of(request), parameters)));
}

}  // namespace

void add_inspect_routes(App& app) {
  const std::string volume = "/v1/volumes/{id}";
  add_computed_get(app, volume + "/histogram", [&app](const auto& request, auto& response) {
    histogram(app, request, response);
  });
  add_computed_get(app, volume + "/labels",
                   [&app](const auto& request, auto& response) { labels(app, request, response); });
  add_computed_get(app, volume + "/slice.png",
                   [&app](const auto& request, auto& response) { slice(app, request, response); });
  add_computed_get(app, volume + "/slice", [&app](const auto& request, auto& response) {
    slice_samples(app, request, response);
  });
  add_computed_get(app, volume + "/preview", [&app](const auto& request, auto& response) {
    preview(app, request, response);
  });
  add_computed_get(app, "/v1/estimate", [&app](const auto& request, auto& response) {
    estimate(app, request, response);
  });
}

}  // namespace isomesh::http
