// Takes series that peers send by C-STORE.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "base/mutex.h"
#include "server/net/listener.h"
#include "server/orders/hospital.h"
#include "server/process/dimse_message.h"
#include "server/process/prepared.h"
#include "server/store/audit_trail.h"
#include "server/store/blob_store.h"
#include "server/store/files/data_folder.h"
#include "server/store/received_store.h"

namespace isomesh::dimse {

// Throws Error kInvalidParameter, field "dimse.listen".
net::Address listen_address(const orders::DimseSettings& settings);

// What it needs of everything else, which must outlive it.
struct ListenerServices {
  const store::DataFolder& folder;
  const store::BlobStore& blobs;
  store::ReceivedStore& received;
  store::AuditTrail& audit;
  process::PreparedProcesses& processes;  // of isomesh-dimse
};

// Listens from its making on. Each association has a thread here, which does not look at what the
// peer sends, and a confined process, which does. An object is acknowledged when it is a blob on
// the disk that a record names.
class DimseListener {
 public:
  // Throws Error kInvalidParameter or kUnavailable when it cannot listen there.
  DimseListener(const ListenerServices& services, const orders::DimseSettings& settings);
  // Ends the associations.
  ~DimseListener() { stop(); }
  DimseListener(const DimseListener&) = delete;
  DimseListener& operator=(const DimseListener&) = delete;

  // HOST:PORT, with the port that was found.
  std::string authority() const { return listener_.authority(); }

  void stop();

 private:
  void serve(const std::stop_token& stop);
  // None when there is none within a moment.
  Descriptor next_connection() const;
  void serve_association(const Descriptor& peer, const std::stop_token& stop);
  process::DimseVerdict keep(const process::DimseObject& object,
                             const std::filesystem::path& folder);
  bool has_room(std::uint64_t more_bytes) const;
  void note_end(const process::DimseEnded& ended);

  const ListenerServices services_;
  const orders::DimseSettings settings_;
  const net::Listener listener_;
  Mutex mutex_;
  std::chrono::steady_clock::time_point next_note_ ISOMESH_GUARDED_BY(mutex_);
  std::vector<std::jthread> threads_;  // last: run on all of the above
};

}  // namespace isomesh::dimse
