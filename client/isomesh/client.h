// The C++ client of a running isomeshd: volumes in, jobs through, meshes out.
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
#include <vector>

#include "proto/error.h"
#include "proto/orders.h"
#include "proto/types.h"

namespace isomesh {

struct ClientOptions {
  // `http://HOST:PORT`, `https://HOST:PORT` or `unix:PATH`. A certificate that is not valid for the
  // host, or that no trusted authority has signed, is refused.
  std::string server = "http://127.0.0.1:8080";
  // Sent as `Authorization: Bearer`; empty: none is sent.
  std::string token = {};
  // A file of the certificate authorities (PEM) to trust; empty: the system's.
  std::filesystem::path authorities = {};

  std::chrono::milliseconds connect_timeout{10'000};
  // The longest silence of the server once it is connected to. After the last byte of an upload the
  // server reads and checks the volume before it answers, so this is minutes rather than seconds.
  std::chrono::milliseconds silence_timeout{300'000};
  // Of an upload: how long none of it may get through before its connection is taken for broken.
  std::chrono::milliseconds stall_timeout{60'000};

  // When asked to stop, the request under way ends at once with Error kCancelled. Jobs on the
  // server go on.
  std::stop_token stop = {};
};

// Bytes of a transfer that are done, and all of them.
using TransferProgress = std::function<void(std::uint64_t done, std::uint64_t total)>;
// The job as it was last seen.
using JobProgress = std::function<void(const Job& job)>;

struct UploadOptions {
  std::optional<RawDescription> raw = {};  // empty: the file says itself what it is
  std::string series = {};  // UID of the DICOM series to take, where the upload holds several
  std::string member = {};  // the archive's member to take, where it holds several volumes
  std::optional<std::uint32_t> volume = {};  // the volume to take of a file of several, from 0 on
  // Codes of notes for which the server is not to refuse, as its refusal named them.
  std::vector<std::string> accept = {};
  std::optional<NiftiForm> nifti_form = {};  // empty: the sform, where there is one
  std::string name = {};  // what the volume is called; empty: as the file or folder
  // Sends the file's SHA-256 ahead, so that the server refuses a body that changed on the way.
  // Costs a second reading of the file.
  bool digest = false;
  // A body of so many bytes or more goes on where its connection broke, if it is not broken for
  // longer than a minute. Fewer are sent in one request, which is not repeated.
  std::uint64_t resumable_bytes = std::uint64_t{8} << 20;
  // Is told less than before when an upload goes on.
  TransferProgress progress = {};
};

// Which slice of a volume, and how its samples become grey; what is left out is the server's
// choice.
struct SliceOptions {
  std::string axis = "z";                            // the index that is the same in the slice
  std::optional<std::uint32_t> index = {};           // the middle
  std::optional<std::array<double, 2>> window = {};  // black and white: the volume's range
};

// The error of an upload of which one volume is wanted and that holds several: its choices are
// them.
Error several_volumes(const std::vector<UploadedVolume>& volumes);

// What happens to a job, as it happens.
using JobListener = std::function<void(const JobEvent& event)>;

// The order as it was last seen.
using OrderProgress = std::function<void(const Order& order)>;

struct OrderPage {
  std::vector<Order> orders;
  std::string next;  // as of a JobPage
};

struct JobPage {
  std::vector<Job> jobs;
  std::string next;  // the cursor of the page after this one; empty on the last
};

// Every method throws Error: kUnreachable when no answer of a server came, the server's own code
// and reason when it refused, kInternal when its answer is not what the API says, kInvalidParameter
// for an argument that cannot be sent or a local file that cannot be read or written. An exception
// that a callback throws ends the request and comes out unchanged.
//
// Every request has a connection of its own, so a Client may be used from several threads. It goes
// straight to the server: the environment's proxies are not used. No signals are raised. Callbacks
// run on the calling thread. A GET, or the submission of a job, whose connection broke is tried
// again, three times at most, and a large upload goes on where it broke; nothing else is, and
// neither is a server that cannot be connected to.
class Client {
 public:
  // Throws Error kInvalidParameter when the server's address or the token is malformed. Connects to
  // nothing.
  explicit Client(ClientOptions options = {});
  ~Client();
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;

  // Sends a file from disk in pieces; a folder, or a header (.mhd, .nhdr) with the data that it
  // names, as a TAR that is made on the way. The same samples again give the same volume.
  // Throws kUnusableVolume with the choices where the upload holds several volumes, which are
  // stored nevertheless.
  Volume upload(const std::filesystem::path& path, const UploadOptions& options = {});
  // The same for an upload that may hold several volumes: each is answered for. One that is alone
  // has an empty member; its refusal is thrown. With several paths those files are sent together,
  // such as the .hdr and the .img of a volume.
  std::vector<UploadedVolume> upload_all(const std::vector<std::filesystem::path>& paths,
                                         const UploadOptions& options = {});
  Volume volume(const std::string& id);
  // All of them, the oldest first.
  std::vector<Volume> volumes();
  // Gives the volume another name, or none.
  Volume rename_volume(const std::string& id, const std::optional<std::string>& name);
  void erase_volume(const std::string& id);
  Histogram histogram(const std::string& id, std::uint32_t bins = 256);
  // The labels that the samples have, but for the background. Throws kUnusableVolume when they are
  // no whole numbers.
  VolumeLabels labels(const std::string& id, std::int64_t background = 0);
  // Writes the picture, a PNG, to `target`.
  void slice(const std::string& id, const SliceOptions& options,
             const std::filesystem::path& target);

  // What a job with these parameters would make and take.
  Estimate estimate(const JobParameters& parameters);

  // The same key gives the same job again, also after the program was restarted; without one each
  // call makes its own, so that trying again is safe.
  Job submit(const JobParameters& parameters, const std::string& idempotency_key = {});
  Job job(const std::string& id);
  // The job when it is done, or as it is after `wait` (whole seconds, the server allows 30).
  Job job(const std::string& id, std::chrono::seconds wait);
  // One page of the jobs in one state, or in any: the first, or the one that `cursor` stands for.
  JobPage jobs(std::optional<JobState> state = std::nullopt, const std::string& cursor = {});
  void cancel(const std::string& id);

  // Returns the job in its final state, whichever that is. With a callback the job is looked at
  // once a second at least, and the callback also sees the final state.
  Job wait(const std::string& id, const JobProgress& progress = {});

  // Returns the job in its final state, and tells what happens on the way without asking for it
  // time and again. A stream that breaks is taken up where it broke.
  Job follow(const std::string& id, const JobListener& listener);

  // The labels of a finished job, in ascending order: also if they are so many that the job tells
  // only `labels_count`. Throws kNotReady, the job's own error or kCancelled as fetch() does.
  std::vector<LabelSummary> job_labels(const std::string& id);

  // Writes the mesh of a finished job to `target`, which appears only when all of its bytes have
  // come and have the SHA-256 that the job states; a connection that breaks is taken up where it
  // broke. Throws kNotReady when the job is not done, the
  // job's own error when it failed, kCancelled when it was cancelled, kNotFound when it was not
  // asked for that format, kDigestMismatch when other bytes came. Of a job by labels, with `label`,
  // one label's own surface.
  void fetch(const std::string& id, MeshFormat format, const std::filesystem::path& target,
             const TransferProgress& progress = {},
             std::optional<std::int64_t> label = std::nullopt);

  // Orders meshes of a series that is in a PACS. The same key gives the same order again.
  Order submit_order(const OrderRequest& request, const std::string& idempotency_key = {});
  // The order when it has ended, or as it is after `wait` (whole seconds, the server allows 30).
  Order order(const std::string& id, std::chrono::seconds wait = std::chrono::seconds(0));
  // Returns the order in its final state. With a callback it is looked at often at first, so that
  // short steps are seen, and later once a second.
  Order wait_for_order(const std::string& id, const OrderProgress& progress = {});
  // One page, of the orders in that state and of that rule where they are given.
  OrderPage orders(std::optional<OrderState> state = std::nullopt, const std::string& rule = {},
                   const std::string& cursor = {});
  Order cancel_order(const std::string& id);
  // Tries a failed order anew. Throws kNotReady for one that has not failed.
  Order retry_order(const std::string& id);
  std::vector<PacsStatus> pacs();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isomesh
