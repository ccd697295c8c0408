// Takes series that peers send by C-STORE.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "base/mutex.h"
#include "server/hospital/dimse/acceptor.h"
#include "server/hospital/orders/hospital.h"
#include "server/net/fair_places.h"
#include "server/net/listener.h"
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
//
// Addresses share the associations (FairPlaces). Where there is no place for one more, the one that
// has been idle for the longest time ends, if that is long enough.
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
  struct Association {
    Descriptor peer;
    std::string party;
    net::FairPlaces::Place place;
    std::stop_source end = {};
    std::atomic<bool> has_sent = false;    // an object
    std::atomic<bool> is_storing = false;  // which the peer waits for
    // When its process began, or an object was stored last; then it is the peer's turn.
    std::atomic<std::chrono::steady_clock::time_point> told = {};
  };

  bool begin(AssociationRequest& request);
  void make_room(const std::string& party);
  static bool is_idle(const Association& association, std::chrono::milliseconds& idle);
  void serve(const std::stop_token& stop);
  std::shared_ptr<Association> next_association(const std::stop_token& stop);
  void serve_association(Association& association);
  process::DimseVerdict keep(const process::DimseObject& object,
                             const std::filesystem::path& folder);
  bool has_room(std::uint64_t more_bytes) const;
  void note_end(const process::DimseEnded& ended);

  const ListenerServices services_;
  const orders::DimseSettings settings_;
  const net::Listener listener_;
  net::FairPlaces places_;
  Mutex mutex_;
  Condition changed_;
  // All that have begun, and those of them that no thread has taken yet.
  std::vector<std::shared_ptr<Association>> open_ ISOMESH_GUARDED_BY(mutex_);
  std::deque<std::shared_ptr<Association>> ready_ ISOMESH_GUARDED_BY(mutex_);
  std::chrono::steady_clock::time_point next_note_ ISOMESH_GUARDED_BY(mutex_);
  // Last: they run on all of the above.
  AssociationAcceptor acceptor_;
  std::vector<std::jthread> threads_;
};

}  // namespace isomesh::dimse
