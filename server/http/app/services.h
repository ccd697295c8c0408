// How the service is set, and what its routes call.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "server/callbacks/callbacks.h"
#include "server/http/app/wing.h"
#include "server/http/guards/auth.h"
#include "server/http/observe/metrics.h"
#include "server/http/requests/upload.h"
#include "server/jobs/estimate.h"
#include "server/jobs/histograms.h"
#include "server/jobs/label_lists.h"
#include "server/jobs/volume_library.h"
#include "server/net/tls.h"
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
  const Tokens* tokens = nullptr;  // null: requests are not authenticated
  Wing* hospital = nullptr;        // null: the build has none
};

}  // namespace isomesh::http
