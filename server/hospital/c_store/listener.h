// Receives series that peers send by C-STORE.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "base/mutex.h"
#include "base/throttle.h"
#include "server/hospital/c_store/acceptor.h"
#include "server/hospital/c_store/tls_entrance.h"
#include "server/hospital/dimse/message.h"
#include "server/hospital/orders/settings.h"
#include "server/hospital/records/received_store.h"
#include "server/net/fair_places.h"
#include "server/net/listener.h"
#include "server/process/prepared.h"
#include "server/store/audit/trail.h"
#include "server/store/blob_store.h"
#include "server/store/files/data_folder.h"
#include "server/store/volume_store.h"

namespace isomesh::c_store {

// Throws Error kInvalidParameter, field "dimse.listen".
net::Address listen_address(const orders::DimseSettings& settings);

// Dependencies of the listener, which must outlive it.
struct ListenerServices {
  const store::DataFolder& folder;
  store::BlobStore& blobs;
  const store::VolumeStore& volumes;
  store::ReceivedStore& received;
  store::AuditTrail& audit;
  process::PreparedProcesses& processes;  // running isomesh-dimse
};

// Listens as soon as it is constructed. Each association has a thread, which does not parse the
// peer's bytes, and a confined process, which does. An object is acknowledged once it is a blob on
// disk that a record names.
//
// Addresses share the associations (FairPlaces). If there is no place for another one, the
// association that has been idle longest ends, if that is long enough.
class DimseListener {
 public:
  // Throws Error kInvalidParameter, also for its certificate files, or kUnavailable if it cannot
  // listen on the address.
  DimseListener(const ListenerServices& services, const orders::DimseSettings& settings);
  // Ends the associations.
  ~DimseListener() { stop(); }
  DimseListener(const DimseListener&) = delete;
  DimseListener& operator=(const DimseListener&) = delete;

  // HOST:PORT with the actual port.
  std::string authority() const { return listener_.authority(); }

  void stop();

 private:
  struct Association {
    std::shared_ptr<TlsRelay> tls;  // as in AssociationRequest
    Descriptor peer;
    std::string party;
    net::FairPlaces::Place place;
    std::stop_source end = {};
    std::atomic<bool> has_sent = false;    // at least one object
    std::atomic<bool> is_storing = false;  // the peer waits for that
    // When its process started or last stored an object; from then on the peer's next message is
    // awaited.
    std::atomic<std::chrono::steady_clock::time_point> told = {};
  };

  struct Rejection {
    std::string reason;
    std::string peer;
    std::string called;
    std::string calling;
  };

  // The number of stored objects by called title, calling title and study.
  using Transfers = std::map<std::array<std::string, 3>, std::uint64_t>;

  AcceptorHooks hooks();
  bool begin(AssociationRequest& request);
  // The titles that may send over this association.
  std::vector<std::string> calling_titles(const Association& association) const;
  void make_room(const std::string& party);
  static bool is_idle(const Association& association, std::chrono::milliseconds& idle);
  void serve(const std::stop_token& stop);
  std::shared_ptr<Association> next_association(const std::stop_token& stop);
  void serve_association(Association& association);
  void receive(Association& association, Transfers& transfers);
  dimse::DimseVerdict keep(const dimse::DimseObject& object, const std::stop_token& stop,
                           const std::filesystem::path& folder);
  bool has_room(std::uint64_t more_bytes) const;
  void note_end(const dimse::DimseEnded& ended, const std::string& party);
  void note_fault(const std::string& party, net::TlsFault fault);
  // Adds a rejection, with its reason, to the log and the audit trail.
  void note_rejection(std::string_view reason, const dimse::DimseEnded& ended,
                      const std::string& party);
  // Returns false if the trail cannot be written to.
  bool tell(const Rejection& rejection, std::uint64_t unlisted) const;
  // Adds what an association has stored to the audit trail.
  void note_transfers(const Transfers& transfers, const std::string& party);

  const ListenerServices services_;
  const orders::DimseSettings settings_;
  std::optional<TlsEntrance> entrance_;  // empty: associations are not encrypted
  const net::Listener listener_;
  net::FairPlaces places_;
  Mutex mutex_;
  Condition changed_;
  // All open associations, and those that no thread has taken yet.
  std::vector<std::shared_ptr<Association>> open_ ISOMESH_GUARDED_BY(mutex_);
  std::deque<std::shared_ptr<Association>> ready_ ISOMESH_GUARDED_BY(mutex_);
  // Otherwise anybody who can connect could fill the trail, which cannot be emptied.
  Throttle<Rejection> rejections_{std::chrono::seconds(1),
                                  [this](const Rejection& rejection, std::uint64_t unlisted) {
                                    return tell(rejection, unlisted);
                                  }};
  // Last: its thread and these use the other members.
  AssociationAcceptor acceptor_;
  std::vector<std::jthread> threads_;
};

}  // namespace isomesh::c_store
