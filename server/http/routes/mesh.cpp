#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <initializer_list>
#include <memory>
#include <set>
#include <span>
#include <vector>

#include "base/log.h"
#include "base/sha256.h"
#include "base/text.h"
#include "proto/empty_surface.h"
#include "proto/fields.h"
#include "proto/json.h"
#include "server/codec/formats.h"
#include "server/codec/mesher_version.h"
#include "server/http/app/outcomes.h"
#include "server/http/limits.h"
#include "server/http/requests/import_query.h"
#include "server/http/requests/request_values.h"
#include "server/http/responses/sources.h"
#include "server/http/routes/routes.h"
#include "server/jobs/library/label_pages.h"

namespace isomesh::http {
namespace {

std::string server_timing(const Timing& timing) {
  std::string text;
  visit(timing, [&](const char* name, double milliseconds) {
    std::array<char, 64> entry = {};
    std::snprintf(entry.data(), entry.size(), "%s%s;dur=%.3f", text.empty() ? "" : ", ", name,
                  milliseconds);
    text += entry.data();
  });
  return text;
}

// The range that a GET requests. If it is outside of the file, the response has the file's length.
std::optional<ByteRange> part_of(const Request& request, Response& response,
                                 const std::string& etag, std::uint64_t size) {
  if (request.method != "GET") return std::nullopt;
  if (request.has_header("If-Range") && request.header("If-Range") != etag) {
    return std::nullopt;
  }
  try {
    return range_of(request, size);
  } catch (const Error&) {
    response.set_header("Content-Range", "bytes */" + std::to_string(size));
    throw;
  }
}

constexpr const char* kAllowEmpty = "allow_empty";

// The codes of notes, each once. So its length is bounded by the number of codes.
std::string codes_of(std::initializer_list<std::span<const Note>> lists) {
  std::set<std::string_view> told;
  std::string text;
  for (const std::span<const Note> notes : lists) {
    for (const Note& note : notes) {
      if (told.insert(note.code).second) text += (text.empty() ? "" : ", ") + note.code;
    }
  }
  return text;
}

// A job and what its response says of the volume.
struct JobOfUpload {
  Job job;
  std::vector<Note> notes;
};

JobOfUpload submit_with_volume(App& app, const Request& request) {
  std::vector<std::pair<std::string, std::string>> job_query;
  std::set<std::string> names;  // all names: this only checks for duplicates
  for (const auto& parameter : request.query) {
    names.insert(parameter.first);
    const bool is_of_job =
        !import_parameters().contains(parameter.first) && parameter.first != kAllowEmpty;
    if (is_of_job) job_query.push_back(parameter);
  }
  check_known(request, names);
  JobParameters parameters = parse_job_parameters(job_query, VolumeIn::kBody);
  if (parameters.formats.size() != 1) {
    throw invalid_parameter("format", "must be one format, because the response is one file");
  }
  const auto& labels = parameters.labels;
  const MeshFormat format = parameters.formats.front();
  const bool is_one_file = holds_all_labels(format) || format == MeshFormat::kZip;
  if (labels && labels->values.size() != 1 && !is_one_file) {
    throw invalid_parameter(
        "format",
        "must hold all labels, such as glb, ply, obj or zip, because the response is one file");
  }
  const ImportOptions options = import_options_of(request);
  const std::string key = idempotency_key_of(request);
  const auto place = place_for_upload(app, request);
  const Upload file(app.services.folder, app.options.upload, app.stopping, request);
  const auto add = [&] {
    return app.services.library.add(owner_of(request), file.body().path, options, file.body().name,
                                    party_of(request));
  };
  const Volume volume = counting_refusals(app, request, add).first;
  parameters.volume = volume.id;
  // A key belongs to one request: the same volume (by its id), the same parameters and this route
  // ("mesh"). It may come again with `allow_empty`, which changes no job.
  const std::string digest = key.empty() ? "" : sha256_of("mesh " + to_json(parameters));
  const Job job = submitted(
      app, {owner_of(request), complete_parameters(app, request, parameters), key, digest});
  return {job, volume.notes};
}

// The request's body is the volume, the response the mesh.
std::optional<Continuation> mesh_in_one(App& app, const Request& request, Response& response) {
  const bool allows_empty = flag_of(request, kAllowEmpty, false);
  const auto [job, notes] = submit_with_volume(app, request);
  const auto answer = [&app, allows_empty, notes = notes](const Request& asked, Response& out,
                                                          const Job& now) {
    out.set_header("Location", "/v1/jobs/" + now.id);
    out.set_header("Link", "</v1/volumes/" + now.parameters.volume + ">; rel=\"describedby\"");
    const std::string codes = codes_of(
        {notes, now.mesh ? std::span<const Note>(now.mesh->notes) : std::span<const Note>()});
    if (!codes.empty()) out.set_header("Isomesh-Notes", codes);
    if (!is_final(now.state) && app.stopping) {
      throw Error(ErrorCode::kUnavailable, "the service is shutting down");
    }
    if (now.mesh && now.mesh->empty && !allows_empty) {
      throw empty_surface(*now.mesh, "allow_empty=true accepts that");
    }
    answer_mesh(app, asked, out, now, {now.parameters.formats.front(), std::nullopt});
  };
  auto continuation =
      answer_at_end(app, request, response, job, limits::kLongestSynchronousJob, answer);
  // Without an idempotency key the client cannot return for the job.
  if (continuation && idempotency_key_of(request).empty()) {
    continuation->abandoned = [&app, id = job.id](const Request& asked) {
      app.services.jobs.cancel(viewer_of(asked), id);
    };
  }
  return continuation;
}

// A file's bytes: a blob or a part of one.
struct Stored {
  std::string blob;
  std::uint64_t begin = 0;
  std::uint64_t bytes = 0;
  std::string sha256;
  std::string name;  // for downloads
};

// Has a damaged blob made again, and throws with its state.
void check_intact(const App& app, const Job& job, const std::string& blob) {
  if (store::is_there_and_intact(app.services.blobs, blob, {})) return;
  log_error("the stored mesh of job {} is damaged", job.id);
  const Job again = app.services.jobs.remake(job.id);
  if (again.error) throw RecordedProblem(*again.error);
  throw Error(ErrorCode::kUnavailable, "the stored mesh was damaged and is being made again");
}

jobs::JobLabels labels_of(const App& app, const Job& job) {
  if (job.mesh->label_list) check_intact(app, job, job.mesh->label_list->sha256);
  return {job, app.services.blobs};
}

std::string listed_labels(const jobs::JobLabels& labels) {
  constexpr std::size_t kMostNamed = 50;
  const std::vector<LabelSummary> first = labels.after(std::nullopt);
  const std::size_t named = std::min(first.size(), kMostNamed);
  std::string text;
  for (std::size_t n = 0; n < named; ++n) {
    text += (n == 0 ? "" : ", ") + std::to_string(first[n].label);
    if (first[n].name) text += " (" + *first[n].name + ')';
  }
  const std::uint64_t more = labels.count() - named;
  return more == 0 ? text : text + " and " + std::to_string(more) + " more";
}

LabelSummary label_of(const jobs::JobLabels& labels, const WhichMesh& which) {
  if (labels.count() == 0) throw invalid_parameter("label", "applies only to jobs with `labels`");
  if (!which.label && labels.count() == 1) return labels.after(std::nullopt).front();
  const auto found = which.label ? labels.find(*which.label) : std::nullopt;
  if (!found) throw invalid_parameter("label", "must be one of " + listed_labels(labels));
  return *found;
}

bool is_zipped(const jobs::JobLabels& labels, MeshFormat format) {
  return labels.count() > 0 && labels.after(std::nullopt).front().files.contains(format);
}

Stored stored_mesh(const App& app, const Job& job, const WhichMesh& which) {
  const MeshSummary& mesh = *job.mesh;
  const std::string suffix(file_suffix(which.format));
  const auto whole = mesh.files.find(which.format);
  if (!which.label && whole != mesh.files.end()) {
    const MeshFile& file = whole->second;
    return {file.sha256, 0, file.bytes, file.sha256, "mesh." + suffix};
  }
  const jobs::JobLabels labels = labels_of(app, job);
  if (which.label || is_zipped(labels, which.format)) {
    const LabelSummary label = label_of(labels, which);
    if (const auto found = label.files.find(which.format); found != label.files.end()) {
      const LabelFile& file = found->second;
      return {mesh.files.at(MeshFormat::kZip).sha256, file.offset, file.bytes, file.sha256,
              "mesh-" + std::to_string(label.label) + '.' + suffix};
    }
  }
  throw Error(ErrorCode::kNotFound, "the job was submitted without the format \"" +
                                        std::string(to_string(which.format)) + '"' +
                                        (which.label ? " for each label" : ""));
}

// The URL of a whole blob outside of this daemon, if the client asks for a redirect.
std::optional<std::string> link_to(const App& app, const Request& request, const Stored& file,
                                   MeshFormat format) {
  if (!app.options.blob_redirect || request.method != "GET" || !prefers(request, "redirect")) {
    return std::nullopt;
  }
  // Not for a part of a blob, or one that must be made again.
  if (app.services.blobs.size(file.blob) != file.bytes) return std::nullopt;
  return app.services.blobs.link(
      file.blob,
      {.name = file.name, .media_type = std::string(codec::describe(format).media_type)});
}

void check_has_mesh(const Job& job) {
  if (job.error) throw RecordedProblem(*job.error);
  if (job.state == JobState::kCancelled) {
    throw Error(ErrorCode::kCancelled, "the job was cancelled and has no mesh");
  }
  if (!job.mesh) {
    throw Error(ErrorCode::kNotReady,
                "the job is " + std::string(to_string(job.state)) + ": its mesh is not ready");
  }
}

// A page of a job's labels. The labels of a mesh do not change.
void list_labels(const App& app, const Request& request, Response& response) {
  constexpr const char* kCursor = "labels";
  check_known(request, {"cursor"});
  const auto last = label_after(request, kCursor);
  const Job job = app.services.jobs.get(viewer_of(request), request.path_parameter("id"));
  check_has_mesh(job);
  const jobs::JobLabels labels = labels_of(app, job);
  const std::vector<LabelSummary> page = labels.after(last);
  const bool has_more = !page.empty() && labels.has_after(page.back().label);
  const std::string next = has_more ? cursor_after(kCursor, std::to_string(page.back().label)) : "";
  answer_tagged_json(request, response, to_json(page, next));
}

// A page of a job's walls. Its cursor is its place in the list of all, those at edges included.
void list_walls(const App& app, const Request& request, Response& response) {
  constexpr const char* kCursor = "walls";
  check_known(request, {"cursor", "edge_contacts"});
  const std::int64_t begin = label_after(request, kCursor).value_or(0);
  if (begin < 0) throw wrong_cursor();
  const bool edge_contacts = flag_of(request, "edge_contacts", false);
  const Job job = app.services.jobs.get(viewer_of(request), request.path_parameter("id"));
  check_has_mesh(job);
  for (const auto& list : {job.mesh->label_list, job.mesh->wall_list}) {
    if (list) check_intact(app, job, list->sha256);
  }
  const auto page =
      jobs::walls_of(job, static_cast<std::uint64_t>(begin), edge_contacts, app.services.blobs);
  const std::string next = page.next ? cursor_after(kCursor, std::to_string(*page.next)) : "";
  answer_tagged_json(request, response, to_json(page.walls, next));
}

// As JSON; null if it is gone or its record is damaged.
std::string volume_of(const App& app, const Request& request, const Job& job) {
  auto volume = app.services.volumes.find(viewer_of(request), job.parameters.volume);
  if (!volume) return "null";
  if (volume->dicom) volume->dicom->instances.clear();
  return to_json(*volume);
}

void report(const App& app, const Request& request, Response& response) {
  check_known(request, {});
  const Job job = app.services.jobs.get(viewer_of(request), request.path_parameter("id"));
  check_has_mesh(job);
  answer_tagged_json(request, response,
                     "{\"version\":\"" ISOMESH_VERSION "\",\"mesher\":\"" +
                         std::string(codec::kMesherVersion) + "\",\"job\":" + to_json(job) +
                         ",\"volume\":" + volume_of(app, request, job) + '}');
}

void answer_materials(const App& app, const Request& request, Response& response) {
  check_known(request, {});
  const Job job = app.services.jobs.get(viewer_of(request), request.path_parameter("id"));
  check_has_mesh(job);
  answer_tagged(request, response, jobs::materials_of(labels_of(app, job)), "model/mtl");
  if (response.status != 200) return;
  response.set_header("Content-Disposition",
                      "attachment; filename=\"" + std::string(kMaterialsName) + '"');
}

}  // namespace

void answer_mesh(const App& app, const Request& request, Response& response, const Job& job,
                 const WhichMesh& which) {
  check_has_mesh(job);
  const Stored file = stored_mesh(app, job, which);
  const std::string etag = '"' + file.sha256 + '"';
  const bool is_read = request.method != "POST";
  if (is_read) check_if_match(request, etag);
  const bool unchanged = is_read && matches_etag(request, etag);
  response.set_header("ETag", etag);
  response.set_header("Repr-Digest", digest_header(file.sha256));
  const auto part = unchanged ? std::nullopt : part_of(request, response, etag, file.bytes);
  response.set_header("Cache-Control", "private, immutable");
  response.set_header("Server-Timing", server_timing(job.timing));
  response.set_header("Accept-Ranges", "bytes");
  if (unchanged) {
    response.status = 304;
    return;
  }
  if (const auto link = link_to(app, request, file, which.format)) {
    response.status = 307;
    response.set_header("Location", *link);
    response.set_header("Cache-Control", "no-store");
    response.set_header("Preference-Applied", "redirect");
    return;
  }
  check_intact(app, job, file.blob);
  const ByteRange range = part.value_or(ByteRange{0, file.bytes});
  response.status = part ? 206 : 200;
  if (part) {
    response.set_header("Content-Range", "bytes " + std::to_string(range.first) + '-' +
                                             std::to_string(range.first + range.length - 1) + '/' +
                                             std::to_string(file.bytes));
  }
  response.set_header("Content-Disposition", "attachment; filename=\"" + file.name + '"');
  const ByteRange in_blob = {file.begin + range.first, range.length};
  response.stream = {.source = blob_source(app.services.blobs.open(file.blob), in_blob),
                     .media_type = std::string(codec::describe(which.format).media_type),
                     .framing = Framing::kLength,
                     .length = range.length};
}

void add_mesh_routes(App& app) {
  // Before the route of mesh files, whose pattern matches it, too.
  add_computed_get(
      app, "/v1/jobs/{id}/" + std::string(kMaterialsName),
      [&app](const auto& request, auto& response) { answer_materials(app, request, response); });
  add_get(app, "/v1/jobs/{id}/mesh.{format}", [&app](const auto& request, auto& response) {
    check_known(request, {"label"});
    const auto format = from_string<MeshFormat>(request.path_parameter("format"));
    if (!format) {
      throw Error(ErrorCode::kNotFound, "a mesh has the suffix " + names_of<MeshFormat>());
    }
    WhichMesh which = {*format, std::nullopt};
    if (request.has_parameter("label")) which.label = whole_number_of(request, "label", 0);
    answer_mesh(app, request, response,
                app.services.jobs.get(viewer_of(request), request.path_parameter("id")), which);
  });
  add_computed_get(app, "/v1/jobs/{id}/labels", [&app](const auto& request, auto& response) {
    list_labels(app, request, response);
  });
  add_computed_get(app, "/v1/jobs/{id}/walls", [&app](const auto& request, auto& response) {
    list_walls(app, request, response);
  });
  add_computed_get(app, "/v1/jobs/{id}/report",
                   [&app](const auto& request, auto& response) { report(app, request, response); });
  add_post(app, "/v1/mesh", [&app](const auto& request, auto& response) {
    return mesh_in_one(app, request, response);
  });
}

}  // namespace isomesh::http
