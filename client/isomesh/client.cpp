#include "client/isomesh/client.h"

#include <algorithm>
#include <utility>

#include "base/files.h"
#include "base/hex.h"
#include "base/ids.h"
#include "base/sha256.h"
#include "base/text.h"
#include "client/isomesh/file.h"
#include "client/isomesh/impl.h"
#include "proto/json.h"
#include "proto/json_tree.h"

namespace isomesh {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int kNoContent = 204;
// A job's JSON has a few kilobytes, so more is not an event.
constexpr std::size_t kLongestEvent = 1024 * 1024;

// Parses a job's stream of server-sent events incrementally. Not thread safe.
class EventReader {
 public:
  explicit EventReader(JobListener listener) : listener_(std::move(listener)) {}

  // Calls the listener for each complete event. Throws Error kInternal for anything other than a
  // job's events.
  void take(std::string_view piece) {
    while (!piece.empty()) {
      const std::size_t end = piece.find('\n');
      line_ += piece.substr(0, end);
      if (line_.size() + data_.size() > kLongestEvent) {
        throw Error(ErrorCode::kInternal, "the server's events do not match the API");
      }
      if (end == std::string_view::npos) return;
      take_line(line_);
      line_.clear();
      piece.remove_prefix(end + 1);
    }
  }

  // Call before the bytes of another stream, which continues after last_id().
  void restart() { line_ = name_ = data_ = id_ = ""; }

  const std::string& last_id() const { return last_id_; }
  // The job, once it has ended.
  const std::optional<Job>& job() const { return job_; }

 private:
  // A line is a field, a comment, which begins with a colon, or empty, which ends an event.
  void take_line(std::string_view line) {
    if (line.empty()) return finish_event();
    const std::size_t colon = line.find(':');
    const std::string_view name = line.substr(0, colon);
    std::string_view value = colon == std::string_view::npos ? "" : line.substr(colon + 1);
    if (value.starts_with(' ')) value.remove_prefix(1);
    if (name == "event") name_ = value;
    if (name == "data") data_ += value;
    if (name == "id") id_ = value;
  }

  void finish_event() {
    if (name_ == "done") {
      job_ = job_from_json(data_);
    } else if (name_ == "stage" || name_ == "progress") {
      const JobEvent event = job_event_from_json(data_);
      if (listener_) listener_(event);
    }
    if (!id_.empty()) last_id_ = id_;
    name_.clear();
    data_.clear();
  }

  JobListener listener_;
  std::string line_;
  std::string name_;
  std::string data_;
  std::string id_;
  std::string last_id_;
  std::optional<Job> job_;
};

// The file of a finished job in that format; with `label`, one label's own file of a job by labels.
// Throws as Client::fetch does if there is none.
MeshFile file_of(const Job& job, MeshFormat format, std::optional<std::int64_t> label) {
  if (job.state == JobState::kCancelled)
    throw Error(ErrorCode::kCancelled, "the job was cancelled");
  if (job.state == JobState::kFailed) {
    throw job.error ? to_error(*job.error) : Error(ErrorCode::kInternal, "the job failed");
  }
  if (job.state != JobState::kSucceeded || !job.mesh) {
    throw Error(ErrorCode::kNotReady,
                "the job is " + std::string(to_string(job.state)) + "; its mesh is not ready");
  }
  if (const auto found = job.mesh->files.find(format); !label && found != job.mesh->files.end()) {
    return found->second;
  }
  for (const LabelSummary& each : job.mesh->labels) {
    const auto found = each.files.find(format);
    if (found == each.files.end() || (label ? *label != each.label : job.mesh->labels.size() > 1)) {
      continue;
    }
    return {found->second.bytes, found->second.sha256, found->second.href};
  }
  const auto has = [&](const LabelSummary& each) { return each.files.contains(format); };
  if (!label && std::ranges::any_of(job.mesh->labels, has)) {
    throw Error(ErrorCode::kNotFound, "the job has a file of the format \"" +
                                          std::string(to_string(format)) +
                                          "\" for each label; choose a label, or the zip");
  }
  throw Error(ErrorCode::kNotFound, "the job has no file of the format \"" +
                                        std::string(to_string(format)) + '"' +
                                        (label ? " of the label " + std::to_string(*label) : ""));
}

// Writes a mesh as it arrives and checks it against the job's size and digest. Not thread safe.
class Download {
 public:
  // `files`: those of files_of_mesh().
  Download(MeshFile announced, const std::vector<std::filesystem::path>& files, Existing existing,
           const TransferProgress& progress)
      : announced_(std::move(announced)),
        file_(files.front(), PartFile::Until::kUnnamed, existing),
        materials_(files.size() > 1 ? files.back() : ""),
        progress_(progress) {}

  // The request headers to resume a download; none if nothing has arrived.
  std::vector<std::pair<std::string, std::string>> headers() const {
    if (received_ == 0 || received_ == announced_.bytes) return {};
    return {{"Range", "bytes=" + std::to_string(received_) + "-"},
            {"If-Range", '"' + announced_.sha256 + '"'}};
  }

  // Takes the status of the response: the whole file, or the requested range.
  void begin(int status) {
    constexpr int kPartial = 206;
    if (status == kPartial || received_ == 0) return;
    file_.restart();
    sha256_.emplace();
    received_ = 0;
    head_.clear();
  }

  // Throws Error kDigestMismatch for too many bytes.
  void take(std::string_view piece) {
    received_ += piece.size();
    if (received_ > announced_.bytes) refuse();
    sha256_->update(piece);
    write(piece);
    if (progress_) progress_(received_, announced_.bytes);
  }

  // Call when all has been taken. Throws Error kDigestMismatch for wrong bytes.
  void check() {
    if (received_ != announced_.bytes || to_hex(sha256_->finish()) != announced_.sha256) refuse();
    if (received_ < kHeadBytes) write_head();
  }

  // The place of the materials that the file names; empty if it names none.
  std::filesystem::path materials() const { return has_materials_ ? materials_ : ""; }

  void sync() { file_.sync(); }
  void publish() { file_.publish(); }

 private:
  // The line that names the materials ends before that.
  static constexpr std::size_t kHeadBytes = 100;

  [[noreturn]] static void refuse() {
    throw Error(ErrorCode::kDigestMismatch,
                "the received mesh does not match the checksum of the job");
  }

  void write(std::string_view piece) {
    const std::size_t missing = kHeadBytes - head_.size();
    head_ += piece.substr(0, missing);
    if (missing > 0 && head_.size() == kHeadBytes) write_head();
    if (piece.size() > missing) file_.write(piece.substr(missing));
  }

  void write_head() {
    std::string head = head_;
    const std::string line = "\nmtllib " + std::string(kMaterialsName) + '\n';
    const std::size_t found = materials_.empty() ? std::string::npos : head.find(line);
    has_materials_ = found != std::string::npos;
    if (has_materials_) {
      head.replace(found, line.size(), "\nmtllib " + materials_.filename().string() + '\n');
    }
    file_.write(head);
  }

  const MeshFile announced_;
  PartFile file_;
  const std::filesystem::path materials_;  // empty for a file that keeps its name of them
  const TransferProgress& progress_;
  std::string head_;  // the first bytes of the file
  bool has_materials_ = false;
  std::optional<Sha256> sha256_{std::in_place};
  std::uint64_t received_ = 0;
};

constexpr const char* kJobs = "/v1/jobs";

std::string volume_path(const std::string& id) { return "/v1/volumes/" + path_segment(id); }
std::string job_path(const std::string& id) { return std::string(kJobs) + '/' + path_segment(id); }

Query query_of(const JobFilter& filter) {
  Query query;
  if (filter.state) query.emplace_back("state", to_string(*filter.state));
  if (!filter.volume.empty()) query.emplace_back("volume", filter.volume);
  if (!filter.since.empty()) query.emplace_back("since", filter.since);
  if (!filter.until.empty()) query.emplace_back("until", filter.until);
  return query;
}

}  // namespace

std::vector<std::filesystem::path> files_of_mesh(const std::filesystem::path& target,
                                                 MeshFormat format, bool is_by_labels) {
  const bool has_materials =
      is_by_labels && format == MeshFormat::kObj && lower(target.extension().string()) == ".obj";
  if (!has_materials) return {target};
  const std::filesystem::path file = behind_links(target);
  std::string name = file.filename().replace_extension(".mtl").string();
  // Readers take several names from the line, divided by blanks, and control characters end it.
  std::ranges::replace_if(
      name, [](char c) { return static_cast<unsigned char>(c) <= ' ' || c == '\\'; }, '_');
  return {target, file.parent_path() / name};
}

Client::Client(ClientOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}
Client::~Client() = default;
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;

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

Volume Client::reorient_volume(const std::string& id, const std::string& axes) {
  return volume_from_json(
      impl_->send({.method = "POST",
                   .target = volume_path(id) + "/reoriented" + query_string({{"axes", axes}})}));
}

void Client::erase_volume(const std::string& id, bool with_jobs) {
  const std::string query = with_jobs ? query_string({{"jobs", "erase"}}) : "";
  const HttpResponse response =
      impl_->exchange({.method = "DELETE", .target = volume_path(id) + query});
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
  if (const auto& window = options.window) {
    query.emplace_back("window", to_text((*window)[0]) + ',' + to_text((*window)[1]));
  }
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
                     .target = kJobs,
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

JobPage Client::jobs(const JobFilter& filter, const std::string& cursor) {
  const std::string body = impl_->page(kJobs, query_of(filter), cursor);
  return {.jobs = jobs_from_json(body), .next = next_from_json(body)};
}

std::vector<Job> Client::all_jobs(const JobFilter& filter) {
  return impl_->all_pages(kJobs, jobs_from_json, query_of(filter));
}

Job Client::cancel(const std::string& id) {
  const std::string query = query_string({{"erase", "false"}});
  return job_from_json(impl_->send({.method = "DELETE", .target = job_path(id) + query}));
}

std::optional<Job> Client::erase_job(const std::string& id) {
  const HttpResponse response = impl_->exchange({.method = "DELETE", .target = job_path(id)});
  if (response.status == kNoContent) return std::nullopt;
  return job_from_json(response.body);
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

std::vector<WallSummary> Client::job_walls(const std::string& id, bool edge_contacts) {
  Query query;
  if (edge_contacts) query.emplace_back("edge_contacts", "true");
  return impl_->all_pages(job_path(id) + "/walls", walls_from_json, query);
}

std::string Client::report(const std::string& id) {
  std::string body = impl_->repeat({.target = job_path(id) + "/report"});
  if (!json_values::is_object(JsonTree(body).root())) throw other_api();
  return body;
}

void Client::fetch(const std::string& id, MeshFormat format, const std::filesystem::path& target,
                   const TransferProgress& progress, std::optional<std::int64_t> label,
                   Existing existing) {
  Job done = job(id);
  if (done.mesh && done.mesh->labels_count && (label || !done.mesh->files.contains(format))) {
    done.mesh->labels = job_labels(id);
  }
  const bool is_by_labels = done.parameters.labels && !label;
  Download download(file_of(done, format, label), files_of_mesh(target, format, is_by_labels),
                    existing, progress);
  HttpRequest request{.target = mesh_path(path_segment(id), format, label)};
  request.sink = [&](std::string_view piece) { download.take(piece); };
  request.before_sink = [&](int status) { download.begin(status); };
  impl_->repeat(request, [&] { request.headers = download.headers(); });
  download.check();
  std::optional<PartFile> materials;
  if (const std::filesystem::path place = download.materials(); !place.empty()) {
    materials.emplace(place, PartFile::Until::kUnnamed, existing);
    materials->write(impl_->repeat({.target = job_path(id) + '/' + std::string(kMaterialsName)}));
    materials->sync();
  }
  // Both are complete before one of them appears.
  download.sync();
  if (materials) materials->publish();
  download.publish();
}

std::string Client::ask(const RouteRequest& request) {
  HttpRequest sent = {.method = request.method,
                      .target = request.path.front(),
                      .body = request.json,
                      .patience = request.patience};
  for (std::size_t n = 1; n < request.path.size(); ++n) {
    sent.target += '/' + path_segment(request.path[n]);
  }
  sent.target += query_string(request.query);
  if (!request.json.empty()) sent.headers.emplace_back("Content-Type", "application/json");
  const std::string& key = request.idempotency_key;
  if (!key.empty()) sent.headers.emplace_back("Idempotency-Key", key);
  return request.method == "GET" || !key.empty() ? impl_->repeat(sent) : impl_->send(sent);
}

void Client::pause(std::chrono::milliseconds duration) const { impl_->pause(duration); }

}  // namespace isomesh
