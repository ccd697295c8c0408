#include "client/isomesh/client.h"

#include <algorithm>
#include <utility>

#include "base/base64.h"
#include "base/hex.h"
#include "base/ids.h"
#include "base/sha256.h"
#include "base/text.h"
#include "client/isomesh/download.h"
#include "client/isomesh/event_reader.h"
#include "client/isomesh/file.h"
#include "client/isomesh/impl.h"
#include "client/isomesh/package.h"
#include "client/isomesh/transport.h"
#include "client/isomesh/url.h"
#include "proto/json.h"

namespace isomesh {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::size_t kDigestBytes = 1024 * 1024;

template <std::size_t N>
std::string joined(const std::array<double, N>& values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "" : ",") + to_text(value);
  return text;
}

void add_raw(const RawDescription& raw, Query& pairs) {
  const auto& [x, y, z] = raw.dims;
  pairs.emplace_back("dims", std::to_string(x) + "," + std::to_string(y) + "," + std::to_string(z));
  pairs.emplace_back("type", to_string(raw.type));
  pairs.emplace_back("spacing", joined(raw.geometry.spacing));
  pairs.emplace_back("origin", joined(raw.geometry.origin));
  pairs.emplace_back("direction", joined(raw.geometry.direction));
  if (raw.big_endian) pairs.emplace_back("byte_order", "big");
}

std::string upload_query(const UploadOptions& options) {
  Query pairs;
  if (options.raw) {
    RawDescription raw = *options.raw;
    if (options.spacing) raw.geometry.spacing = *options.spacing;
    add_raw(raw, pairs);
  }
  if (!options.series.empty()) pairs.emplace_back("series", options.series);
  if (!options.member.empty()) pairs.emplace_back("member", options.member);
  if (options.volume) pairs.emplace_back("volume", std::to_string(*options.volume));
  std::string accepted;
  for (const std::string& code : options.accept) accepted += (accepted.empty() ? "" : ",") + code;
  if (!accepted.empty()) pairs.emplace_back("accept", accepted);
  if (options.nifti_form) pairs.emplace_back("nifti_form", to_string(*options.nifti_form));
  if (options.spacing && !options.raw) pairs.emplace_back("spacing", joined(*options.spacing));
  return pairs.empty() ? std::string() : query_string(pairs);
}

// File names may name patients, so they are sent in a header: logs contain targets.
std::string disposition_of(const std::filesystem::path& path, const std::string& name) {
  const auto file = (path.has_filename() ? path : path.parent_path()).filename();
  return "attachment; filename*=UTF-8''" + percent_encode(name.empty() ? file.string() : name);
}

std::string digest_of(const UploadBody& file) {
  Sha256 sha256;
  std::vector<char> piece(kDigestBytes);
  for (std::uint64_t offset = 0; offset < file.size(); offset += piece.size()) {
    piece.resize(
        static_cast<std::size_t>(std::min<std::uint64_t>(kDigestBytes, file.size() - offset)));
    file.read(offset, piece);
    sha256.update(std::string_view(piece.data(), piece.size()));
  }
  return to_base64(sha256.finish());
}

std::string volume_path(const std::string& id) { return "/v1/volumes/" + path_segment(id); }
std::string job_path(const std::string& id) { return "/v1/jobs/" + path_segment(id); }

}  // namespace

Client::Client(ClientOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}
Client::~Client() = default;
Error several_volumes(const std::vector<UploadedVolume>& volumes) {
  Remedy remedy;
  for (const UploadedVolume& each : volumes) {
    remedy.choices.push_back(
        {"member", each.member, each.problem ? each.problem->detail : "can be meshed"});
  }
  return Error(ErrorCode::kUnusableVolume, "the upload contains " + std::to_string(volumes.size()) +
                                               " volumes, but one is needed")
      .with_remedy(std::move(remedy));
}

Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;

Volume Client::upload(const std::filesystem::path& path, const UploadOptions& options) {
  std::vector<UploadedVolume> volumes = upload_all({path}, options);
  if (volumes.size() == 1 && volumes.front().volume) return std::move(*volumes.front().volume);
  throw several_volumes(volumes);
}

std::vector<UploadedVolume> Client::upload_all(const std::vector<std::filesystem::path>& paths,
                                               const UploadOptions& options) {
  const UploadBody file(paths);
  HttpRequest request{.method = "POST", .target = "/v1/volumes" + upload_query(options)};
  request.headers = {{"Content-Type", "application/octet-stream"},
                     {"Content-Disposition", disposition_of(paths.front(), options.name)}};
  if (options.digest) {
    request.headers.emplace_back("Content-Digest", "sha-256=:" + digest_of(file) + ":");
  }
  request.source_bytes = file.size();
  request.source = [&](std::uint64_t offset, std::span<char> piece) {
    if (options.progress) options.progress(offset, file.size());
    file.read(offset, piece);
    if (options.progress && offset + piece.size() == file.size()) {
      options.progress(file.size(), file.size());
    }
  };
  constexpr int kMultiStatus = 207;
  const bool is_resumable = file.size() >= options.resumable_bytes;
  const HttpResponse response = is_resumable ? impl_->resumed(request) : impl_->exchange(request);
  if (response.status == kMultiStatus) return uploaded_volumes_from_json(response.body);
  return {{.member = {}, .status = response.status, .volume = volume_from_json(response.body)}};
}

Volume Client::volume(const std::string& id) {
  return volume_from_json(impl_->repeat({.target = volume_path(id)}));
}

std::vector<Volume> Client::volumes() { return impl_->all_pages("/v1/volumes", volumes_from_json); }

Volume Client::rename_volume(const std::string& id, const std::optional<std::string>& name) {
  return volume_from_json(impl_->send({.method = "PATCH",
                                       .target = volume_path(id),
                                       .headers = {{"Content-Type", "application/json"}},
                                       .body = volume_name_to_json(name)}));
}

void Client::erase_volume(const std::string& id) {
  constexpr int kNoContent = 204;
  const HttpResponse response = impl_->exchange({.method = "DELETE", .target = volume_path(id)});
  if (response.status != kNoContent) throw other_api();
}

Histogram Client::histogram(const std::string& id, std::uint32_t bins) {
  const std::string query = query_string({{"bins", std::to_string(bins)}});
  return histogram_from_json(impl_->repeat({.target = volume_path(id) + "/histogram" + query}));
}

VolumeLabels Client::labels(const std::string& id, std::int64_t background) {
  VolumeLabels all;
  const auto parse = [&](const std::string& body) {
    all = volume_labels_from_json(body);
    return std::move(all.labels);
  };
  all.labels = impl_->all_pages(volume_path(id) + "/labels", parse,
                                {{"background", std::to_string(background)}});
  all.next.reset();
  return all;
}

void Client::slice(const std::string& id, const SliceOptions& options,
                   const std::filesystem::path& target) {
  Query query = {{"axis", options.axis}};
  if (options.index) query.emplace_back("index", std::to_string(*options.index));
  if (options.window) query.emplace_back("window", joined(*options.window));
  PartFile file(target);
  std::uint64_t bytes = 0;
  HttpRequest request{.target = volume_path(id) + "/slice.png" + query_string(query)};
  request.sink = [&](std::string_view piece) {
    file.write(piece);
    bytes += piece.size();
  };
  const HttpResponse response = impl_->repeated(request, [&] {
    file.restart();
    bytes = 0;
  });
  if (bytes == 0 || !response.content_type.starts_with("image/png")) throw other_api();
  file.publish();
}

Estimate Client::estimate(const JobParameters& parameters) {
  const std::string query = query_string(to_query(parameters));
  return estimate_from_json(impl_->repeat({.target = "/v1/estimate" + query}));
}

Job Client::submit(const JobParameters& parameters, const std::string& idempotency_key) {
  const std::string key = idempotency_key.empty() ? random_hex(kKeyBytes) : idempotency_key;
  return job_from_json(
      impl_->repeat({.method = "POST",
                     .target = "/v1/jobs",
                     .headers = {{"Content-Type", "application/json"}, {"Idempotency-Key", key}},
                     .body = to_json(parameters)}));
}

Job Client::job(const std::string& id) {
  return job_from_json(impl_->repeat({.target = job_path(id)}));
}

Job Client::job(const std::string& id, seconds wait) {
  const std::string query = query_string({{"wait", std::to_string(wait.count())}});
  return job_from_json(impl_->repeat({.target = job_path(id) + query, .patience = wait}));
}

JobPage Client::jobs(std::optional<JobState> state, const std::string& cursor) {
  Query query;
  if (state) query.emplace_back("state", to_string(*state));
  if (!cursor.empty()) query.emplace_back("cursor", cursor);
  const std::string body = impl_->repeat({.target = "/v1/jobs" + query_string(query)});
  return {.jobs = jobs_from_json(body), .next = next_from_json(body)};
}

Job Client::cancel(const std::string& id) {
  return job_from_json(impl_->send({.method = "DELETE", .target = job_path(id)}));
}

Job Client::wait(const std::string& id, const JobProgress& progress) {
  const seconds patience = progress ? seconds{1} : kLongestWait;
  while (true) {
    const auto asked = std::chrono::steady_clock::now();
    Job current = job(id, patience);
    if (progress) progress(current);
    if (is_final(current.state)) return current;
    const auto held =
        std::chrono::duration_cast<milliseconds>(std::chrono::steady_clock::now() - asked);
    if (held < kShortestLook) impl_->pause(kShortestLook - held);
  }
}

Job Client::follow(const std::string& id, const JobListener& listener) {
  EventReader events(listener);
  HttpRequest request{.target = job_path(id) + "/events"};
  request.sink = [&](std::string_view piece) { events.take(piece); };
  impl_->repeat(request, [&] {
    events.restart();
    request.headers.clear();
    if (!events.last_id().empty()) request.headers = {{"Last-Event-ID", events.last_id()}};
  });
  // A stream may end before the job, for example because a proxy cuts it.
  return events.job() ? *events.job() : wait(id);
}

std::vector<LabelSummary> Client::job_labels(const std::string& id) {
  return impl_->all_pages(job_path(id) + "/labels", labels_from_json);
}

void Client::fetch(const std::string& id, MeshFormat format, const std::filesystem::path& target,
                   const TransferProgress& progress, std::optional<std::int64_t> label) {
  Job done = job(id);
  if (done.mesh && done.mesh->labels_count && (label || !done.mesh->files.contains(format))) {
    done.mesh->labels = job_labels(id);
  }
  Download download(file_of(done, format, label), target, progress);
  HttpRequest request{.target = mesh_path(path_segment(id), format, label)};
  request.sink = [&](std::string_view piece) { download.take(piece); };
  request.before_sink = [&](int status) { download.begin(status); };
  impl_->repeat(request, [&] { request.headers = download.headers(); });
  download.publish();
}

}  // namespace isomesh
