// The HTTP side of the daemon.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "server/callbacks/callbacks.h"
#include "server/http/guards/auth.h"
#include "server/http/observe/metrics.h"
#include "server/http/upload.h"
#include "server/jobs/estimate.h"
#include "server/jobs/histograms.h"
#include "server/jobs/label_lists.h"
#include "server/jobs/volume_library.h"
#include "server/net/address.h"
#include "server/net/tls.h"
#include "server/orders/orders.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"
#include "server/store/outbox.h"
#include "server/store/retention.h"
#include "server/store/volume_store.h"

namespace isomesh::http {

struct ServerOptions {
  // Of each of these, and of event_streams, one owner or address has a share (net::FairPlaces).
  std::size_t connections = 2048;
  std::size_t threads = 32;        // requests that are worked on at once
  std::size_t backlog = 512;       // requests that wait for a thread
  std::size_t upload_places = 16;  // of the threads, how many may hold uploads
  // How long a connection may take to send its request, up to a small body.
  std::chrono::milliseconds request_time{10'000};
  std::size_t event_streams = 512;
  UploadLimits upload;
  // That uploads which come in parts may take together; 0: a quarter of the disk.
  std::uint64_t part_bytes = 0;
  std::vector<std::string> cors_origins;  // pages of which origins may use the service, `*` for all
  std::vector<std::string> hosts;         // names of this service beside loopback's, without ports
  bool blob_redirect = false;             // downloads may be sent to where the bytes are
  const net::TlsFiles* tls = nullptr;     // null: connections are plain
};

// What the routes call.
struct Services {
  const store::DataFolder& folder;
  const store::BlobStore& blobs;
  const store::VolumeStore& volumes;
  store::JobStore& jobs;
  jobs::VolumeLibrary& library;
  jobs::Histograms& histograms;
  jobs::LabelLists& labels;
  jobs::Estimator& estimator;
  store::Retention& retention;
  Metrics& metrics;
  const store::Outbox& outbox;
  callbacks::Callbacks& callbacks;
  const callbacks::CallbackTargets& callback_targets;
  const Tokens* tokens = nullptr;    // null: requests are not authenticated
  orders::Orders* orders = nullptr;  // null: no PACS is configured
};

// Thread safe where said.
class Server {
 public:
  Server(const Services& services, const ServerOptions& options);
  // As stop().
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  // Binds; returns what clients connect to, such as http://127.0.0.1:8080 or unix:/run/iso.sock.
  // Throws Error kUnavailable when the address cannot be bound.
  std::string bind(const net::Address& address);

  // Serves until stop(); to be called once, after bind. Whatever serving needs is there when it
  // returns. Throws std::system_error if a thread cannot be started.
  void start();

  // /readyz answers 503 from now on, so that a load balancer looks elsewhere, and no job is
  // accepted. Thread safe.
  void begin_drain();

  // Returns when nothing is served any more: no connection is accepted, nobody waits for a job,
  // uploads and imports are cut off. To be called after the orders have ended.
  void stop();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace isomesh::http
