// The service's configuration, and the components that its routes call.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "server/callbacks/callbacks.h"
#include "server/http/app/wing.h"
#include "server/http/guards/proxies.h"
#include "server/http/guards/tokens.h"
#include "server/http/observe/metrics.h"
#include "server/http/oidc/provider.h"
#include "server/http/requests/upload.h"
#include "server/jobs/library/histograms.h"
#include "server/jobs/library/label_lists.h"
#include "server/jobs/library/volume_library.h"
#include "server/jobs/queue/estimate.h"
#include "server/net/tls.h"
#include "server/store/audit/trail.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"
#include "server/store/outbox.h"
#include "server/store/retention.h"
#include "server/store/volume_store.h"

namespace isomesh::http {

struct ServerOptions {
  // One owner or address has a fair share of each of these and of event_streams (net::FairPlaces).
  std::size_t connections = 2048;
  std::size_t threads = 32;        // requests processed concurrently
  std::size_t backlog = 512;       // requests waiting for a thread
  std::size_t upload_places = 16;  // threads that may hold uploads
  // Time limit for a connection to send its request, up to a small body.
  std::chrono::milliseconds request_time{10'000};
  std::size_t event_streams = 512;
  UploadLimits upload;
  // Total size of incomplete resumable uploads; 0: a quarter of the disk.
  std::uint64_t part_bytes = 0;
  std::vector<std::string> cors_origins;  // origins of pages that may use the service; `*` for all
  std::vector<std::string> hosts;         // names of this service beside loopback's, without ports
  std::vector<std::string> trusted_proxies;  // as TrustedProxies has them
  ClientHeader proxy_header = ClientHeader::kXForwardedFor;
  bool blob_redirect = false;          // downloads may be redirected to the blob store
  const net::TlsFiles* tls = nullptr;  // null: no TLS
};

// Give each by its name. All must outlive the server.
struct Services {
  // Stored data.
  const store::DataFolder& folder;
  const store::BlobStore& blobs;
  const store::VolumeStore& volumes;
  store::JobStore& jobs;
  const store::Outbox& outbox;
  store::AuditTrail& audit;
  // Work on it.
  jobs::VolumeLibrary& library;
  jobs::Histograms& histograms;
  jobs::LabelLists& labels;
  jobs::Estimator& estimator;
  store::Retention& retention;
  // Reports to others, and access.
  Metrics& metrics;
  callbacks::Callbacks& callbacks;
  const callbacks::CallbackTargets& callback_targets;
  // Without both, requests are not authenticated.
  const Tokens* tokens = nullptr;
  const oidc::Provider* provider = nullptr;
  Wing* wing = nullptr;  // null: the build has none
};

}  // namespace isomesh::http
