#include <array>
#include <chrono>
#include <cstdio>
#include <memory>
#include <set>
#include <vector>

#include "proto/json.h"
#include "server/codec/encode.h"
#include "server/http/request.h"
#include "server/http/routes.h"

namespace isomesh::http {
namespace {

constexpr std::size_t kBlockBytes = 256 * 1024;

std::string server_timing(const Timing& timing) {
  std::string text;
  for (const auto& [name, milliseconds] :
       {std::pair{"queue", timing.queue}, std::pair{"load", timing.load},
        std::pair{"extract", timing.extract}, std::pair{"smooth", timing.smooth},
        std::pair{"encode", timing.encode}}) {
    std::array<char, 64> entry = {};
    std::snprintf(entry.data(), entry.size(), "%s%s;dur=%.3f", text.empty() ? "" : ", ", name,
                  milliseconds);
    text += entry.data();
  }
  return text;
}

// Streams part of a blob; the provider is asked for pieces of it and must not trust the bounds.
void stream(httplib::Response& response, std::shared_ptr<store::BlobReader> blob,
            const ByteRange& range, const std::string& media_type) {
  response.set_content_provider(
      range.length, media_type,
      [blob, range, block = std::vector<std::byte>(kBlockBytes)](
          std::size_t offset, std::size_t length, httplib::DataSink& sink) mutable {
        if (offset >= range.length) return false;
        const std::size_t wanted =
            std::min({length, block.size(), static_cast<std::size_t>(range.length) - offset});
        const std::size_t count =
            blob->read_at(range.first + offset, std::span(block).first(wanted));
        return count > 0 && sink.write(reinterpret_cast<const char*>(block.data()), count);
      });
}

// The part that a GET asks for; a 416 tells how long the whole is.
std::optional<ByteRange> part_of(const httplib::Request& request, httplib::Response& response,
                                 const std::string& etag, std::uint64_t size) {
  if (request.method != "GET") return std::nullopt;
  if (request.has_header("If-Range") && request.get_header_value("If-Range") != etag) {
    return std::nullopt;
  }
  try {
    return range_of(request, size);
  } catch (const Error&) {
    response.set_header("Content-Range", "bytes */" + std::to_string(size));
    throw;
  }
}

// One request: the volume is the body, the mesh the answer.
void mesh_in_one(App& app, const httplib::Request& request, httplib::Response& response,
                 const httplib::ContentReader& read_body) {
  std::vector<std::pair<std::string, std::string>> job_query;
  std::set<std::string> names;  // so far only checked for being there once
  for (const auto& parameter : query_of(request)) {
    names.insert(parameter.first);
    if (!import_parameters().contains(parameter.first)) job_query.push_back(parameter);
  }
  check_known(request, names);
  JobParameters parameters = parse_job_parameters(job_query, VolumeIn::kBody);
  if (parameters.formats.size() != 1) {
    throw invalid_parameter("format", "must be one format: the answer is one file");
  }
  const volume::ImportOptions options = import_options_of(request);
  const auto place = app.uploads.try_take();
  if (!place) throw Error(ErrorCode::kUnavailable, "too many uploads are under way");
  {
    const Upload file(app.services.folder, app.options.upload, app.stopping, request, read_body);
    parameters.volume = app.services.library.add(owner(), file.path(), options).first.id;
  }
  Job job = store::job_of(app.services.jobs.submit({owner(), parameters, "", ""}));
  response.set_header("Location", "/v1/jobs/" + job.id);
  while (!is_final(job.state)) {
    if (app.stopping) throw Error(ErrorCode::kUnavailable, "the service is shutting down");
    job = app.services.jobs.wait(viewer(), job.id, std::chrono::seconds(1));
  }
  answer_mesh(app, request, response, job, parameters.formats.front());
}

}  // namespace

void answer_mesh(const App& app, const httplib::Request& request, httplib::Response& response,
                 const Job& job, MeshFormat format) {
  if (job.error) throw to_error(*job.error);
  if (job.state == JobState::kCancelled) {
    throw Error(ErrorCode::kCancelled, "the job was cancelled and has no mesh");
  }
  if (!job.mesh) {
    throw Error(ErrorCode::kNotReady,
                "the job is " + std::string(to_string(job.state)) + ": its mesh is not ready");
  }
  const std::string name(to_string(format));
  const auto found = job.mesh->files.find(format);
  if (found == job.mesh->files.end()) {
    throw Error(ErrorCode::kNotFound, "the job was not asked for the format \"" + name + '"');
  }
  const MeshFile& file = found->second;
  const std::string etag = '"' + file.sha256 + '"';
  const bool unchanged = matches_etag(request, etag);
  response.set_header("ETag", etag);
  const auto part = unchanged ? std::nullopt : part_of(request, response, etag, file.bytes);
  response.set_header("Cache-Control", "private, immutable");
  response.set_header("Server-Timing", server_timing(job.timing));
  response.set_header("Accept-Ranges", "bytes");
  if (unchanged) {
    response.status = 304;
    return;
  }
  const ByteRange range = part.value_or(ByteRange{0, file.bytes});
  response.status = part ? 206 : 200;
  if (part) {
    response.set_header("Content-Range", "bytes " + std::to_string(range.first) + '-' +
                                             std::to_string(range.first + range.length - 1) + '/' +
                                             std::to_string(file.bytes));
  }
  response.set_header("Content-Disposition", "attachment; filename=\"mesh." + name + '"');
  stream(response, app.services.blobs.open(file.sha256), range,
         std::string(codec::media_type(format)));
}

void add_mesh_routes(App& app) {
  add_get(app, "/v1/jobs/" + kId + "/mesh\\.([a-z]{3})",
          [&app](const auto& request, auto& response) {
            check_known(request, {});
            const auto format = from_string<MeshFormat>(request.matches[2].str());
            if (!format) {
              throw Error(ErrorCode::kNotFound, "a mesh has the suffix " + names_of<MeshFormat>());
            }
            answer_mesh(app, request, response, app.services.jobs.get(viewer(), id_of(request)),
                        *format);
          });
  add_post(app, "/v1/mesh", [&app](const auto& request, auto& response, const auto& read_body) {
    mesh_in_one(app, request, response, read_body);
  });
}

}  // namespace isomesh::http
