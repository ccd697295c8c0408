#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "server/hospital/orders/label_grid.h"
#include "server/hospital/orders/pacs.h"
#include "server/hospital/orders/settings.h"
#include "server/hospital/records/order_store.h"
#include "server/hospital/records/received_store.h"
#include "server/jobs/library/label_lists.h"
#include "server/jobs/library/volume_library.h"
#include "server/store/audit/trail.h"
#include "server/store/blob_store.h"
#include "server/store/files/data_folder.h"
#include "server/store/job_store.h"
#include "server/store/volume_store.h"

namespace isomesh::orders {

using Peers = std::map<std::string, Peer, std::less<>>;

struct OrderServices {
  const store::DataFolder& folder;
  store::BlobStore& blobs;
  const store::VolumeStore& volumes;
  store::JobStore& jobs;
  jobs::VolumeLibrary& library;
  jobs::LabelLists& labels;
  store::OrderStore& orders;
  store::AuditTrail& audit;
  store::ReceivedStore& received;
  const Peers& peers;  // by name: the configured PACS, and the sources of received series
};

// The order ended during a step, for example because it was cancelled.
struct OrderIsOver {};

// Each step depends on the order's record only, so any process can make the next one. A step can be
// repeated: it saves its result before anything depends on it. Thread safe for different orders;
// its dependencies must outlive it.
class OrderSteps {
 public:
  using Clock = std::function<store::Time()>;

  OrderSteps(const OrderServices& services, const HospitalSettings& settings, Clock now)
      : services_(services), settings_(settings), now_(std::move(now)) {}

  // Makes and saves the next step of an open order; returns when the following one is due. Throws
  // PacsFailure and Error if the step failed; `record` then has the state to save. Every return to
  // an earlier step is such a failure, so that none repeats without a pause. Throws OrderIsOver.
  // `stored` gets the keys of the objects that the step stores, also if it throws: the caller
  // passes them to erase_unnamed.
  store::Time advance(store::OrderRecord& record, const std::stop_token& stop,
                      std::vector<std::string>& stored) const;

  // The PACS of the next step; empty if it uses none.
  static std::string pacs_of(const store::OrderRecord& record);

 private:
  // Adds a query of the order's PACS, and its success, to the audit trail.
  void note_query(store::OrderRecord& record, bool success) const;
  store::Time wait_for_series(store::OrderRecord& record, const std::stop_token& stop) const;
  // Steps of orders that perform a workitem: worklist_steps.cpp.
  Worklist& worklist(const Workitem& item) const;
  store::Time claim(store::OrderRecord& record, const std::stop_token& stop) const;
  // Tells the worklist of the order's step. Returns false, after ending the order, if the worklist
  // has ended the workitem.
  bool tell(store::OrderRecord& record, const std::stop_token& stop) const;
  store::Time tell_end(store::OrderRecord& record, const std::stop_token& stop) const;
  std::string performed(const store::OrderRecord& record) const;

  store::Time fetch(store::OrderRecord& record, const std::stop_token& stop) const;
  store::Time mesh(store::OrderRecord& record, const std::stop_token& stop,
                   std::vector<std::string>& stored) const;
  bool is_lost(const Error& error, const store::OrderRecord& record,
               const std::stop_token& stop) const;
  std::string segmented_series_of(const store::OrderRecord& record,
                                  const std::stop_token& stop) const;
  store::Time submit_job(store::OrderRecord& record) const;
  store::Time make(store::OrderRecord& record, const Job& job, const std::stop_token& stop,
                   std::vector<std::string>& stored) const;
  store::Time send(store::OrderRecord& record, const std::stop_token& stop) const;
  // False if the study belongs to another patient now.
  bool is_same_patient(const store::OrderRecord& record, const OrderResult& result,
                       const std::stop_token& stop) const;
  // Throws PacsFailure kChanged if the study belongs to another patient now. The record is then at
  // the step that repairs this.
  void check_patient(store::OrderRecord& record, std::size_t index,
                     const std::stop_token& stop) const;
  // As above, but throws Error kUnavailable if the object is damaged or missing.
  void check_object(store::OrderRecord& record, std::size_t index,
                    const std::stop_token& stop) const;
  // Saves beforehand that the order sends the object. Returns false if the PACS says that it has
  // the object, but does not list it.
  bool send_one(store::OrderRecord& record, std::size_t index, const std::stop_token& stop) const;
  // Saves the order, and returns when the PACS is queried again for an object that it does not list
  // yet. Throws PacsFailure kNotStored after some time.
  store::Time look_again(store::OrderRecord& record, std::size_t index) const;
  // Saves the order after `step` has succeeded, and resets failures of that and earlier steps.
  // Returns `next`, or the time after kLongestWait if that is earlier. Throws OrderIsOver.
  store::Time save_after(OrderState step, store::OrderRecord& record, store::Time next) const;
  // As above, without resetting failures.
  store::Time save(store::OrderRecord& record, store::Time next) const;
  // Throw PacsFailure if there is no such peer, or it cannot do that.
  // Throws Error kUnusableVolume if the label volume does not fit the images, or is gone. Without
  // the sizes of the images, they were checked before.
  LabelGrid label_grid_of(
      const store::OrderRecord& record,
      const std::optional<std::array<std::uint32_t, 3>>& image_dims = std::nullopt) const;
  const Peer& peer(const std::string& name) const;
  SeriesSource& source(const std::string& name) const;
  // Empty if the PACS cannot be queried; its response to storing is then the only evidence.
  std::optional<bool> has_instance(const std::string& pacs, const InstancePlace& place,
                                   const std::stop_token& stop) const;

  const OrderServices services_;
  const HospitalSettings& settings_;
  const Clock now_;
};

}  // namespace isomesh::orders
