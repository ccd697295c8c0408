// The C++ client of an isomeshd server: uploads volumes, runs jobs, downloads meshes.
//
//   isomesh::Client client({.server = "http://127.0.0.1:8080"});
//   isomesh::JobParameters parameters;
//   parameters.volume = client.upload("head.nii.gz").id;
//   parameters.iso = 60;
//   const isomesh::Job job = client.wait(client.submit(parameters).id);
//   client.fetch(job.id, isomesh::MeshFormat::kDrc, "head.drc");
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "proto/error.h"
#include "proto/types.h"

namespace isomesh {

// A server is busy (429 or 503) for that reason, and the request is sent again after the pause.
using BusyListener = std::function<void(const Error& reason, std::chrono::milliseconds pause)>;

struct ClientOptions {
  // `http://HOST:PORT`, `https://HOST:PORT` or `unix:PATH`. Certificates that are not valid for the
  // host or not signed by a trusted authority are rejected.
  std::string server = "http://127.0.0.1:8080";
  // Sent as `Authorization: Bearer`; empty: not sent.
  std::string token = {};
  // A file of trusted certificate authorities (PEM); empty: the system's.
  std::filesystem::path authorities = {};

  std::chrono::milliseconds connect_timeout{10'000};
  // The longest silence of the server after connecting. The server reads and checks a volume after
  // the last byte of its upload, so this is minutes, not seconds.
  std::chrono::milliseconds silence_timeout{300'000};
  // For uploads: the longest time without progress before the connection counts as broken.
  std::chrono::milliseconds stall_timeout{60'000};

  // The longest time that a request waits for a busy server, which responds with 429 or 503. The
  // pauses are those of its Retry-After. After that time, and with 0 immediately, the request fails
  // with the server's error, which has `retry_after`.
  std::chrono::milliseconds retry_timeout{600'000};
  // Called before each of these pauses by the request's thread. Must not throw.
  BusyListener busy = {};

  // A stop request ends the present request immediately with Error kCancelled. A large upload is
  // cancelled on the server first, which takes a few seconds at most. Jobs on the server continue.
  std::stop_token stop = {};
};

// Transferred bytes, and the total.
using TransferProgress = std::function<void(std::uint64_t done, std::uint64_t total)>;
using JobProgress = std::function<void(const Job& job)>;

struct UploadOptions {
  std::optional<RawDescription> raw = {};  // empty: the file has a header
  std::string series = {};                 // UID of the DICOM series, if the upload has several
  std::string member = {};                 // the archive's member, if it has several volumes
  // The upload is several masks, of one structure each: makes one volume of labels of them.
  bool masks = false;
  std::optional<std::uint32_t> volume = {};  // index of the volume in its file, from 0
  // Codes of notes whose errors to override, as listed in the server's error.
  std::vector<std::string> accept = {};
  std::optional<NiftiForm> nifti_form = {};  // empty: the sform, if present
  // Says that the samples are Hounsfield units, for a file that does not.
  std::optional<SaidModality> modality = {};
  // Millimetres along x, y and z, for a file that gives none, or instead of those in `raw`.
  std::optional<std::array<double, 3>> spacing = {};
  std::string name = {};  // of the volume; empty: that of the file or folder
  // Sends the file's SHA-256 first, so that the server rejects a body that was corrupted in
  // transit. Reads the file twice.
  bool digest = false;
  // Bodies of at least this size are resumed after a broken connection, unless the outage exceeds a
  // minute. Smaller ones are sent in one request, which is not repeated.
  std::uint64_t resumable_bytes = std::uint64_t{8} << 20;
  // `done` decreases if a resumed upload repeats bytes.
  TransferProgress progress = {};
};

// A slice of a volume and its grey window; the server has defaults for missing members.
struct SliceOptions {
  std::string axis = "z";                            // the fixed index
  std::optional<std::uint32_t> index = {};           // default: the middle
  std::optional<std::array<double, 2>> window = {};  // black and white; default: the volume's range
};

// The error for several uploaded volumes if one was expected, with them as choices.
Error several_volumes(const std::vector<UploadedVolume>& volumes);

using JobListener = std::function<void(const JobEvent& event)>;

// Every file that Client::fetch() writes for `target`. First the mesh, then the materials of an OBJ
// of all labels whose suffix is .obj: for `x.obj` they are `x.mtl`, with `_` for blanks,
// backslashes and control characters, which no name in an OBJ may have. They lie beside the file
// that a link leads to. Throws Error kInvalidParameter for a loop of links.
std::vector<std::filesystem::path> files_of_mesh(const std::filesystem::path& target,
                                                 MeshFormat format, bool is_by_labels);

// The treatment of a file that is there already, or appears meanwhile. kRefuse fails with
// kInvalidParameter, also for a link.
enum class Existing { kReplace, kRefuse };

// The jobs that a list has; all if it is empty.
struct JobFilter {
  std::optional<JobState> state = {};
  std::string volume = {};  // id
  // Submitted since then, and before then: "2026-11-20" or "2026-11-20T07:30:00Z".
  std::string since = {};
  std::string until = {};
};

struct JobPage {
  std::vector<Job> jobs;
  std::string next;  // the cursor of the next page; empty on the last
};

// A request to a route of the API.
struct RouteRequest {
  std::string method = "GET";
  // The route, and segments that follow it; only these are encoded.
  std::vector<std::string> path;
  std::vector<std::pair<std::string, std::string>> query = {};
  std::string json = {};             // the body; empty: none
  std::string idempotency_key = {};  // empty: none
  std::chrono::seconds patience{0};  // for which the server may wait before it responds
};

// Every method throws Error: kUnreachable without a response from a server; the server's own code
// and reason if it rejects the request; kInternal if the response does not follow the API;
// kInvalidParameter for an argument that cannot be sent or a local file that cannot be read or
// written. An exception of a callback ends the request and is rethrown.
//
// Every request has its own connection, so a Client may be used from several threads. Connections
// do not use the environment's proxies. No signals are raised. Callbacks run on the calling thread.
// While the server is busy, every request is sent again (ClientOptions::retry_timeout).
// After a broken connection, a GET or the submission of a job is retried, at most three times, and
// a large upload is resumed. Other requests are not repeated, and no request is if the server
// cannot be connected to.
class Client {
 public:
  // Throws Error kInvalidParameter if the server's address or the token is malformed. Does not
  // connect.
  explicit Client(ClientOptions options = {});
  ~Client();
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;

  // Uploads a file from disk in pieces. A folder, or a header (.mhd, .nhdr) with its data files, is
  // sent as a TAR generated on the fly. The same upload gives the same volume. Throws
  // kUnusableVolume with the choices if the upload has several volumes, which are stored
  // nevertheless.
  Volume upload(const std::filesystem::path& path, const UploadOptions& options = {});
  // The same for an upload that may have several volumes: returns a result for each. A single one
  // has an empty member, and its error is thrown. Several paths are sent together, such as the .hdr
  // and the .img of a volume.
  std::vector<UploadedVolume> upload_all(const std::vector<std::filesystem::path>& paths,
                                         const UploadOptions& options = {});
  Volume volume(const std::string& id);
  // All volumes, oldest first.
  std::vector<Volume> volumes();
  // Renames the volume, or removes its name.
  Volume rename_volume(const std::string& id, const std::optional<std::string>& name);
  // Stores a flipped or turned copy of the volume. `axes` are those whose directions x, y and z
  // get: "-x,y,z" flips along x, "y,-x,z" turns by 90 degrees about z.
  Volume reorient_volume(const std::string& id, const std::string& axes);
  // Also erases the ended jobs on the volume if `with_jobs` is true.
  void erase_volume(const std::string& id, bool with_jobs = false);
  Histogram histogram(const std::string& id, std::uint32_t bins = 256);
  // The labels of the samples, except the background. Throws kUnusableVolume if samples are not
  // whole numbers.
  VolumeLabels labels(const std::string& id, std::int64_t background = 0);
  // Writes the slice as a PNG to `target`.
  void slice(const std::string& id, const SliceOptions& options,
             const std::filesystem::path& target);

  // The expected result and cost of a job with these parameters.
  Estimate estimate(const JobParameters& parameters);

  // An equal key returns the same job, also after the program was restarted. Without one each call
  // generates its own, so that it can be retried safely.
  Job submit(const JobParameters& parameters, const std::string& idempotency_key = {});
  Job job(const std::string& id);
  // The job when it has ended, or its state after `wait` (whole seconds, limited to 30 by the
  // server).
  Job job(const std::string& id, std::chrono::seconds wait);
  // A page of the jobs that match, newest first: the first page, or the one of `cursor`.
  JobPage jobs(const JobFilter& filter = {}, const std::string& cursor = {});
  // All jobs that match, newest first.
  std::vector<Job> all_jobs(const JobFilter& filter = {});
  // Returns the job. One that had ended keeps its state, and one that runs takes a moment to stop.
  Job cancel(const std::string& id);
  // Erases an ended job and its files, and returns nothing; cancels any other and returns it.
  std::optional<Job> erase_job(const std::string& id);

  // Returns the job in its final state. With a callback the job is polled at least once a second,
  // and the callback also gets the final state.
  Job wait(const std::string& id, const JobProgress& progress = {});

  // Returns the job in its final state and reports events without polling. Resumes a broken stream.
  Job follow(const std::string& id, const JobListener& listener);

  // The labels of a finished job, ascending, also if the job has only `labels_count`. Throws
  // kNotReady, the job's own error or kCancelled as fetch() does.
  std::vector<LabelSummary> job_labels(const std::string& id);

  // The areas where two labels of a finished job touch, or one is next to the background, ascending
  // by labels; with `edge_contacts`, behind them, of pairs that share no face of a voxel. Throws as
  // job_labels() does.
  std::vector<WallSummary> job_walls(const std::string& id, bool edge_contacts = false);

  // The report on a finished job as JSON: parameters, volume, mesh, versions. Throws kNotReady, the
  // job's own error or kCancelled as fetch() does.
  std::string report(const std::string& id);

  // Writes the mesh of a finished job to `target`, which appears only when complete and with the
  // SHA-256 that the job states. Resumes after a broken connection. Throws kNotReady if the job has
  // not ended, the job's own error if it failed, kCancelled if it was cancelled, kNotFound if it
  // has no file of that format, kDigestMismatch for wrong bytes. For a job by labels, `label`
  // selects one label's own surface. Writes the files that files_of_mesh() names, and an OBJ names
  // its materials so. The file of an empty surface has no triangles: see `job.mesh->empty`.
  void fetch(const std::string& id, MeshFormat format, const std::filesystem::path& target,
             const TransferProgress& progress = {},
             std::optional<std::int64_t> label = std::nullopt,
             Existing existing = Existing::kReplace);

  // Sends a request to a route without a method here and returns the body of its response. After a
  // broken connection, sends a GET or a request with a key again.
  std::string ask(const RouteRequest& request);

  // Waits that long. Throws kCancelled immediately on a stop request.
  void pause(std::chrono::milliseconds duration) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isomesh
